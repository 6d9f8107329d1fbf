#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "understory/pipeline/georeferencing/online_path.h"
#include "understory/pipeline/mapping/front_end.h"
#include "understory/pipeline/mapping/mapping_request.h"
#include "understory/pipeline/mapping/realtime_player.h"
#include "understory/pipeline/mapping/run_facts.h"
#include "understory/pipeline/mapping/run_state.h"
#include "understory/pipeline/source.h"
#include "understory/preprocess/streams/event_orderer.h"
#include "understory/recording/recording.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// How an event loop opens its recording and makes its front end. Tests give their own.
struct EventLoopParts {
  std::function<std::unique_ptr<Recording>(const std::string& name, const OpenOptions& options,
                                           Log& log)>
      open_recording = open_source;
  std::function<std::unique_ptr<FrontEnd>(const FrontEndConfig& config, const SensorTraits& traits,
                                          const RunConditions& conditions,
                                          const std::filesystem::path& work, Log& log)>
      front_end = make_front_end;
};

// Reads a recording and hands its events to a front end in order of time: recording -> event
// orderer -> front end. Saves the state now and then, and begins the recording anew where the front
// end finds its IMU to be wrong. What is passed in must outlive it. Not thread-safe.
class EventLoop {
 public:
  // Opens the recording; that of a resumed run at its place, with the front end in its state.
  // Throws InputError where it cannot be read or is not the one that the run was begun with.
  EventLoop(const MappingRequest& request, RunState& state, Log& log, const ProgressSink& progress,
            const StopRequested& stop_requested, EventLoopParts parts = {});

  // Positions every scan, until the recording ends, cannot be read any further or the user stops.
  [[nodiscard]] RunFacts run();

  [[nodiscard]] FrontEnd& front_end() { return *front_end_; }
  // With the configuration that runs, and what was found out.
  [[nodiscard]] const MappingRequest& request() const { return request_; }
  // The recording as it was opened, also where it is played at sensor speed or its first events
  // were read before. After `run`.
  [[nodiscard]] const Recording& recording() const { return *opened_; }

 private:
  void begin();
  void expect_imu() const;
  void go_on();
  void adapt_to_recording();
  void play_at_sensor_speed();
  [[nodiscard]] std::optional<Event> next_event();
  [[nodiscard]] bool stopped();
  void handle_ready();
  void take_fix_or_sample(const Event& event);
  void look_at_times(const Scan& scan);
  void note_positioned(const std::vector<PositionedScan>& scans);
  void save_state();
  void save_state_if_due();
  [[nodiscard]] bool start_over_for_imu();
  [[nodiscard]] bool start_over_for_stamps();
  [[nodiscard]] bool start_over_for_refined_imu();
  void start_over();
  [[nodiscard]] RunFacts facts();
  [[nodiscard]] std::string remark(const FrontEndProgress& so_far) const;

  MappingRequest request_;
  const FrontEndConfig asked_;
  RunState& state_;
  Log& log_;
  const ProgressSink& progress_;
  const StopRequested& stop_requested_;
  const EventLoopParts parts_;
  std::unique_ptr<Recording> source_;
  const Recording* opened_;           // source_, or the recording that it wraps
  RealtimePlayer* player_ = nullptr;  // source_, if it is one
  std::optional<EventOrderer> orderer_;
  std::unique_ptr<FrontEnd> front_end_;
  std::unique_ptr<OnlinePath> online_;  // null where it is switched off
  std::uint64_t events_ = 0;            // taken from the recording
  bool stopped_ = false;
  bool stamps_trusted_ = false;  // of the IMU, against the order of arrival
  std::string unreadable_;       // where the recording could not be read any further, and why
  std::vector<double> memory_mb_;
  std::vector<double> latencies_ms_;
};

}  // namespace understory
