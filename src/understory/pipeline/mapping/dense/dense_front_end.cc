#include "understory/pipeline/mapping/dense/dense_front_end.h"

#include <fmt/format.h>

#include <algorithm>

#include "understory/pipeline/mapping/dense/memory_plan.h"
#include "understory/sensor/scan_content.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr const char* kFixesFile = "fixes.bin";
constexpr std::size_t kMostWaitingImu = 20'000;
constexpr std::size_t kRecentImu = 400;  // enough for the attitude of a new segment

}  // namespace

DenseFrontEnd::DenseFrontEnd(const DenseMappingConfig& config, const SensorTraits& traits,
                             const RunConditions& conditions, std::filesystem::path folder,
                             Log& log)
    : config_(config),
      traits_(traits),
      conditions_(conditions),
      folder_(std::move(folder)),
      log_(log),
      map_(std::make_unique<KeyframeMap>(config.keyframe_map, folder_, times_, log)),
      map_points_(config),
      clouds_(config, folder_, times_),
      between_(config, folder_),
      fix_file_(folder_ / kFixesFile),
      recovery_(config.lost_after_scans),
      opening_(std::make_unique<Opening>()) {
  if (config.max_memory_mb > 0.0) return_freed_memory_sooner();
  received_.clock = LidarImuClockCheck(config.odometry.motion.imu);
  if (config.refine_imu) received_.calibration.emplace();
  const LoopClosureConfig& loops = config.keyframe_map.loop_closure.verification;
  for (const std::string& method : {loops.matcher.method, loops.refine}) {
    if (method == LoopClosureConfig::kNoRefinement) continue;
    if (make_matcher(loops.matcher, method)->feature_finder() == nullptr) continue;
    throw ConfigError({"loop_closure.verification: expected a method that takes points; \"" +
                       method + "\" takes whole scans with rings"});
  }
  if (!conditions.imu_refused.empty()) refuse_imu(conditions.imu_refused);
}

void DenseFrontEnd::refuse_imu(const std::string& reason) {
  UNDERSTORY_CHECK(!started());
  conditions_.imu_refused = reason;
  config_.odometry.imu_enabled = false;
}

ImuFinding DenseFrontEnd::imu_finding() const {
  if (!started() || !odometry_->uses_imu()) return {};
  const ImuTrust trust = odometry_->motion().imu_trust();
  if (!trust.usable) return {ImuFinding::Verdict::kWrong, trust.reason};
  // A run that has doubted it from the start finds out who is right.
  if (!conditions_.imu_doubted && trust.on_probation)
    return {ImuFinding::Verdict::kSuspected, trust.reason};
  if (conditions_.imu_doubted && trust.proven && trust.trusted)
    return {ImuFinding::Verdict::kCleared, ""};
  return {};
}

FrontEndProgress DenseFrontEnd::progress() const {
  return {"mapping", received_.counts.scans, fmt::format("{} keyframes", map_->keyframes().size())};
}

std::optional<TimeNs> DenseFrontEnd::last_imu() const {
  if (received_.imu.empty()) return std::nullopt;
  return received_.imu.back().stamp;
}

std::vector<PositionedScan> DenseFrontEnd::handle(const Event& event, const Rig& rig) {
  const TimeNs before = last_scan_end_;
  take(event, rig);
  if (last_scan_end_ == before) return {};
  return {positioned_};
}

void DenseFrontEnd::take(const Event& event, const Rig& rig) {
  if (opening_ && started()) opening_->events.push_back(event);
  if (started() && settled()) complete_rig(rig);
  if (const auto* sample = std::get_if<ImuSample>(&event)) {
    take_sample(*sample);
  } else if (const auto* fix = std::get_if<GnssFix>(&event)) {
    take_fix(*fix);
  } else if (const auto* scan = std::get_if<ScanPtr>(&event)) {
    if (!started()) {
      opening_->events.push_back(event);
      opening_->before = received_;
      rig_ = rig;
      if (without_samples()) rig_.body_from_imu.reset();
      refine_rig();
      start_anew();
    }
    if (between_.parts() != nullptr) match_parts(**scan);
    on_scan(**scan);
  }
}

void DenseFrontEnd::take_sample(const ImuSample& sample) {
  ++received_.counts.imu_samples;
  if (started())
    received_.imu_usage.add(sample, rig_.body_from_imu.has_value(), config_.odometry.motion.imu);
  received_.clock.add_sample(sample);
  if (received_.calibration) received_.calibration->add_sample(sample);
  received_.imu.push_back(sample);
  const std::size_t most = started() && settled() ? kRecentImu : kMostWaitingImu;
  while (received_.imu.size() > most)
    received_.imu.pop_front();
  if (!started()) return;
  odometry_->add_imu(sample);
  if (between_.imu() != nullptr) predict_at(sample.stamp);
}

// An IMU that sends no numbers is as none until it does.
bool DenseFrontEnd::without_samples() const {
  return traits_.imu_is_numb && received_.counts.imu_samples == 0;
}

// A sensor that begins late, or whose place is told late, is used from then on.
void DenseFrontEnd::complete_rig(const Rig& rig) {
  if (!rig_.body_from_gnss && rig.body_from_gnss) {
    rig_.body_from_gnss = rig.body_from_gnss;
    rig_.gnss_extrinsic_source = rig.gnss_extrinsic_source;
  }
  if (!rig_.body_from_second_gnss && rig.body_from_second_gnss) {
    rig_.body_from_second_gnss = rig.body_from_second_gnss;
    rig_.second_gnss_extrinsic_source = rig.second_gnss_extrinsic_source;
  }
  if (rig_.body_from_imu || !rig.body_from_imu || without_samples()) return;
  rig_.body_from_imu = rig.body_from_imu;
  rig_.imu_extrinsic_source = rig.imu_extrinsic_source;
  refine_rig();
  const std::vector<ImuSample> recent(received_.imu.begin(), received_.imu.end());
  odometry_->take_imu(*rig_.body_from_imu, recent);
  if (odometry_->uses_imu()) tell_of_imu(recovery_.last_scan());
}

// What runs before this one found of the IMU, to an odometry that is to use it.
void DenseFrontEnd::tell_of_imu(TimeNs now) {
  if (conditions_.imu_doubted) odometry_->suspect_imu(now);
  if (conditions_.imu_cleared)
    odometry_->vouch_for_imu(first_scan() + from_seconds(conditions_.imu_judged_s));
}

void DenseFrontEnd::make_odometry(const Rig& rig) {
  rig_ = rig;
  DenseOdometryConfig config = config_.odometry;
  const FitnessNoise usual = fitness_noise(config_.keyframe_map.local_map.matcher);
  LidarNoiseConfig& noise = config.motion.lidar;
  if (noise.fitness_threshold_m2 <= 0.0) noise.fitness_threshold_m2 = usual.threshold_m2;
  if (noise.fitness_scale <= 0.0) noise.fitness_scale = usual.scale;
  odometry_ = std::make_unique<DenseOdometry>(
      config, rig_, make_matcher(config_.keyframe_map.local_map.matcher)->feature_finder(), times_,
      log_);
}

// An empty map, and an odometry that knows the IMU before the first scan and the motion assumed.
void DenseFrontEnd::start_anew() {
  journal_ = std::make_unique<Journal>(folder_ / kJournalFile);
  between_.begin();
  clouds_.begin();
  map_->start();
  make_odometry(rig_);
  make_satellites();
  if (opening_->rounds > 0) {
    odometry_->set_initial_motion(opening_->motion.velocity_m_s,
                                  opening_->motion.angular_rate_rad_s);
  }
  // What came after the first scan comes again.
  received_ = opening_->before;
  recovery_.forget_matches();
  for (const ImuSample& waiting : received_.imu)
    odometry_->add_imu(waiting);
  const Scan& first = *std::get<ScanPtr>(opening_->events.front());
  if (odometry_->uses_imu()) tell_of_imu(first.stamp);
}

// Whether the first scan was a smear or a part: then the recording's first scans are done again.
void DenseFrontEnd::consider_opening(const Scan& scan, const DenseEstimate& estimate) {
  if (received_.counts.scans < 2) return;
  const Scan& first = *std::get<ScanPtr>(opening_->events.front());
  if (received_.counts.parts == 0 && opening_->rounds == 0 && is_part_of_turn(first, scan)) {
    leave_out_first();
    return;
  }
  constexpr int kMostRounds = 6;
  std::optional<AssumedMotion> better;
  if (estimate.matched && opening_->rounds < kMostRounds) {
    better = better_start(first, scan, map_->keyframes().front().world_from_body,
                          estimate.match.target_from_source, opening_->motion,
                          odometry_->uses_imu() && !conditions_.imu_doubted);
  }
  better ? repeat_opening(*better) : opening_.reset();
}

void DenseFrontEnd::repeat_opening(const AssumedMotion& motion) {
  opening_->motion = motion;
  ++opening_->rounds;
  start_anew();
  const std::vector<Event> events = std::exchange(opening_->events, {});
  const Rig rig = rig_;
  opening_->events.push_back(events.front());
  on_scan(*std::get<ScanPtr>(events.front()));
  for (std::size_t i = 1; i < events.size(); ++i)
    take(events[i], rig);
}

// Begins with the second scan instead.
void DenseFrontEnd::leave_out_first() {
  const std::vector<Event> events = std::exchange(opening_->events, {});
  const Scan& first = *std::get<ScanPtr>(events.front());
  log_.warn("scan.part",
            fmt::format("the recording begins within a turn of the lidar: its first scan, of {} "
                        "points at {} s, is left out",
                        first.points.size(), format_seconds(first.stamp)));
  received_ = opening_->before;
  received_.counts.parts = 1;
  opening_ = std::make_unique<Opening>();
  odometry_.reset();
  const Rig rig = rig_;
  for (std::size_t i = 1; i < events.size(); ++i)
    take(events[i], rig);
}

// A new odometry from this scan on, put `about_there`, and an empty local map.
DenseEstimate DenseFrontEnd::begin_segment(const Scan& scan, const Pose& about_there) {
  log_.warn("map.segment",
            fmt::format("position lost at {} s: a new piece of map begins there. Its place "
                        "relative to the old one is a guess",
                        format_seconds(scan.stamp)));
  received_.clock.break_off();
  if (received_.calibration) received_.calibration->break_off();
  const bool proven = odometry_->motion().imu_trust().proven;
  make_odometry(rig_);
  for (const ImuSample& sample : received_.imu)
    odometry_->add_imu(sample);
  if (odometry_->uses_imu()) {
    tell_of_imu(scan.stamp);
    if (!proven) odometry_->suspect_imu(scan.stamp);
  }
  // A better guess than standing still.
  odometry_->set_initial_motion(recovery_.last_velocity_in_body(), Eigen::Vector3d::Zero());
  if (satellites_) satellites_->begin_piece();
  map_->start_segment();
  positioned_.begins_piece = true;
  if (received_.counts.segments++ == 1) received_.counts.first_lost = scan.stamp;
  received_.counts.lost_in_a_row = 0;
  DenseEstimate estimate = odometry_->process(scan, map_->local_map());
  put_at(about_there, *odometry_, estimate);
  return estimate;
}

void DenseFrontEnd::on_scan(const Scan& scan) {
  const ScopedTimer timer(times_, "scan");
  const double cpu_start = process_cpu_seconds() - map_->search_cpu_seconds();
  positioned_ = {};
  const std::size_t local_map_size = map_->local_map() ? map_->local_map()->size() : 0;
  const NavState predicted =
      recovery_.is_outage(scan.stamp) ? odometry_->motion().predict(scan.stamp) : NavState();
  DenseEstimate estimate = odometry_->process(scan, map_->local_map(), knowledge_of(scan));
  if (estimate.update.status == MotionStatus::kIgnored) return;
  bool seen = estimate.thinned.size() >= kFewPoints;
  if (!map_->keyframes().empty() && seen) {
    if (recovery_.is_outage(scan.stamp) && recovery_.waits(predicted, estimate)) {
      seen = false;
    } else if (recovery_.lost_over_outage(scan.stamp, estimate)) {
      estimate = begin_segment(scan, recovery_.place_after_outage(predicted));
    } else if (recovery_.lost(estimate, received_.counts.lost_in_a_row)) {
      estimate = begin_segment(scan, recovery_.last_good());
    }
  }
  recovery_.note_scan(scan.stamp, seen);
  if (estimate.tops) ++received_.counts.by_tree_tops;
  const std::uint64_t content = content_of(scan);
  received_.counts.repeated += is_repetition(content, received_.counts.last_content) ? 1 : 0;
  received_.counts.last_content = content;
  ScanRecord record;
  record.stamp = scan.stamp;
  record.points = static_cast<std::uint32_t>(scan.points.size());
  record.matched_points = static_cast<std::uint32_t>(estimate.thinned.size());
  record.map_size = local_map_size;
  note_outcome(estimate, record);
  note_middle(estimate, record);
  check_clock(estimate, record);
  update_map(estimate, record);
  record.wall_ms = static_cast<float>(timer.wall_ms());
  record.cpu_ms =
      static_cast<float>(1e3 * (process_cpu_seconds() - map_->search_cpu_seconds() - cpu_start));
  journal_->append(record);
  last_scan_end_ = positioned_.end = estimate.scan_end;
  if (opening_) consider_opening(scan, estimate);
}

void DenseFrontEnd::note_outcome(const DenseEstimate& estimate, ScanRecord& record) {
  ++received_.counts.scans;
  received_.counts.points += record.points;
  received_.counts.weather_points += estimate.weather;
  const std::vector<std::uint8_t>& carried = estimate.cloud.carried;
  received_.counts.carried_points +=
      static_cast<std::uint64_t>(std::count(carried.begin(), carried.end(), 1));
  record.fitness_m2 = static_cast<float>(estimate.match.fitness_m2);
  record.inlier_ratio = static_cast<float>(estimate.match.inlier_ratio);
  record.iterations = static_cast<std::uint16_t>(estimate.match.iterations);
  record.degenerate_directions =
      static_cast<std::uint8_t>(estimate.match.degenerate_directions.cols());
  record.set_covariance(estimate.state.pose_covariance);
  if (estimate.thinned.size() < kFewPoints) {
    ++received_.counts.empty_scans;
    log_.warn("scan.few_points",
              fmt::format("scan at {} has only {} usable points", format_seconds(record.stamp),
                          estimate.thinned.size()));
  }
  record.outcome = ScanOutcome::kMatched;
  if (estimate.update.status == MotionStatus::kVelocityGate) {
    record.outcome = ScanOutcome::kGated;
    ++received_.counts.gated;
    log_.warn("match.velocity_gate",
              fmt::format("match of the scan at {} dropped: {}", format_seconds(record.stamp),
                          estimate.update.reason));
  } else if (!estimate.matched && map_->local_map() != nullptr) {
    record.outcome = ScanOutcome::kUnmatched;
    ++received_.counts.unmatched;
    if (estimate.thinned.size() < kFewPoints) return;
    log_.warn("match.none",
              fmt::format("scan at {} could not be matched ({:.0f} % of its points "
                          "near the map){}",
                          format_seconds(record.stamp), 100.0 * estimate.match.inlier_ratio,
                          estimate.match.reason.empty() ? "" : ": " + estimate.match.reason));
  }
}

void DenseFrontEnd::update_map(const DenseEstimate& estimate, ScanRecord& record) {
  NavState state = estimate.state;
  std::optional<Pose> back;  // a later piece does not turn about the origin of the world
  if (const std::optional<Pose>& levelled = estimate.update.new_world_from_old_world) {
    back = map_->level(*levelled, state.world_from_body);
    if (satellites_) satellites_->level_world(*levelled);
  }
  positioned_.pose = {record.stamp, state.world_from_body};
  if (satellites_) tell_satellites(estimate);
  positioned_.new_world_from_old_world = estimate.update.new_world_from_old_world;
  if (back) {
    move_world(*back);
    state.world_from_body = *back * state.world_from_body;
  }
  const bool good =
      record.outcome == ScanOutcome::kMatched && estimate.thinned.size() >= kFewPoints;
  // A scan without points is no failed match: whether the position is lost, the next ones tell.
  if (good) received_.counts.lost_in_a_row = 0;
  if (!good && estimate.thinned.size() >= kFewPoints) ++received_.counts.lost_in_a_row;
  if (good) recovery_.note_good(estimate);
  const KeyframeOffer offer = {state.world_from_body, state.pose_covariance, estimate.found_share,
                               estimate.match.fitness_m2, satellites_ && satellites_->holds()};
  const bool wanted = good && map_->wants(offer);
  // Positions are kept relative to the last keyframe, so that whatever moves keyframes later (loop
  // closure, levelling) moves the scans with them.
  const bool first = map_->keyframes().empty();
  const Pose reference = first ? state.world_from_body : map_->keyframes().back().world_from_body;
  record.keyframe = first ? 0 : static_cast<std::int32_t>(map_->keyframes().size()) - 1;
  const Pose keyframe_from_body = reference.inverse() * state.world_from_body;
  record.set_pose(keyframe_from_body);
  const Eigen::Quaterniond keyframe_from_world = reference.rotation().conjugate();
  Eigen::Map<Eigen::Vector3d>(record.velocity.data()) =
      keyframe_from_world * state.velocity_in_world;
  Eigen::Map<Eigen::Vector3d>(record.gyro_bias.data()) = state.gyro_bias;
  Eigen::Map<Eigen::Vector3d>(record.accel_bias.data()) = state.accel_bias;
  if (!wanted) {
    const auto keyframe = static_cast<std::size_t>(record.keyframe);
    if (good && !first) clouds_.offer(estimate, keyframe, keyframe_from_body, map_->keyframes());
    return;
  }
  record.becomes_keyframe = 1;
  clouds_.offer(estimate, map_->keyframes().size(), Pose(), map_->keyframes());
  const auto moved = map_->add(record.stamp, offer, map_points_.of(estimate));
  if (moved) move_world(*moved);
  watch_memory();
}

// What can be read again from the disk leaves the memory before the limit is reached.
void DenseFrontEnd::watch_memory() {
  if (!memory_is_short(config_.max_memory_mb)) return;
  map_->free_cache();
  return_freed_memory();
}

// Loops have moved the present, too.
void DenseFrontEnd::move_world(const Pose& new_world_from_old_world) {
  odometry_->move_world(new_world_from_old_world);
  received_.clock.turn_world(new_world_from_old_world.rotation());
  if (received_.calibration) received_.calibration->move_world(new_world_from_old_world);
  if (satellites_) satellites_->move_present(new_world_from_old_world);
  std::optional<Pose>& so_far = positioned_.new_world_from_old_world;
  so_far = so_far ? new_world_from_old_world * *so_far : new_world_from_old_world;
  positioned_.pose.world_from_body = new_world_from_old_world * positioned_.pose.world_from_body;
  if (std::optional<StampedPose>& middle = positioned_.matched_middle)
    middle->world_from_body = new_world_from_old_world * middle->world_from_body;
}

}  // namespace understory
