#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "understory/pipeline/mapping/front_end_config.h"
#include "understory/pipeline/mapping/map_maker.h"
#include "understory/pipeline/mapping/mapping_request.h"
#include "understory/pipeline/mapping/positioned_scan.h"
#include "understory/pipeline/mapping/run_facts.h"
#include "understory/pipeline/run_folder/resumable.h"
#include "understory/recording/recording.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// What the scans say of the IMU.
struct ImuFinding {
  enum class Verdict {
    kTrusted,    // or there is none
    kSuspected,  // contradicted before it ever agreed: who is right is found out without it
    kCleared,    // it was suspected, and it is right
    kWrong,
  };
  Verdict verdict = Verdict::kTrusted;
  std::string reason;
};

// How far a front end has come.
struct FrontEndProgress {
  std::string stage;  // "mapping"
  std::size_t scans = 0;
  std::string remark;  // "12 keyframes"
};

// A recording that was read to its end, or as far as the user or the disk let it. All is the event
// loop's and lives as long.
struct ReadRecording {
  const MappingRequest& request;  // with the configuration that ran
  const RunFacts& facts;
  const Recording& source;
  std::filesystem::path work;     // folder for what does not fit into memory
  std::filesystem::path results;  // folder that the files of the run are written to
  Log& log;
  const ProgressSink& progress;
};

// The moving part of a mapping run: takes events in order of time and positions the scans. There
// are two: the dense one matches all points to a local map, the sparse one stems to stems. Its
// whole state can be saved while it is settled. Not thread-safe.
class FrontEnd : public Resumable {
 public:
  // Takes one event. `rig`: what is known of the sensors by now. Returns the scans that have got
  // their poses by it, in order.
  virtual std::vector<PositionedScan> handle(const Event& event, const Rig& rig) = 0;
  // No event comes any more: positions what still waits. Returns as `handle`.
  virtual std::vector<PositionedScan> finish(const Rig& rig) = 0;
  // --realtime, before the first event: what is found beside the scan loop counts at once.
  virtual void run_in_real_time() = 0;

  // Whether the state can be saved now: no scan waits for its pose or may be positioned again.
  [[nodiscard]] virtual bool settled() const = 0;
  // Stamp of the first scan.
  [[nodiscard]] virtual TimeNs first_scan() const = 0;
  // What was positioned with an IMU that is not trusted is better done again without it.
  [[nodiscard]] virtual ImuFinding imu_finding() const = 0;
  // Place and clock of the IMU that the scans so far tell. Nothing where they are those in use, or
  // are not to be corrected.
  [[nodiscard]] virtual std::optional<RefinedImu> refined_imu() const { return std::nullopt; }
  [[nodiscard]] virtual FrontEndProgress progress() const = 0;

  // Whether there is anything to make a map of, and why not.
  [[nodiscard]] virtual bool has_map() const = 0;
  [[nodiscard]] virtual std::string why_no_map(const Recording& source) const = 0;
  // Once, after `finish`: what is made of it; `this` must outlive it. Warns of what only the whole
  // recording can show.
  [[nodiscard]] virtual std::unique_ptr<MapMaker> map_maker(const ReadRecording& recording) = 0;
};

// The front end that `config` is of, at the beginning of a recording. Its files are in the folder
// `work`. `log` must outlive it.
[[nodiscard]] std::unique_ptr<FrontEnd> make_front_end(const FrontEndConfig& config,
                                                       const SensorTraits& traits,
                                                       const RunConditions& conditions,
                                                       const std::filesystem::path& work, Log& log);

}  // namespace understory
