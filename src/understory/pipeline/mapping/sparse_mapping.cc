#include "understory/pipeline/mapping/sparse_mapping.h"

#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "understory/pipeline/judgement/input_remarks.h"
#include "understory/pipeline/judgement/run_judgement.h"
#include "understory/pipeline/mapping/realtime_player.h"
#include "understory/pipeline/mapping/run_state.h"
#include "understory/pipeline/mapping/sparse_session.h"
#include "understory/pipeline/source.h"
#include "understory/util/error.h"
#include "understory/util/read_error.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

// The scans of a recording in order of time, one after another through the front end.
class SparseRun {
 public:
  SparseRun(const SparseMappingRequest& request, RunState state, Log& log,
            const StopRequested& stop_requested)
      : request_(request), asked_(request.config), log_(log), state_(std::move(state)) {
    if (!state_.resumed()) request_.conditions.realtime = request_.realtime;
    open();
    if (state_.resumed()) {
      state_.find_place(*source_);
      state_.restore(*session_, *orderer_, log_, source_->rig());
      stamps_believed_ = orderer_->believes_stamps(EventOrderer::kImu);
      events_ = state_.events();
    } else {
      // Makes the run resumable from the start.
      state_.save(request_, *session_, *orderer_, log_, *source_, 0);
    }
    if (request_.realtime) play_at_sensor_speed(stop_requested);
  }

  // True if it was stopped.
  bool run(const ProgressSink& progress, const StopRequested& stop_requested) {
    bool stopped = false;
    bool ended = false;
    while (!ended && !(stopped = stop_requested && stop_requested())) {
      std::optional<Event> event = next_event();
      if ((stopped = !unreadable_.empty())) break;
      // At the speed of the sensors there may be nothing yet, and no end of waiting for it.
      if (!event && player_ != nullptr && stop_requested && stop_requested()) {
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
      while (auto ready = orderer_->pop())
        handle(*ready, ended, progress);
      if (start_over_for_imu()) ended = false;
    }
    session_->finish(source_->rig());
    remark_on_lever_arms(source_->rig(), request_.recording, log_);
    if (player_ != nullptr) {
      player_->stop();
      warn_of_dropped();
    }
    return stopped;
  }

  [[nodiscard]] std::size_t count() { return session_->path().size(); }
  [[nodiscard]] std::size_t kept() { return session_->steps().size(); }
  [[nodiscard]] const fs::path& results() const { return results_; }
  // Puts the results in place. What a stopped run has so far is no successor of a former run.
  void commit(bool stopped) { state_.folder().commit(log_, stopped && !state_.resumed()); }
  void forget_state() { state_.remove(); }
  [[nodiscard]] const SparseMappingRequest& request() const { return request_; }
  // Leaves nothing of a run without a result.
  void give_up() {
    session_.reset();  // and with it the part of the stems that was written
    state_.remove();
  }
  // Why no view was kept.
  [[nodiscard]] std::string why_nothing() {
    if (count() > 0)
      return fmt::format(
          "no stems in any of its {} scans: expected upright stems in scans with ring numbers",
          count());
    std::string topics;
    for (const TopicReport& topic : source_->topics())
      topics += (topics.empty() ? "; it holds " : ", ") + topic.name + " (" + topic.type + ")";
    return "no lidar scan could be read from it" + topics;
  }
  // What the correction needs to know of the recording; lives as long as this.
  [[nodiscard]] SparseScans scans(bool stopped) {
    SparseScans scans;
    scans.recording = request_.recording;
    scans.source = player_ != nullptr ? &player_->played() : source_.get();
    scans.path = std::move(session_->path());
    scans.steps = std::move(session_->steps());
    scans.times = &session_->times();
    scans.positioned = session_->positioned();
    scans.wall_s = state_.elapsed_s();
    scans.stopped = stopped;
    scans.time_repair = orderer_->report();
    scans.last_scan_end = session_->last_scan_end();
    scans.repeated = session_->repeated();
    scans.imu_hearing = session_->imu_hearing();
    scans.imu_trust = session_->imu_trust();
    scans.imu_wanted = request_.config.front_end.imu.use;
    scans.unreadable = unreadable_;
    const std::string& refused = session_->imu_refused();
    scans.imu_distrust = refused.empty() ? scans.imu_trust.reason : imu_refusal(refused);
    scans.fixes = std::move(session_->fixes());
    if (player_ != nullptr)
      scans.realtime = {player_->dropped_scans(), distribution_of(std::move(latencies_ms_))};
    return scans;
  }

 private:
  // A recording that the system cannot read any further ends the run there, with what it has.
  std::optional<Event> next_event() {
    try {
      return source_->next();
    } catch (const ReadError& error) {
      if (session_->steps().empty()) throw;
      unreadable_ = error.what();
      return std::nullopt;
    }
  }

  // Session, orderer and recording at their beginning.
  void open() {
    session_.reset();  // lets go of its files
    const bool first = source_ == nullptr;
    source_ = open_source(request_.recording, request_.open, log_);
    if (first) {
      state_.check_inputs(request_);
      if (!state_.resumed()) state_.forget_former();
    }
    results_ = state_.folder().begin_results();
    adapt_config();
    session_.emplace(request_.config, results_ / "stems.csv.gz", state_.work(), log_);
    orderer_.emplace(request_.config.time_repair, log_);
    if (stamps_believed_) orderer_->believe_stamps(EventOrderer::kImu);
    events_ = 0;
  }

  // An IMU that contradicts the stems bends what is positioned with it until that is found out. So
  // the recording is begun anew without it. True if it was; a run at the speed of its sensors
  // cannot, and goes on.
  bool start_over_for_imu() {
    const ImuTrust trust = session_->imu_trust();
    if (player_ != nullptr || trust.trusted || !session_->imu_refused().empty()) return false;
    if (start_over_for_stamps()) return true;
    log_.forget_all_but("imu.untrusted");
    log_.info("the recording is mapped again from its beginning, without the IMU");
    request_.conditions.imu_refused = trust.reason;
    request_.conditions.imu_judged_s =
        to_seconds(session_->last_scan_end() - session_->path().front().stamp);
    open();
    session_->refuse_imu(trust.reason);
    state_.begin_anew(request_, *session_, *orderer_, log_, *source_);
    return true;
  }

  void adapt_config() {
    Adapted<SparseMappingConfig> adapted =
        adapt(asked_, request_.config_origins, request_.conditions);
    request_.config = std::move(adapted.config);
    request_.adapted = std::move(adapted.changes);
    request_.effective_yaml = sparse_mapping_table(request_.config).to_yaml(false);
  }

  // An IMU whose clock was shifted by its arrival, and that contradicts the stems: perhaps it came
  // late with stamps that are right. True if the recording was begun anew with them.
  bool start_over_for_stamps() {
    if (orderer_->report().streams[EventOrderer::kImu].offset == 0 || stamps_believed_)
      return false;
    stamps_believed_ = true;
    log_.forget_all_but("");
    log_.info("the recording is mapped again from its beginning, with the IMU's own stamps");
    open();
    state_.begin_anew(request_, *session_, *orderer_, log_, *source_);
    return true;
  }

  void play_at_sensor_speed(const StopRequested& stop_requested) {
    auto player = std::make_unique<RealtimePlayer>(
        std::move(source_), static_cast<std::size_t>(request_.config.realtime_queue_scans),
        stop_requested);
    player_ = player.get();
    source_ = std::move(player);
    session_->on_settled(
        [this](TimeNs scan_end) { latencies_ms_.push_back(player_->latency_ms(scan_end)); });
  }

  void handle(const Event& event, bool ended, const ProgressSink& progress) {
    session_->handle(event, source_->rig());
    if (!std::holds_alternative<ScanPtr>(event)) return;
    // Between gaps only, and not once the orderer has been told that nothing comes any more.
    const TimeNs due =
        state_.last_checkpoint() + from_seconds(request_.config.checkpoint_interval_s);
    if (!ended && session_->settled() && session_->last_scan_end() >= due)
      state_.save(request_, *session_, *orderer_, log_, *source_, events_);
    if (!progress) return;
    const double share = source_->progress();
    const auto done = static_cast<double>(session_->scans());
    progress({"stems", done, share > 0.0 ? done / share : 0.0, "scans",
              fmt::format("{} stems", session_->last_stems())});
  }

  void warn_of_dropped() {
    const std::uint64_t dropped = player_->dropped_scans();
    if (dropped == 0) return;
    log_.warn("realtime.dropped",
              fmt::format("{} of {} scans were dropped, because the machine could not keep up",
                          dropped, dropped + session_->scans()));
  }

  SparseMappingRequest request_;  // with the configuration adapted
  const SparseMappingConfig asked_;
  Log& log_;
  RunState state_;
  fs::path results_;  // where they are written until `commit`
  std::optional<EventOrderer> orderer_;
  std::unique_ptr<Recording> source_;
  std::optional<SparseSession> session_;
  RealtimePlayer* player_ = nullptr;  // source_, if it is one
  std::uint64_t events_ = 0;
  bool stamps_believed_ = false;  // of an IMU, against the order of arrival
  std::string unreadable_;        // where the recording could not be read any further, and why
  std::vector<double> latencies_ms_;
};

CorrectionOutcome run_from(const SparseMappingRequest& request, RunState state, Log& log,
                           const ProgressSink& progress, const StopRequested& stop_requested) {
  SparseRun run(request, std::move(state), log, stop_requested);
  const bool stopped = run.run(progress, stop_requested);
  if (run.kept() == 0) {
    const std::string reason = run.why_nothing();
    run.give_up();
    throw InputError(request.recording, "", reason);
  }
  const SparseScans scans = run.scans(stopped);
  CorrectionRequest correction;
  correction.stems = run.results() / "stems.csv.gz";
  correction.run_folder = request.run_folder;
  correction.results = run.results();
  correction.config = request.config.correction;
  correction.config_yaml = request.config_yaml;
  correction.config_origins = request.config_origins;
  correction.effective_yaml = run.request().effective_yaml;
  correction.adapted = run.request().adapted;
  correction.scans = &scans;
  // What was seen until the user stopped it is still corrected.
  CorrectionOutcome outcome =
      run_correction(correction, log, progress, stopped ? StopRequested() : stop_requested);
  // A correction that was broken off is done again by `--resume`, too.
  const bool broken_off = scans.stopped || (stop_requested && stop_requested());
  run.commit(broken_off);
  if (!broken_off) run.forget_state();
  return outcome;
}

std::vector<std::string> inputs_of(const SparseMappingConfig& config) {
  return {config.machine_boxes_file, config.correction.harvester.head_log};
}

}  // namespace

CorrectionOutcome run_sparse_mapping(const SparseMappingRequest& request, Log& log,
                                     const ProgressSink& progress,
                                     const StopRequested& stop_requested) {
  // A log that cannot be read is refused now, not after the hours that come before its use.
  (void)read_head_log(request.config.correction.harvester.head_log);
  SparseMappingRequest begun = request;
  begun.more_inputs = inputs_of(request.config);
  return run_from(begun, RunState::create(begun, kSparseFrontEnd), log, progress, stop_requested);
}

CorrectionOutcome resume_sparse_mapping(UnfinishedRun run, Log& log, const ProgressSink& progress,
                                        const StopRequested& stop_requested) {
  SparseMappingRequest request;
  static_cast<RunRequest&>(request) = std::move(run.request);
  reread(request.config, request.config_yaml, request.run_folder.string(),
         [&](const std::string& file) { return request.found(file); });
  request.more_inputs = inputs_of(request.config);
  return run_from(request, std::move(run.state), log, progress, stop_requested);
}

}  // namespace understory
