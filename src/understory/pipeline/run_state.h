#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "understory/pipeline/resumable.h"
#include "understory/pipeline/run_request.h"
#include "understory/preprocess/event_orderer.h"

namespace understory {

// The front ends of `understory map`, as a checkpoint names them.
constexpr const char* kDenseFrontEnd = "dense";
constexpr const char* kSparseFrontEnd = "sparse";

// The part of the run folder that belongs to a run in progress, by either front end: RUN/work with
// the files of the session and the checkpoint. It is removed when the run is finished.
class RunState {
 public:
  // Of a run that begins. Writes nothing yet. Throws OutputError if the run folder holds an
  // unfinished run and `overwrite` is not set.
  [[nodiscard]] static RunState create(const RunRequest& request, const std::string& front_end);
  // Opens that of a killed run and reads back its request. Throws InputError if there is none.
  [[nodiscard]] static RunState reopen(const std::filesystem::path& run_folder,
                                       RunRequest& request);

  // Makes the run folder and an empty work folder: once the recording is open, so that one that
  // cannot be read leaves nothing behind and takes no unfinished run away. Throws OutputError if
  // it cannot be written.
  void make_folder() const;

  [[nodiscard]] const std::filesystem::path& work() const { return work_; }
  [[nodiscard]] const std::string& front_end() const { return front_end_; }
  // Events that the checkpoint has behind it; 0 at the start.
  [[nodiscard]] std::uint64_t events() const { return events_; }
  [[nodiscard]] TimeNs last_checkpoint() const { return last_checkpoint_; }

  // Brings session, orderer and log to the state of the checkpoint.
  void restore(Resumable& session, EventOrderer& orderer, Log& log, const Rig& rig) const;
  // Writes a checkpoint: `events` have been taken from the recording.
  void save(const RunRequest& request, Resumable& session, const EventOrderer& orderer,
            const Log& log, std::uint64_t events);
  // Removes the work folder, and the run folder if there is nothing else in it.
  void remove();

 private:
  RunState(std::filesystem::path work, std::string front_end)
      : work_(std::move(work)), front_end_(std::move(front_end)) {}

  std::filesystem::path work_;
  std::string front_end_;
  std::uint64_t events_ = 0;
  TimeNs last_checkpoint_ = 0;
  std::string state_;  // of session, orderer and log, as read
};

}  // namespace understory
