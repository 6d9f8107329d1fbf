#include "understory/pipeline/run_folder/run_folder.h"

#include <fmt/format.h>
#include <unistd.h>

#include <fstream>
#include <optional>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "understory/pipeline/run_folder/run_json.h"
#include "understory/pipeline/run_folder/run_results.h"
#include "understory/util/error.h"
#include "understory/util/files/atomic_file.h"
#include "understory/util/files/durable.h"
#include "understory/util/files/file_lock.h"
#include "understory/util/files/output_guard.h"

namespace understory {

namespace fs = std::filesystem;

namespace {

// The process at work in a folder.
std::string worker(long process) {
  return "another understory" + (process > 0 ? fmt::format(" (process {})", process) : "");
}

void refuse_foreign_place(const fs::path& folder) {
  std::error_code error;
  const fs::file_status status = fs::status(folder, error);
  if (fs::exists(status) && !fs::is_directory(status))
    throw RefusedOutput(folder.string(), "is not a folder");
  refuse_folder_in_file(folder);
}

void refuse_running(const fs::path& folder) {
  const std::optional<long> holder = FileLock::holder(lock_of(folder));
  if (!holder) return;
  throw RefusedOutput(folder.string(), "is being written by " + worker(*holder));
}

std::set<std::string> placed_in(const fs::path& work) {
  std::set<std::string> names;
  std::ifstream file(placed_file(work));
  for (std::string name; std::getline(file, name);)
    names.insert(name);
  return names;
}

// Results in the folder that this program may replace.
std::set<std::string> own_results(const fs::path& folder) {
  std::set<std::string> names = former_results(folder).names;
  names.merge(placed_in(work_folder_of(folder)));
  return names;
}

void refuse_foreign_results(const fs::path& folder) {
  const std::string foreign = foreign_result(folder, own_results(folder));
  if (foreign.empty()) return;
  throw RefusedOutput((folder / foreign).string(),
                      "is there and no run in this folder has made it: name another folder for the "
                      "output, or move it away");
}

void refuse_runs(const fs::path& folder) {
  if (holds_unfinished_run(folder))
    throw RefusedOutput(folder.string(), "holds an unfinished run; go on with `" +
                                             resume_command(folder) +
                                             "` or give --overwrite to start anew");
  if (former_results(folder).present)
    throw RefusedOutput(folder.string(),
                        "holds the results of a run: give --overwrite to replace them, or name "
                        "another folder");
}

fs::path without_slash(const fs::path& folder) {
  return folder.has_filename() || !folder.has_relative_path() ? folder : folder.parent_path();
}

void rename_to(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::rename(from, to, error);
  if (error) throw OutputError(to.string(), "cannot be put in place: " + error.message());
}

// A power cut leaves each of the files in the one folder or in the other.
void move_durably(const std::vector<std::string>& names, const fs::path& from, const fs::path& to) {
  for (const std::string& name : names)
    rename_to(from / name, to / name);
  sync_folder(to);
  sync_folder(from);
}

// A folder RUN/former-N that is not there yet.
fs::path make_former_folder(const fs::path& folder) {
  for (int n = 1;; ++n) {
    fs::path former = folder / fmt::format("former-{}", n);
    std::error_code error;
    if (is_there(former)) continue;
    if (!fs::create_directory(former, error))
      throw OutputError(former.string(), "cannot be made: " + error.message());
    return former;
  }
}

}  // namespace

struct RunFolder::Claim {
  explicit Claim(const fs::path& folder);
  ~Claim();
  Claim(const Claim&) = delete;
  Claim& operator=(const Claim&) = delete;

  void take(bool overwrite);
  void check(bool overwrite) const;
  void take_lock();

  fs::path path;
  fs::path work;
  std::optional<MadeFolders> made;  // let go of last: it removes what is empty
  std::optional<FileLock> lock;
};

RunFolder::Claim::Claim(const fs::path& folder)
    : path(without_slash(folder)), work(work_folder_of(path)) {}

void RunFolder::Claim::take(bool overwrite) {
  check(overwrite);
  made.emplace(work);
  take_lock();
  check(overwrite);  // once more: another process may have been at work until the lock came
  leave_marker(work);
  made->sync();
}

void RunFolder::Claim::check(bool overwrite) const {
  refuse_foreign_place(path);
  refuse_foreign_work(path);
  if (!lock) refuse_running(path);
  if (!overwrite) refuse_runs(path);
  refuse_foreign_results(path);
}

RunFolder::Claim::~Claim() {
  if (!lock) return;
  clear_results(work);
  if (!holds_unfinished_run(path)) remove_work_folder(work);
}

void RunFolder::Claim::take_lock() {
  lock = FileLock::take(lock_of(path));
  if (lock) return;
  refuse_running(path);
  throw RefusedOutput(path.string(), "is being written by " + worker(0));
}

RunFolder::RunFolder(std::unique_ptr<Claim> claim) : claim_(std::move(claim)) {}
RunFolder::~RunFolder() = default;
RunFolder::RunFolder(RunFolder&&) noexcept = default;
RunFolder& RunFolder::operator=(RunFolder&&) noexcept = default;

RunFolder RunFolder::claim(const fs::path& folder, bool overwrite) {
  if (folder.empty()) throw ConfigError({"the name of the output folder is empty"});
  auto claim = std::make_unique<Claim>(folder);
  claim->take(overwrite);
  return RunFolder(std::move(claim));
}

RunFolder RunFolder::reclaim(const fs::path& folder) {
  const fs::path path = without_slash(folder);
  refuse_foreign_work(path);
  refuse_running(path);
  if (!holds_unfinished_run(path)) {
    std::error_code ignored;
    const std::string none = "there is no unfinished run to go on with";
    throw InputError(
        folder.string(), "",
        former_results(path).present
            ? "the run in it is finished: there is nothing to go on with. Its results are there, "
              "begin with report.html"
        : fs::exists(path, ignored)
            ? none + "; `understory map RECORDING -o " + folder.string() + "` begins one"
            : none + ": no such folder");
  }
  return claim(path, true);
}

const fs::path& RunFolder::path() const {
  return claim_->path;
}

fs::path RunFolder::work() const {
  return claim_->work;
}

fs::path RunFolder::begin_results() const {
  fs::path results = results_in(work());
  std::error_code error;
  fs::remove_all(results, error);
  if (!error) fs::create_directory(results, error);
  if (error) throw OutputError(results.string(), "cannot be made: " + error.message());
  return results;
}

void RunFolder::forget_state() const {
  clear_state(work());
}

void RunFolder::commit(Log& log, bool keep_former) const {
  const fs::path results = results_in(work());
  const FormerResults former = former_results(path());
  std::set<std::string> own = own_results(path());
  std::set<std::string> made;
  for (const fs::directory_entry& entry : fs::directory_iterator(results)) {
    made.insert(entry.path().filename().string());
    UNDERSTORY_CHECK(is_result_name(entry.path().filename().string()));
  }
  refuse_foreign_results(path());  // that came while the run was at work
  write_file_list(results, made);
  own.insert(made.begin(), made.end());
  AtomicTextFile placed(placed_file(work()));
  for (const std::string& name : own)
    placed.write(name + "\n");
  placed.commit();
  put_aside(former.names, keep_former ? std::set<std::string>() : made, log);
  // Never beside results of another run, on the disk neither: it goes first and comes last.
  (void)::unlink((path() / "run.json").c_str());
  sync_folder(path());
  made.erase("run.json");
  for (const std::string& name : made)
    rename_to(results / name, path() / name);
  sync_folder(path());
  rename_to(results / "run.json", path() / "run.json");
  // On the disk before the state that they were made of goes.
  sync_folder(results);
  sync_folder(path());
}

void RunFolder::put_aside(const std::set<std::string>& former, const std::set<std::string>& made,
                          Log& log) const {
  std::vector<std::string> kept;
  for (const std::string& name : former) {
    std::error_code error;
    const bool stays = made.count(name) == 0 && name != "run.json" && name != "report.html";
    if (stays && fs::is_regular_file(fs::symlink_status(path() / name, error)))
      kept.push_back(name);
  }
  if (kept.empty()) return;
  const fs::path folder = make_former_folder(path());
  log.warn("run.former_results",
           fmt::format("the run does not make {} anew: those of the former run are kept in {}",
                       fmt::join(kept, ", "), folder.string()));
  sync_folder(path());
  move_durably(kept, path(), folder);
  // They name the files that are kept, so they stay until those have moved.
  std::vector<std::string> named_last;
  for (const char* name : {"report.html", "run.json"}) {
    if (former.count(name) != 0 && is_there(path() / name)) named_last.emplace_back(name);
  }
  move_durably(named_last, path(), folder);
}

}  // namespace understory
