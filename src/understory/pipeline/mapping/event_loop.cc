#include "understory/pipeline/mapping/event_loop.h"

#include <fmt/format.h>

#include <utility>

#include "understory/pipeline/mapping/dense/memory_plan.h"
#include "understory/pipeline/pipeline_constants.h"
#include "understory/preprocess/point_order.h"
#include "understory/recording/finding.h"
#include "understory/util/error.h"
#include "understory/util/files/read_error.h"
#include "understory/util/time.h"
#include "understory/util/timing.h"

namespace understory {

using namespace pipeline_constants::event_loop;

namespace {

// Why the recording is begun anew, for the log.
const char* again_because(ImuFinding::Verdict found) {
  switch (found) {
    case ImuFinding::Verdict::kWrong:
      return "the recording is mapped again from its beginning, without the IMU";
    case ImuFinding::Verdict::kCleared:
      return "the IMU is right: the recording is mapped again from its beginning, with it";
    default:
      return "the recording is started again without the IMU, to find out which is wrong";
  }
}

}  // namespace

EventLoop::EventLoop(const MappingRequest& request, RunState& state, Log& log,
                     const ProgressSink& progress, const StopRequested& stop_requested,
                     EventLoopParts parts)
    : request_(request),
      asked_(request.config),
      state_(state),
      log_(log),
      progress_(progress),
      stop_requested_(stop_requested),
      parts_(std::move(parts)),
      source_(parts_.open_recording(request.recording, request.open, log)),
      opened_(source_.get()) {
  state_.check_inputs(request_);
  state_.resumed() ? go_on() : begin();
  if (request_.realtime) play_at_sensor_speed();
}

void EventLoop::begin() {
  request_.conditions.realtime = request_.realtime;
  if (depends_on_sensors(asked_)) source_ = learn_traits(std::move(source_), request_.traits);
  expect_imu();
  if (const auto* dense = std::get_if<DenseMappingConfig>(&asked_))
    expect_memory(*dense, request_.traits);
  state_.forget_unfinished_run();
  adapt_to_recording();
  save_state();  // makes the run resumable from the start
}

// Before anything is mapped: what is asked for by the samples of an IMU needs one.
void EventLoop::expect_imu() const {
  const auto* dense = std::get_if<DenseMappingConfig>(&asked_);
  if (dense == nullptr || !dense->imu_rate || request_.traits.has_imu) return;
  throw InputError(request_.recording, "",
                   request_.traits.imu_is_numb
                       ? "--imu-rate: expected an IMU, and no sample of it is a number"
                       : "--imu-rate: expected an IMU whose place on the lidar is known; the "
                         "recording has none (--extrinsics tells the place)");
}

void EventLoop::go_on() {
  adapt_to_recording();
  state_.find_place(*source_);
  ResumablePair session(*front_end_, online_.get());
  state_.restore(session, *orderer_, log_, source_->rig());
  stamps_trusted_ = orderer_->trusts_stamps(EventOrderer::kImu);
  events_ = state_.events();
}

// Orderer and front end at their beginning, with the configuration that suits the recording.
void EventLoop::adapt_to_recording() {
  Adapted<FrontEndConfig> adapted =
      adapt_front_end(asked_, request_.config_record.origins, request_.traits, request_.conditions);
  request_.config = std::move(adapted.config);
  request_.config_record.adapted = std::move(adapted.changes);
  request_.config_record.effective_yaml = yaml_of(request_.config);
  orderer_.emplace(loop_of(request_.config).time_repair, log_);
  if (stamps_trusted_) orderer_->trust_stamps(EventOrderer::kImu);
  front_end_.reset();  // lets go of its files
  front_end_ =
      parts_.front_end(request_.config, request_.traits, request_.conditions, state_.work(), log_);
  online_.reset();
  if (!georeference_of(request_.config).online) return;
  online_ = std::make_unique<OnlinePath>(state_.work());
  if (!depends_on_sensors(request_.config)) online_->set_levelled_by(LevelledBy::kStems);
}

void EventLoop::play_at_sensor_speed() {
  auto player = std::make_unique<RealtimePlayer>(
      std::move(source_), static_cast<std::size_t>(loop_of(request_.config).realtime_queue_scans),
      stop_requested_);
  player_ = player.get();
  source_ = std::move(player);
  front_end_->run_in_real_time();
}

RunFacts EventLoop::run() {
  bool ended = false;
  while (!ended && !stopped()) {
    std::optional<Event> event = next_event();
    // At the speed of the sensors there may be nothing yet, and no end of waiting for it.
    if (!event && (player_ != nullptr || !unreadable_.empty()) && stopped()) break;
    ended = !event;
    if (event) {
      ++events_;
      orderer_->push(std::move(*event));
    } else {
      orderer_->finish();
    }
    handle_ready();
    if (!ended) save_state_if_due();
    if (start_over_for_imu() || start_over_for_refined_imu()) ended = false;
  }
  if (stopped_ && front_end_->settled()) save_state();
  note_positioned(front_end_->finish(source_->rig()));
  if (player_ != nullptr) player_->stop();
  return facts();
}

bool EventLoop::stopped() {
  stopped_ = stopped_ || !unreadable_.empty() || (stop_requested_ && stop_requested_());
  return stopped_;
}

// A recording that the system cannot read any further ends the run there, with what it has.
std::optional<Event> EventLoop::next_event() {
  try {
    std::optional<Event> event = source_->next();
    const std::optional<RefinedImu>& refined = request_.conditions.imu_refined;
    if (event && refined) {
      if (auto* sample = std::get_if<ImuSample>(&*event))
        sample->stamp -= from_seconds(refined->late_s);
    }
    return event;
  } catch (const ReadError& error) {
    if (!front_end_->has_map()) throw;
    unreadable_ = error.what();
    return std::nullopt;
  }
}

void EventLoop::handle_ready() {
  while (const auto ready = orderer_->pop()) {
    const TimeNs before = front_end_->last_scan_end();
    take_fix_or_sample(*ready);
    if (const auto* scan = std::get_if<ScanPtr>(&*ready)) look_at_times(**scan);
    note_positioned(front_end_->handle(*ready, source_->rig()));
    if (front_end_->last_scan_end() == before) continue;
    const FrontEndProgress so_far = front_end_->progress();
    const double share = source_->progress();
    const auto done = static_cast<double>(so_far.scans);
    progress_({so_far.stage, done, share > 0.0 ? done / share : 0.0, "scans", remark(so_far)});
  }
}

void EventLoop::look_at_times(const Scan& scan) {
  if (!times_in_no_order(scan)) return;
  report_finding(log_, Finding::kMixedTimes,
                 fmt::format("scan at {}: the times of its points are in no order",
                             format_seconds(scan.stamp)));
}

// For the online georeference. The world of a path by stems is level by these.
void EventLoop::take_fix_or_sample(const Event& event) {
  if (!online_) return;
  const RunConditions& conditions = request_.conditions;
  if (const auto* fix = std::get_if<GnssFix>(&event)) online_->take(*fix, source_->rig());
  if (std::holds_alternative<ImuSample>(event) && depends_on_sensors(request_.config)) {
    const bool trusted = conditions.imu_refused.empty() && !conditions.imu_doubted;
    online_->set_levelled_by(trusted ? LevelledBy::kGravity : LevelledBy::kNothing);
  }
}

void EventLoop::note_positioned(const std::vector<PositionedScan>& scans) {
  for (const PositionedScan& scan : scans) {
    if (player_ != nullptr) latencies_ms_.push_back(player_->latency_ms(scan.end));
    if (online_) online_->take(scan);
    if (request_.on_positioned) request_.on_positioned(scan);
  }
}

std::string EventLoop::remark(const FrontEndProgress& so_far) const {
  const std::string on_globe = online_ ? online_->remark() : "";
  return so_far.remark + (on_globe.empty() ? "" : ", " + on_globe);
}

void EventLoop::save_state() {
  ResumablePair session(*front_end_, online_.get());
  state_.save(request_, session, *orderer_, log_, *source_, events_);
}

void EventLoop::save_state_if_due() {
  const TimeNs due =
      state_.last_checkpoint() + from_seconds(loop_of(request_.config).checkpoint_interval_s);
  if (!front_end_->settled() || front_end_->last_scan_end() < due) return;
  save_state();
  memory_mb_.push_back(resident_memory_mb());
}

// An IMU that contradicts the scans bends what is positioned with it, the map included, and by that
// the scans' word against it. So the recording is begun anew: once to find out who is right, with
// scans alone, and then without the IMU if it is wrong. If it is right, the scans were wrong, and
// what they were mapped to alone is mapped again with it. True if the recording was begun anew; a
// run at the speed of its sensors cannot, and goes on.
bool EventLoop::start_over_for_imu() {
  if (player_ != nullptr) return false;
  const ImuFinding found = front_end_->imu_finding();
  if (found.verdict == ImuFinding::Verdict::kTrusted) return false;
  const bool cleared = found.verdict == ImuFinding::Verdict::kCleared;
  if (!cleared && start_over_for_stamps()) return true;
  const bool wrong = found.verdict == ImuFinding::Verdict::kWrong;
  log_.forget_all_but(wrong ? "imu.untrusted" : "imu.probation");
  log_.info(again_because(found.verdict));
  RunConditions& conditions = request_.conditions;
  conditions.imu_judged_s = to_seconds(front_end_->last_scan_end() - front_end_->first_scan());
  conditions.imu_doubted = found.verdict == ImuFinding::Verdict::kSuspected;
  conditions.imu_cleared = cleared;
  if (wrong) conditions.imu_refused = found.reason;
  start_over();
  return true;
}

// An IMU whose clock was shifted by its arrival, and that contradicts the scans: perhaps it came
// late with stamps that are right. True if the recording was begun anew with them.
bool EventLoop::start_over_for_stamps() {
  if (orderer_->report().streams[EventOrderer::kImu].offset == 0 || stamps_trusted_) return false;
  stamps_trusted_ = true;
  log_.forget_all_but("");
  log_.info("the recording is started again with the IMU's own stamps");
  start_over();
  return true;
}

// Place and clock of the IMU were given wrongly: the recording is begun anew with what it tells
// itself. Each time brings them nearer. True if it was begun anew; a run at the speed of its
// sensors cannot.
bool EventLoop::start_over_for_refined_imu() {
  RunConditions& conditions = request_.conditions;
  if (player_ != nullptr || conditions.imu_refinements >= kMostRefinements) return false;
  if (!front_end_->settled()) return false;
  const std::optional<RefinedImu> found = front_end_->refined_imu();
  if (!found) return false;
  log_.forget_all_but("");
  log_.info(
      fmt::format("the recording is mapped again from its beginning, with the refined place and "
                  "clock of the IMU. Its stamps are {:.1f} ms late",
                  1e3 * found->late_s));
  ++conditions.imu_refinements;
  conditions.imu_refined = found;
  start_over();
  return true;
}

void EventLoop::start_over() {
  adapt_to_recording();
  source_ = parts_.open_recording(request_.recording, request_.open, log_);
  opened_ = source_.get();
  events_ = 0;
  ResumablePair session(*front_end_, online_.get());
  state_.begin_anew(request_, session, *orderer_, log_, *source_);
}

RunFacts EventLoop::facts() {
  RunFacts facts;
  facts.stopped = stopped_;
  facts.unreadable = unreadable_;
  facts.goes_on_by = resume_command(state_.folder().path());
  facts.elapsed_s = [this] { return state_.elapsed_s(); };
  facts.format = source_->format();
  facts.time_repair = orderer_->report();
  facts.realtime = player_ != nullptr;
  facts.latencies_ms = latencies_ms_;
  facts.memory_mb = memory_mb_;
  facts.online = online_.get();
  if (player_ == nullptr) return facts;
  facts.dropped_scans = player_->dropped_scans();
  if (facts.dropped_scans > 0) {
    log_.warn("realtime.dropped",
              fmt::format("{} of {} scans were dropped, because the machine could not keep up",
                          facts.dropped_scans, facts.dropped_scans + front_end_->progress().scans));
  }
  return facts;
}

}  // namespace understory
