#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "understory/pipeline/resumable.h"
#include "understory/pipeline/run_folder.h"
#include "understory/pipeline/run_request.h"
#include "understory/preprocess/event_orderer.h"

namespace understory {

// The front ends of `understory map`, as a checkpoint names them.
constexpr const char* kDenseFrontEnd = "dense";
constexpr const char* kSparseFrontEnd = "sparse";

// The state of a run in progress, by either front end: the files of the session and the checkpoint
// in the work folder of the run folder, which is claimed for as long. Gone when the run is
// finished.
class RunState {
 public:
  // Of a run that begins. Claims the run folder and leaves what is in it as it is. Throws
  // OutputError if that is refused (run_folder.h).
  [[nodiscard]] static RunState create(const RunRequest& request, const std::string& front_end);
  // Opens that of a killed run and reads back its request. Throws InputError if there is none.
  [[nodiscard]] static RunState reopen(const std::filesystem::path& run_folder,
                                       RunRequest& request);

  // Forgets the state of an unfinished run that this one replaces: once the recording is open, so
  // that one that cannot be read takes no unfinished run away.
  void forget_former() const { folder_.forget_state(); }

  [[nodiscard]] const RunFolder& folder() const { return folder_; }
  [[nodiscard]] std::filesystem::path work() const { return folder_.work(); }
  // Goes on with an earlier run.
  [[nodiscard]] bool resumed() const { return resumed_; }
  [[nodiscard]] const std::string& front_end() const { return front_end_; }
  // Events that the checkpoint has behind it; 0 at the start.
  [[nodiscard]] std::uint64_t events() const { return events_; }
  [[nodiscard]] TimeNs last_checkpoint() const { return last_checkpoint_; }

  // Brings session, orderer and log to the state of the checkpoint.
  void restore(Resumable& session, EventOrderer& orderer, Log& log, const Rig& rig) const;
  // Writes a checkpoint: `events` have been taken from the recording.
  void save(const RunRequest& request, Resumable& session, const EventOrderer& orderer,
            const Log& log, std::uint64_t events);
  // The run is finished, or nothing came of it: the work folder goes with this object.
  void remove() { folder_.forget_state(); }

 private:
  RunState(RunFolder folder, std::string front_end)
      : folder_(std::move(folder)), front_end_(std::move(front_end)) {}

  RunFolder folder_;
  std::string front_end_;
  bool resumed_ = false;
  std::uint64_t events_ = 0;
  TimeNs last_checkpoint_ = 0;
  std::string state_;  // of session, orderer and log, as read
};

}  // namespace understory
