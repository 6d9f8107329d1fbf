#include "understory/pipeline/mapping/mapping.h"

#include <fmt/format.h>

#include "understory/pipeline/judgement/input_remarks.h"
#include "understory/pipeline/mapping/mapping_session.h"
#include "understory/pipeline/mapping/realtime_player.h"
#include "understory/pipeline/mapping/run_state.h"
#include "understory/pipeline/run_folder/run_writer.h"
#include "understory/pipeline/source.h"
#include "understory/util/error.h"
#include "understory/util/read_error.h"

namespace understory {
namespace {

// The pieces of one run, and the loop that drives them.
class MappingRun {
 public:
  MappingRun(const MappingRequest& request, RunState state, Log& log, const ProgressSink& progress,
             const StopRequested& stop_requested)
      : request_(request),
        asked_(request.config),
        log_(log),
        progress_(progress),
        stop_requested_(stop_requested),
        state_(std::move(state)) {
    begin();
  }

  // Events in the order of the recording -> events in order of time -> poses, keyframes, map.
  MappingOutcome run() {
    bool stopped = false;
    bool ended = false;
    while (!ended && !(stopped = stop_requested_ && stop_requested_())) {
      std::optional<Event> event = next_event();
      if ((stopped = !unreadable_.empty())) break;
      // At the speed of the sensors there may be nothing yet, and no end of waiting for it.
      if (!event && player_ != nullptr && stop_requested_ && stop_requested_()) {
        stopped = true;
        break;
      }
      ended = !event;
      if (event) {
        ++events_;
        orderer_->push(std::move(*event));
      } else {
        orderer_->finish();
      }
      handle_ready();
      if (!ended) checkpoint_if_due();
      if (player_ == nullptr && start_over_for_imu()) ended = false;
    }
    if (stopped && session_->settled())
      state_.save(request_, *session_, *orderer_, log_, *source_, events_);
    return finish(stopped);
  }

 private:
  // A recording that the system cannot read any further ends the run there, with what it has.
  std::optional<Event> next_event() {
    try {
      return source_->next();
    } catch (const ReadError& error) {
      if (!session_->settled() || !session_->started()) throw;
      unreadable_ = error.what();
      return std::nullopt;
    }
  }

  void begin() {
    source_ = open_source(request_.recording, request_.open, log_);
    state_.check_inputs(request_);
    if (state_.resumed()) {
      adapt_config();
      state_.find_place(*source_);
      state_.restore(*session_, *orderer_, log_, source_->rig());
      stamps_believed_ = orderer_->believes_stamps(EventOrderer::kImu);
      events_ = state_.events();
    } else {
      request_.conditions.realtime = request_.realtime;
      source_ = learn_traits(std::move(source_), request_.traits);
      state_.forget_former();
      adapt_config();
      // Makes the run resumable from the start.
      state_.save(request_, *session_, *orderer_, log_, *source_, 0);
    }
    if (request_.realtime) {
      auto player = std::make_unique<RealtimePlayer>(
          std::move(source_), static_cast<std::size_t>(request_.config.realtime_queue_scans),
          stop_requested_);
      player_ = player.get();
      session_->take_loops_when_found();
      source_ = std::move(player);
    }
  }

  // Orderer and session at their beginning, with the configuration that suits the sensors.
  void adapt_config() {
    Adapted<MappingConfig> adapted =
        adapt(asked_, request_.config_origins, request_.traits, request_.conditions);
    request_.config = std::move(adapted.config);
    request_.adapted = std::move(adapted.changes);
    request_.effective_yaml = mapping_table(request_.config).to_yaml(false);
    orderer_.emplace(request_.config.time_repair, log_);
    if (stamps_believed_) orderer_->believe_stamps(EventOrderer::kImu);
    session_.reset();  // lets go of its files
    session_.emplace(request_.config, state_.work(), log_);
  }

  // An IMU that contradicts the lidar bends what is positioned with it, the map included, and by
  // that the lidar's word against it. So the recording is begun anew: once to find out who is
  // right, with scans alone, and if the IMU is wrong, without it. True if it was.
  bool start_over_for_imu() {
    const bool wrong = session_->imu_is_wrong();
    if (!wrong && !session_->imu_is_suspected()) return false;
    if (start_over_for_stamps()) return true;
    const std::string reason = session_->odometry().motion().imu_trust().reason;
    log_.forget_all_but(wrong ? "imu.untrusted" : "imu.probation");
    log_.info(wrong ? "the recording is mapped again from its beginning, without the IMU"
                    : "the recording is begun anew to find out");
    RunConditions& conditions = request_.conditions;
    conditions.imu_judged_s = to_seconds(session_->last_scan_end() - request_.traits.first_scan);
    conditions.imu_doubted = !wrong;
    if (wrong) conditions.imu_refused = reason;
    begin_anew();
    wrong ? session_->refuse_imu(reason) : session_->doubt_imu();
    state_.begin_anew(request_, *session_, *orderer_, log_, *source_);
    return true;
  }

  // An IMU whose clock was shifted by its arrival, and that contradicts the lidar: perhaps it came
  // late with stamps that are right. True if the recording was begun anew with them.
  bool start_over_for_stamps() {
    if (orderer_->report().streams[EventOrderer::kImu].offset == 0 || stamps_believed_)
      return false;
    stamps_believed_ = true;
    log_.forget_all_but("");
    log_.info("the recording is begun anew with the IMU's own stamps");
    begin_anew();
    state_.begin_anew(request_, *session_, *orderer_, log_, *source_);
    return true;
  }

  void begin_anew() {
    adapt_config();
    source_ = open_source(request_.recording, request_.open, log_);
    events_ = 0;
  }

  void handle_ready() {
    while (auto ready = orderer_->pop())
      handle(*ready);
  }

  void handle(const Event& event) {
    const TimeNs before = session_->last_scan_end();
    session_->handle(event, source_->rig());
    if (session_->last_scan_end() == before) return;
    if (player_ != nullptr) latencies_ms_.push_back(player_->latency_ms(session_->last_scan_end()));
    report_progress();
  }

  void checkpoint_if_due() {
    const TimeNs due =
        state_.last_checkpoint() + from_seconds(request_.config.checkpoint_interval_s);
    if (session_->settled() && session_->last_scan_end() >= due) {
      state_.save(request_, *session_, *orderer_, log_, *source_, events_);
      memory_mb_.push_back(resident_memory_mb());
    }
  }

  void report_progress() const {
    if (!progress_) return;
    const double share = source_->progress();
    const auto done = static_cast<double>(session_->counts().scans);
    progress_({"mapping", done, share > 0.0 ? done / share : 0.0, "scans",
               fmt::format("{} keyframes", session_->map().keyframes().size())});
  }

  MappingOutcome finish(bool stopped) {
    if (session_->map().keyframes().empty()) return nothing_to_map(stopped);
    session_->map().finish(request_.config.odometry.ndt);
    RunFacts facts;
    facts.stopped = stopped;
    facts.elapsed_s = [this] { return state_.elapsed_s(); };
    facts.unreadable = unreadable_;
    facts.format = source_->format();
    facts.time_repair = orderer_->report();
    facts.latencies_ms = latencies_ms_;
    facts.memory_mb = memory_mb_;
    facts.realtime = player_ != nullptr;
    facts.dropped_scans = player_ != nullptr ? player_->dropped_scans() : 0;
    if (player_ != nullptr) player_->stop();
    const Recording& source = player_ != nullptr ? player_->played() : *source_;
    if (facts.dropped_scans > 0) {
      log_.warn("realtime.dropped",
                fmt::format("{} of {} scans were dropped, because the machine could not keep up",
                            facts.dropped_scans, facts.dropped_scans + session_->counts().scans));
    }
    if (request_.traits.scan_points == 0) {
      log_.warn("lidar.unknown",
                request_.recording +
                    ": its first messages hold no scan that tells what lidar this is: nothing was "
                    "adapted to it");
    }
    if (!stopped) remark_on_input(*session_, source, facts.time_repair, request_.recording, log_);
    MappingOutcome outcome =
        write_run(request_, state_.folder(), *session_, facts, source, log_, progress_);
    // What a stopped run has so far is no successor of a former run.
    state_.folder().commit(log_, stopped && !state_.resumed());
    if (!stopped) state_.remove();
    return outcome;
  }

  MappingOutcome nothing_to_map(bool stopped) {
    state_.remove();
    if (!stopped) throw InputError(request_.recording, "", nothing_to_map_reason());
    const std::string reason = "stopped by the user before the first scan; nothing was written";
    return {RunStatus::kPartial, {reason}, "", reason};
  }

  [[nodiscard]] std::string nothing_to_map_reason() const {
    std::string topics;
    std::uint64_t empty = 0;
    for (const TopicReport& topic : source_->topics()) {
      topics += (topics.empty() ? "" : ", ") + topic.name + " (" + topic.type + ")";
      empty += topic.empty_points;
    }
    if (session_->counts().scans > 0) {
      return fmt::format(
          "none of its {} scans has points to map: {} points are not a number or at zero range, "
          "the others too near, too far or on the machine",
          session_->counts().scans, empty);
    }
    return "no lidar scan could be read from it" +
           (topics.empty() ? std::string() : "; it holds " + topics);
  }

  MappingRequest request_;  // with the configuration adapted
  const MappingConfig asked_;
  Log& log_;
  const ProgressSink& progress_;
  const StopRequested& stop_requested_;
  RunState state_;
  std::optional<EventOrderer> orderer_;
  std::optional<MappingSession> session_;
  std::unique_ptr<Recording> source_;
  RealtimePlayer* player_ = nullptr;  // source_, if it is one
  std::uint64_t events_ = 0;
  bool stamps_believed_ = false;  // of the IMU, against the order of arrival
  std::string unreadable_;        // where the recording could not be read any further, and why
  std::vector<double> memory_mb_;
  std::vector<double> latencies_ms_;
};

}  // namespace

MappingOutcome run_mapping(const MappingRequest& request, Log& log, const ProgressSink& progress,
                           const StopRequested& stop_requested) {
  MappingRequest begun = request;
  begun.more_inputs = {request.config.odometry.machine_boxes_file};
  return MappingRun(begun, RunState::create(begun, kDenseFrontEnd), log, progress, stop_requested)
      .run();
}

MappingOutcome resume_mapping(UnfinishedRun run, Log& log, const ProgressSink& progress,
                              const StopRequested& stop_requested) {
  MappingRequest request;
  static_cast<RunRequest&>(request) = std::move(run.request);
  mapping_table(request.config).read_yaml(request.config_yaml, request.run_folder.string());
  std::string& boxes = request.config.odometry.machine_boxes_file;
  boxes = request.found(boxes);
  request.more_inputs = {boxes};
  return MappingRun(request, std::move(run.state), log, progress, stop_requested).run();
}

}  // namespace understory
