#include "understory/pipeline/run_folder/run_version.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <sstream>
#include <string>
#include <system_error>
#include <vector>

#include "understory/output/run_summary.h"
#include "understory/pipeline/run_folder/run_json.h"
#include "understory/pipeline/run_folder/work_folder.h"
#include "understory/util/error.h"
#include "understory/util/files/file_lock.h"
#include "understory/util/version.h"

namespace understory {
namespace {

namespace fs = std::filesystem;
using Version = std::array<int, 3>;

// Of "1.2.3"; what is no number counts as zero.
Version version_of(const std::string& text) {
  Version version{};
  std::istringstream stream(text);
  std::string part;
  for (int& number : version) {
    if (!std::getline(stream, part, '.')) break;
    std::istringstream(part) >> number;
  }
  return version;
}

// A newer version may know more commands: its format tells that it is a run.
bool is_a_run(const RunJson& json) {
  return json.is_ours() ||
         (json.find_number("/format") >= 1.0 && !json.find_text("/command").empty() &&
          !json.find_text("/version").empty());
}

void check_version(const fs::path& folder, const RunJson& json, Log& log) {
  const std::string version = json.find_text("/version");
  const double format = json.find_number("/format");
  if (format > kRunFormat)
    throw InputError(folder.string(), "",
                     fmt::format("was written by version {} of the program, in format {:.0f}. This "
                                 "is version {}, which reads format {} at most: use the newer one",
                                 version, format, kVersion, kRunFormat));
  if (version_of(version) > version_of(kVersion))
    log.warn("run.newer_version",
             fmt::format("{} was written by version {} of the program, and this is {}: what the "
                         "newer version added is not read",
                         folder.string(), version, kVersion));
}

void refuse_unfinished(const fs::path& folder) {
  if (const std::optional<long> process = FileLock::holder(lock_of(folder)))
    throw InputError(folder.string(), "",
                     fmt::format("is being written by another understory{}: its results are there "
                                 "when that has ended",
                                 *process > 0 ? fmt::format(" (process {})", *process) : ""));
  if (holds_unfinished_run(folder))
    throw InputError(
        folder.string(), "",
        "holds a map that is not finished: `" + resume_command(folder) + "` finishes it");
}

}  // namespace

void check_given_run(const fs::path& given, Log& log) {
  std::error_code error;
  const fs::file_status status = fs::status(given, error);
  if (fs::is_directory(status)) {
    refuse_newer_work(given);
    const RunJson json(given);
    if (is_a_run(json))
      check_version(given, json, log);
    else
      refuse_unfinished(given);
  } else if (fs::is_regular_file(status)) {
    const fs::path folder = given.has_parent_path() ? given.parent_path() : fs::path(".");
    const RunJson json(folder);
    const std::vector<std::string> files = json.find_texts("/files");
    if (is_a_run(json) &&
        std::find(files.begin(), files.end(), given.filename().string()) != files.end())
      check_version(folder, json, log);
  }
}

}  // namespace understory
