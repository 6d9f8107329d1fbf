#include "understory/pipeline/run_folder/work_folder.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <string>
#include <system_error>
#include <vector>

#include "understory/util/error.h"
#include "understory/util/files/atomic_file.h"
#include "understory/util/files/durable.h"
#include "understory/util/files/output_guard.h"
#include "understory/util/shell_word.h"
#include "understory/util/version.h"

namespace understory {

namespace fs = std::filesystem;

namespace {

constexpr const char* kWork = ".understory";
constexpr const char* kMarker = "marker";
constexpr const char* kLock = "lock";
constexpr const char* kResults = "results";
constexpr const char* kTiles = "tiles";
constexpr const char* kPlaced = "placed";  // names of results that are being put in place
constexpr const char* kMarkerTitle = "Understory: work folder of a run";
constexpr int kFormat = 1;  // of the work folder

std::vector<fs::path> entries_of(const fs::path& folder) {
  std::vector<fs::path> entries;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error))
    entries.push_back(entry->path());
  return entries;
}

bool is_checkpoint(const fs::path& path) {
  return path.filename().string().rfind("checkpoint", 0) == 0 && path.extension() == ".bin";
}

bool holds_state(const fs::path& work) {
  for (const fs::path& entry : entries_of(work)) {
    if (is_checkpoint(entry)) return true;
  }
  return false;
}

// The format that a marker names; 0: it is no marker of this program.
int format_of(const fs::path& marker) {
  std::error_code error;
  if (!fs::is_regular_file(fs::symlink_status(marker, error))) return 0;
  std::ifstream file(marker);
  std::string title;
  std::string key;
  int format = 0;
  if (!std::getline(file, title) || title != kMarkerTitle) return 0;
  return file >> key >> format && key == "format:" ? format : 0;
}

// The same of a work folder, which is no link.
int format_of_work(const fs::path& work) {
  std::error_code error;
  return fs::is_directory(fs::symlink_status(work, error)) ? format_of(work / kMarker) : 0;
}

std::string newer_work(int format) {
  return fmt::format(
      "holds a run of a newer version (its work folder has format {}, this version knows {})",
      format, kFormat);
}

// A process that was stopped before it could leave a marker has left this at most.
bool holds_nothing_yet(const fs::path& work) {
  for (const fs::path& entry : entries_of(work)) {
    if (entry.filename() != kLock && entry.filename() != part_path(kMarker).filename())
      return false;
  }
  return true;
}

}  // namespace

bool is_there(const fs::path& path) {
  std::error_code error;
  return fs::exists(fs::symlink_status(path, error));
}

fs::path work_folder_of(const fs::path& run_folder) {
  return run_folder / kWork;
}
fs::path lock_of(const fs::path& run_folder) {
  return run_folder / kWork / kLock;
}
fs::path results_in(const fs::path& work) {
  return work / kResults;
}
fs::path placed_file(const fs::path& work) {
  return work / kPlaced;
}

bool holds_unfinished_run(const fs::path& run_folder) {
  const fs::path work = work_folder_of(run_folder);
  return format_of(work / kMarker) > 0 && holds_state(work);
}

std::string resume_command(const fs::path& run_folder) {
  return "understory map --resume " + shell_word(run_folder.string());
}

void refuse_newer_work(const fs::path& folder) {
  const int format = format_of_work(work_folder_of(folder));
  if (format > kFormat) throw InputError(folder.string(), "", newer_work(format));
}

void refuse_foreign_work(const fs::path& folder) {
  const fs::path work = work_folder_of(folder);
  if (!is_there(work)) return;
  std::error_code error;
  const bool is_folder = fs::is_directory(fs::symlink_status(work, error));
  const int format = format_of_work(work);
  if (format > kFormat) throw RefusedOutput(folder.string(), newer_work(format));
  if (format > 0 || (is_folder && holds_nothing_yet(work))) return;
  throw RefusedOutput(work.string(),
                      "is not of this program's making: name another folder for the output");
}

void leave_marker(const fs::path& work) {
  if (format_of(work / kMarker) > 0) return;
  AtomicFile marker(work / kMarker);
  marker.write(fmt::format("{}\nformat: {}\nversion: {}\n", kMarkerTitle, kFormat, kVersion));
  marker.commit();
}

void clear_results(const fs::path& work) {
  std::error_code ignored;
  fs::remove_all(work / kResults, ignored);
  fs::remove_all(work / kTiles, ignored);
}

void clear_state(const fs::path& work) {
  std::vector<fs::path> entries = entries_of(work);
  // Checkpoints go first: they count on the rest.
  const auto others = std::stable_partition(entries.begin(), entries.end(), is_checkpoint);
  for (auto entry = entries.begin(); entry != others; ++entry)
    (void)::unlink(entry->c_str());
  try {
    if (others != entries.begin()) sync_folder(work);  // after a power cut they do not come back
  } catch (const OutputError&) {
    return;  // the rest stays, for what may come back
  }
  for (auto entry = others; entry != entries.end(); ++entry) {
    if (entry->filename().string().find(".bin") != std::string::npos)
      (void)::unlink(entry->c_str());
  }
}

void remove_work_folder(const fs::path& work) {
  clear_results(work);
  clear_state(work);
  for (const fs::path& name : {fs::path(kPlaced), part_path(kPlaced), part_path(kMarker),
                               fs::path(kMarker), fs::path(kLock)})
    (void)::unlink((work / name).c_str());
  (void)::rmdir(work.c_str());  // stays where something else lies in it
}

}  // namespace understory
