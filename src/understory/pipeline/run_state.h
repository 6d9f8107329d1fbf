#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "understory/pipeline/mapping.h"
#include "understory/pipeline/mapping_session.h"
#include "understory/preprocess/event_orderer.h"

namespace understory {

// The part of the run folder that belongs to a run in progress: RUN/work with the files of the
// session and the checkpoint. It is removed when the run is finished.
class RunState {
 public:
  // Makes the run folder and its work folder; throws OutputError if it cannot be written, or if it
  // holds an unfinished run and `overwrite` is not set.
  [[nodiscard]] static RunState create(const MappingRequest& request);
  // Opens that of a killed run and reads back its request. Throws InputError if there is none.
  [[nodiscard]] static RunState reopen(const std::filesystem::path& run_folder,
                                       MappingRequest& request);

  [[nodiscard]] const std::filesystem::path& work() const { return work_; }
  // Events that the checkpoint has behind it; 0 at the start.
  [[nodiscard]] std::uint64_t events() const { return events_; }
  [[nodiscard]] TimeNs last_checkpoint() const { return last_checkpoint_; }

  // Brings session, orderer and log to the state of the checkpoint.
  void restore(MappingSession& session, EventOrderer& orderer, Log& log, const Rig& rig) const;
  // Writes a checkpoint: `events` have been taken from the recording.
  void save(const MappingRequest& request, MappingSession& session, const EventOrderer& orderer,
            const Log& log, std::uint64_t events);
  void remove();

 private:
  explicit RunState(std::filesystem::path work) : work_(std::move(work)) {}

  std::filesystem::path work_;
  std::uint64_t events_ = 0;
  TimeNs last_checkpoint_ = 0;
  std::string state_;  // of session, orderer and log, as read
};

}  // namespace understory
