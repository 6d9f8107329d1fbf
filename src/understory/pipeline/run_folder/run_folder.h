#pragma once

#include <filesystem>
#include <memory>
#include <set>
#include <string>

#include "understory/pipeline/run_folder/work_folder.h"
#include "understory/util/log.h"

namespace understory {

// A folder of results, claimed by one command that writes them. While it is claimed, it has a work
// folder RUN/.understory with
//   marker    a text that names this program and the version of the format,
//   lock      held by the process at work; it falls with the process,
//   results/  results until `commit`: a command that fails leaves the former ones as they are,
//   the state of a mapping run that can be resumed (run_state.h).
// In RUN itself only results of an earlier command are changed or removed. Its run.json names them.
// Not thread-safe.
class RunFolder {
 public:
  // Makes the folder if it is missing and claims it. Throws OutputError, with everything as it
  // was, if it
  //   - is no folder or cannot be written,
  //   - is being written by another process,
  //   - holds a work folder that is not of this program, or of a newer version,
  //   - holds a run, finished or not, and `overwrite` is not set,
  //   - holds a file by the name of a result that no run of this program has left there.
  [[nodiscard]] static RunFolder claim(const std::filesystem::path& folder, bool overwrite);
  // Claims that of an unfinished run. Throws InputError if there is none, OutputError as above.
  [[nodiscard]] static RunFolder reclaim(const std::filesystem::path& folder);

  // Lets the folder go. Where there is nothing to resume, it removes the work folder, and RUN if
  // `claim` made it and it is empty.
  ~RunFolder();
  RunFolder(RunFolder&&) noexcept;
  RunFolder& operator=(RunFolder&&) noexcept;

  [[nodiscard]] const std::filesystem::path& path() const;
  [[nodiscard]] std::filesystem::path work() const;
  // Where results are written until `commit`. Makes it, empty where it was not. Throws OutputError.
  [[nodiscard]] std::filesystem::path begin_results() const;
  // Removes the state of a run from the work folder.
  void forget_state() const;

  // Puts the results in place, run.json last and with the list of them. Former results without a
  // successor go to a folder of their own, RUN/former-N, with their run.json and report. With
  // `keep_former` all former results do. The log is told (key "run.former_results"). A power cut at
  // any moment loses no former result without a successor, and a run that can be resumed stays so.
  // Throws OutputError.
  void commit(Log& log, bool keep_former = false) const;

 private:
  struct Claim;
  explicit RunFolder(std::unique_ptr<Claim> claim);
  void put_aside(const std::set<std::string>& former, const std::set<std::string>& made,
                 Log& log) const;
  std::unique_ptr<Claim> claim_;
};

}  // namespace understory
