#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "understory/pipeline/mapping/mapping_request.h"
#include "understory/pipeline/run_folder/checkpoint.h"
#include "understory/pipeline/run_folder/resumable.h"
#include "understory/pipeline/run_folder/run_folder.h"
#include "understory/preprocess/streams/event_orderer.h"

namespace understory {

struct UnfinishedRun;

// The state of a run in progress, by either front end. It is the files of the session and the two
// newest checkpoints, in the work folder of the run folder. The run claims that folder until it
// ends. Gone when the run is finished.
//
// A power cut at any moment costs what came after the last checkpoint. What a checkpoint counts on
// is on the disk before it, and it is there before the one before the last is gone. Each record of
// each file has a checksum. docs/method/decisions/003-durability.md
class RunState {
 public:
  // Of a run that begins. Claims the run folder and leaves what is in it as it is. Throws
  // OutputError if that is refused (run_folder.h).
  [[nodiscard]] static RunState create(const MappingRequest& request);
  // Opens that of a killed run and reads back its request, from the newest checkpoint that is whole
  // with all that it counts on. The run folder is claimed before anything in it is read. Throws
  // InputError if there is none, with the state as it was; OutputError as RunFolder::reclaim.
  [[nodiscard]] static UnfinishedRun reopen(const std::filesystem::path& run_folder);

  // Of a run that begins: notes what the inputs are. Of one that is resumed: throws InputError if
  // they are not those that it was begun with.
  void check_inputs(const MappingRequest& request);

  // Forgets the state of an unfinished run that this one replaces. It comes after the recording is
  // opened: one that cannot be read costs no unfinished run.
  void forget_unfinished_run() const { folder_.forget_state(); }

  [[nodiscard]] const RunFolder& folder() const { return folder_; }
  [[nodiscard]] std::filesystem::path work() const { return folder_.work(); }
  // Whether it was read from a checkpoint.
  [[nodiscard]] bool resumed() const { return resumed_; }
  // kDenseFrontEnd or kSparseFrontEnd.
  [[nodiscard]] const std::string& front_end() const { return front_end_; }
  // Events that the checkpoint has behind it; 0 at the start.
  [[nodiscard]] std::uint64_t events() const { return events_; }
  [[nodiscard]] TimeNs last_checkpoint() const { return last_checkpoint_; }
  // Seconds that the run has taken so far. A resumed run also counts the parts before, each up to
  // the checkpoint from which the next one resumed.
  [[nodiscard]] double elapsed_s() const;

  // Brings a recording that was just opened to where the checkpoint's run had read it. It jumps
  // there where the recording could tell its place, else it reads up to there.
  void find_place(Recording& source) const;
  // Brings session, orderer and log to the state of the checkpoint; a warning where it is not the
  // newest (key "run.older_checkpoint").
  void restore(Resumable& session, EventOrderer& orderer, Log& log, const Rig& rig) const;
  // Writes a checkpoint: `events` have been taken from the recording.
  void save(const MappingRequest& request, Resumable& session, const EventOrderer& orderer,
            const Log& log, const Recording& source, std::uint64_t events);
  // The same where the recording is begun anew: no older checkpoint is gone back to.
  void begin_anew(const MappingRequest& request, Resumable& session, const EventOrderer& orderer,
                  const Log& log, const Recording& source);
  // The run is finished, or nothing came of it: the work folder goes with this object.
  void remove() { folder_.forget_state(); }

 private:
  RunState(RunFolder folder, std::string front_end)
      : folder_(std::move(folder)), front_end_(std::move(front_end)) {}

  void read(const Checkpoint& checkpoint, MappingRequest& request);

  RunFolder folder_;
  std::string front_end_;
  bool resumed_ = false;
  std::uint64_t next_ = 0;  // number of the next checkpoint
  std::uint64_t events_ = 0;
  TimeNs last_checkpoint_ = 0;
  std::optional<std::string> place_;  // where the recording stood, if it could tell
  std::string file_;                  // that was read
  std::vector<InputIdentity> inputs_;
  std::string passed_over_;      // what kept `reopen` from the newest checkpoint
  std::string state_;            // of session, orderer and log, as read
  std::size_t state_bytes_ = 0;  // of the last checkpoint
  double earlier_s_ = 0.0;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// A run that was killed, stopped or cut off, with what it was begun with; its configuration is read
// as text (`config_record.asked_yaml`).
struct UnfinishedRun {
  MappingRequest request;
  RunState state;
};

}  // namespace understory
