#include "understory/odometry/dense/dense_odometry.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "understory/geometry/matrix_inverse.h"
#include "understory/odometry/dense/scan_parts.h"
#include "understory/odometry/imu/imu_smoother.h"
#include "understory/odometry/odometry_constants.h"

namespace understory {
namespace {

using namespace odometry_constants::dense_odometry;

// From the first pose of a path to that at `stamp`.
Pose motion_until(const std::vector<StampedPose>& path, TimeNs stamp) {
  for (std::size_t i = 1; i < path.size(); ++i) {
    if (path[i].stamp < stamp && i + 1 < path.size()) continue;
    const double share = to_seconds(stamp - path[i - 1].stamp) /
                         std::max(to_seconds(path[i].stamp - path[i - 1].stamp), 1e-9);
    return path.front().world_from_body.inverse() * interpolate(path[i - 1].world_from_body,
                                                                path[i].world_from_body,
                                                                std::clamp(share, 0.0, 1.0));
  }
  return {};
}

}  // namespace

void describe(ConfigTable& table, ScanMatchConfig& config) {
  table.add(
      "min_inlier_ratio", config.min_inlier_ratio, {0.0, 1.0}, "",
      "least share of a scan's points near the map for a match to count; of sparse scans 0.05");
  table.add("min_inlier_share", config.min_inlier_share, {0.0, 1.0}, "",
            "a match counts if it finds this share of what the matches before it found, or more");
  table.add("few_found_residual", config.few_found_residual, {0.0, 100.0}, "",
            "a match that finds less counts if its distance from the map is at most so many times "
            "the usual one. 0: it never counts; of sparse scans 1.5");
  table.add(
      "coarse_above_sigma", config.coarse_above_sigma, {0.0, 100.0}, "reaches",
      "standard deviation of the prediction above which a match begins with its widest steps. A "
      "reach is the finest cell of NDT");
  table.add("prior_weight", config.prior_weight, {0.0, 1.0}, "",
            "weight of the prediction inside the match");
  table.add_enum("prior_form", config.prior_form,
                 {{"direct", PenaltyForm::kDirect},
                  {"one_point", PenaltyForm::kOnePoint},
                  {"three_points", PenaltyForm::kThreePoints}},
                 "how the prediction enters: as a term of the pose, or as penalty points for the "
                 "position, or for position, gravity and heading");
}

void describe(ConfigTable& table, DenseOdometryConfig& config) {
  table.section("preprocess", [&] {
    table.section("voxel", [&] { describe(table, config.voxel); });
    table.section("isolated", [&] { describe(table, config.isolated); });
    table.section("carried", [&] { describe(table, config.carried); });
    describe(table, config.tops);
    table.section("weather", [&] { describe(table, config.weather); });
    table.add("machine_boxes_file", config.machine_boxes_file,
              "YAML of boxes around the machine whose points are dropped; empty: none");
  });
  table.section("motion", [&] {
    table.add("elastic_scans", config.elastic_scans,
              "without an IMU: match the first and the last pose of a scan together");
    table.add("imu_enabled", config.imu_enabled, "use the IMU of the recording");
    describe(table, config.motion);
  });
}

DenseOdometry::DenseOdometry(const DenseOdometryConfig& config, const Rig& rig,
                             std::shared_ptr<const FeatureFinder> features, StageTimes& times,
                             Log& log)
    : config_(config),
      rig_(rig),
      features_(std::move(features)),
      times_(times),
      log_(log),
      uses_imu_(config.imu_enabled && rig.body_from_imu.has_value()),
      carried_(config.carried),
      weather_(config.weather) {
  motion_ = uses_imu_ ? make_imu_smoother(config.motion, rig, &log)
                      : make_constant_velocity_model(config.motion, &log);
  if (!config.machine_boxes_file.empty()) boxes_ = read_machine_boxes(config.machine_boxes_file);
}

void DenseOdometry::add_imu(const ImuSample& sample) {
  if (uses_imu_) motion_->add_imu(sample);
}

DenseEstimate DenseOdometry::process(const Scan& scan, const MatchTargetPtr& local_map,
                                     const ScanKnowledge& known) {
  DenseEstimate estimate;
  const double cpu_start = process_cpu_seconds();
  if (!rig_.further_lidars.empty()) note_lidars(scan);
  {
    const ScopedTimer timer(times_, "odometry");
    estimate.scan_end = scan.end();
    const std::vector<StampedPose> guess = motion_->predict_path(scan.stamp, estimate.scan_end);
    learn_carried(scan, guess);
    preprocess(scan, guess, estimate);
    estimate.stamp_from_middle =
        motion_until(guess, scan.stamp + (estimate.scan_end - scan.stamp) / 2);
    const bool by_match = local_map && !known.pose;
    if (by_match) match(*local_map, motion_->predict(scan.stamp), known.terms, estimate);
    if (known.also_alone && estimate.matched) match_alone(*local_map, estimate);
    watch_scan_motion(scan, local_map, guess, estimate);
    watch_lidars(scan, local_map, estimate);
    if (config_.elastic_scans && estimate.matched && by_scans_alone())
      match_elastically(scan, *local_map, guess, estimate);
    std::optional<LidarFactor> factor;
    if (estimate.matched) {
      factor = LidarFactor{estimate.match.target_from_source,
                           overall_fitness_m2(estimate.match, local_map->reach_m()),
                           estimate.match.information};
    }
    if (local_map && known.pose) {
      factor = known.pose;
      estimate.matched = true;
      estimate.match.status = RegistrationStatus::kConverged;
      estimate.match.target_from_source = known.pose->world_from_body;
      estimate.match.inlier_ratio = 1.0;
    }
    {
      const ScopedTimer smoothing(times_, "smoothing");
      estimate.update = motion_->add_scan(scan.stamp, factor);
    }
    estimate.state = estimate.update.state;
    weather_.remember(estimate.state.world_from_body);
    if (estimate.update.status != MotionStatus::kIgnored) last_scan_ = scan.stamp;
    last_matched_ = estimate.matched;
    estimate.wall_ms = timer.wall_ms();
  }
  estimate.cpu_ms = 1e3 * (process_cpu_seconds() - cpu_start);
  return estimate;
}

void DenseOdometry::note_lidars(const Scan& scan) {
  std::uint64_t lidars = 0;
  for (const ScanPoint& point : scan.points)
    lidars |= std::uint64_t{1} << (point.ring / kRingsALidar);
  if ((lidars & ~lidars_) != 0) usual_inliers_ = 0.0;
  lidars_ |= lidars;
}

void DenseOdometry::learn_carried(const Scan& scan, const std::vector<StampedPose>& path) {
  const ScopedTimer timer(times_, "carried");
  const Pose world_from_body =
      path.empty() ? motion_->predict(scan.stamp).world_from_body : path.front().world_from_body;
  carried_.learn(scan,
                 (world_from_body * rig_.body_from_lidar).rotation_matrix().transpose().col(2));
}

void DenseOdometry::preprocess(const Scan& scan, const std::vector<StampedPose>& path,
                               DenseEstimate& estimate) {
  const ScopedTimer timer(times_, "preprocess");
  clean(scan, path, estimate);
}

void DenseOdometry::clean(const Scan& scan, const std::vector<StampedPose>& path,
                          DenseEstimate& estimate) {
  keep_.clear();
  if (!boxes_.empty()) keep_ = outside_machine(scan, rig_, boxes_);
  // The weather filter judges lone returns better: beside those in the scans before.
  if (!weather_.judges(scan)) drop_isolated(scan, config_.isolated, keep_);
  estimate.cloud = deskew(scan, rig_, path, keep_, config_.deskew).cloud;
  BodyCloud& cloud = estimate.cloud;
  cloud.carried = carried_.mark(scan);
  if (!cloud.carried.empty() && !keep_.empty()) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < keep_.size(); ++i) {
      if (keep_[i] != 0) cloud.carried[kept++] = cloud.carried[i];
    }
    cloud.carried.resize(kept);
  }
  estimate.weather =
      weather_.drop(cloud, path.empty() ? motion_->predict(scan.stamp).world_from_body
                                        : path.front().world_from_body);
  if (features_ == nullptr) {
    const Pose start = path.empty() ? Pose() : path.front().world_from_body;
    estimate.tops = keep_tree_tops(cloud, start, config_.tops);
    estimate.thinned = filter_.filter(estimate.tops ? *estimate.tops : cloud, config_.voxel);
    return;
  }
  cloud.feature = features_->find({&cloud.points, &cloud.ring});
  estimate.thinned = filter_.filter_features(cloud, config_.voxel, false);
}

std::vector<PartEstimate> DenseOdometry::match_parts(const Scan& scan,
                                                     const MatchTargetPtr& local_map,
                                                     double fraction) {
  if (!local_map || scan.stamp <= last_scan_) return {};
  std::vector<PartEstimate> estimates;
  for (const Scan& part : parts_of(scan, fraction)) {
    const ScopedTimer timer(times_, "scan_part");
    estimates.push_back(match_part(part, *local_map));
  }
  return estimates;
}

RegistrationResult DenseOdometry::match_cloud(const MatchTarget& local_map, const BodyCloud& cloud,
                                              const Pose& guess, const PoseTerms& terms,
                                              MatchStart start) const {
  std::vector<std::uint8_t> lidars = lidars_of(cloud.ring);
  if (features_ == nullptr && lidars.empty())
    return local_map.match(cloud.points, guess, terms, start);
  return local_map.match_features({cloud.points, cloud.feature, std::move(lidars)}, guess, terms,
                                  start);
}

// The match of a part is looser than that of a scan in some directions: there the prediction
// counts.
PartEstimate DenseOdometry::match_part(const Scan& part, const MatchTarget& local_map) {
  PartEstimate estimate;
  estimate.stamp = part.stamp;
  estimate.end = part.end();
  const NavState predicted = motion_->predict(part.stamp);
  DenseEstimate seen;
  clean(part, motion_->predict_path(part.stamp, estimate.end), seen);
  estimate.points = seen.thinned.size();
  const double sigma = std::sqrt(predicted.pose_covariance.diagonal().tail<3>().maxCoeff());
  const bool far = sigma > config_.match.coarse_above_sigma * local_map.reach_m();
  const MatchStart start = far ? MatchStart::kFar : MatchStart::kNear;
  const RegistrationResult match =
      match_cloud(local_map, seen.thinned, predicted.world_from_body, {}, start);
  const double least =
      std::max(config_.match.min_inlier_ratio, config_.match.min_inlier_share * usual_inliers_);
  estimate.matched = match.usable() && match.inlier_ratio >= least;
  estimate.world_from_body = predicted.world_from_body;
  if (!estimate.matched) return estimate;
  const LidarFactor factor{match.target_from_source, overall_fitness_m2(match, local_map.reach_m()),
                           match.information};
  estimate.world_from_body =
      fuse(predicted, factor.world_from_body, lidar_covariance(factor, config_.motion.lidar));
  return estimate;
}

bool DenseOdometry::by_scans_alone() const {
  if (!uses_imu_) return true;
  const ImuTrust trust = motion_->imu_trust();
  return !trust.usable || trust.on_probation;
}

void DenseOdometry::watch_scan_motion(const Scan& scan, const MatchTargetPtr& local_map,
                                      const std::vector<StampedPose>& guess,
                                      const DenseEstimate& estimate) {
  if (!estimate.matched) return scan_motion_.interrupt();
  const ScopedTimer timer(times_, "scan_motion");
  scan_motion_.add(*local_map, estimate.thinned, guess,
                   {scan.stamp, estimate.match.target_from_source}, estimate.scan_end - scan.stamp);
}

void DenseOdometry::watch_lidars(const Scan& scan, const MatchTargetPtr& local_map,
                                 const DenseEstimate& estimate) {
  if (rig_.further_lidars.empty() || estimate.tops) return;
  if (!estimate.matched) return agreement_.interrupt();
  const Pose& matched = estimate.match.target_from_source;
  if (!agreement_.wants({scan.stamp, matched})) return;
  const ScopedTimer timer(times_, "lidar_agreement");
  std::vector<std::optional<Pose>> poses;
  for (const BodyCloud& own : clouds_by_lidar(estimate.thinned)) {
    const RegistrationResult match =
        own.empty() ? RegistrationResult()
                    : match_cloud(*local_map, own, matched, {}, MatchStart::kNear);
    // A lidar that looks at the ground alone slides over it.
    const bool found = match.usable() && match.degenerate_directions.cols() == 0 &&
                       match.inlier_ratio >= config_.match.min_inlier_ratio;
    poses.push_back(found ? std::optional(match.target_from_source) : std::nullopt);
  }
  agreement_.add(poses);
}

void DenseOdometry::match_alone(const MatchTarget& local_map, DenseEstimate& estimate) {
  const ScopedTimer timer(times_, "matching_alone");
  const RegistrationResult match = match_cloud(
      local_map, estimate.thinned, estimate.match.target_from_source, {}, MatchStart::kNear);
  const bool held = match.usable() && match.degenerate_directions.cols() == 0;
  if (held && match.inlier_ratio >= config_.match.min_inlier_ratio)
    estimate.alone = match.target_from_source;
}

void DenseOdometry::match_elastically(const Scan& scan, const MatchTarget& target,
                                      const std::vector<StampedPose>& guess,
                                      DenseEstimate& estimate) {
  const ScopedTimer timer(times_, "matching_elastic");
  const TimeNs duration = estimate.scan_end - scan.stamp;
  if (duration <= 0) return;
  const Pose start = estimate.match.target_from_source;
  const ScanPathConfig path_config{kBendShare * config_.motion.motion_accel_sigma_m_s2,
                                   kBendShare * config_.motion.motion_angular_accel_sigma_rad_s2};
  const ScanPathCorrection correction =
      match_scan_path(target, estimate.thinned, duration, start, path_config);
  if (correction.iterations == 0) return;
  const std::vector<StampedPose> path = corrected_path(guess, start, duration, correction);
  preprocess(scan, path, estimate);
  estimate.match.target_from_source = path.front().world_from_body;
  estimate.stamp_from_middle = motion_until(path, scan.stamp + duration / 2);
}

void DenseOdometry::match(const MatchTarget& local_map, const NavState& predicted,
                          const PoseTerms& known, DenseEstimate& estimate) {
  const ScopedTimer timer(times_, "matching");
  const double sigma = std::sqrt(predicted.pose_covariance.diagonal().tail<3>().maxCoeff());
  const ScanMatchConfig& config = config_.match;
  const bool far = !last_matched_ || sigma > config.coarse_above_sigma * local_map.reach_m();
  PoseTerms terms = known;
  if (config.prior_weight > 0.0) {
    const Matrix6d loose = predicted.pose_covariance + 1e-9 * Matrix6d::Identity();
    if (config.prior_form == PenaltyForm::kDirect) {
      terms.push_back(
          PosePrior{predicted.world_from_body, config.prior_weight * inverse_matrix(loose)});
    } else {
      terms.push_back(penalty_term(
          belief_of(predicted.world_from_body, loose / config.prior_weight), config.prior_form));
    }
  }
  const MatchStart start = far ? MatchStart::kFar : MatchStart::kNear;
  estimate.match =
      match_cloud(local_map, estimate.thinned, predicted.world_from_body, terms, start);
  const double found = estimate.match.inlier_ratio;
  estimate.matched = estimate.match.usable() && found >= config.min_inlier_ratio;
  if (estimate.matched) compare_with_usual(estimate);
}

void DenseOdometry::compare_with_usual(DenseEstimate& estimate) {
  const double found = estimate.match.inlier_ratio;
  const double residual = std::sqrt(estimate.match.surface_residual_m2);
  const bool fits =
      residual > 0.0 && residual <= config_.match.few_found_residual * usual_residual_;
  if (found < config_.match.min_inlier_share * usual_inliers_ && !fits) {
    estimate.matched = false;
    estimate.match.reason = "suddenly much less than before";
    return;
  }
  const auto follow = [](double value, double& usual) {
    usual = usual > 0.0 ? (1.0 - kFollow) * usual + kFollow * value : value;
  };
  if (usual_inliers_ > 0.0) estimate.found_share = found / usual_inliers_;
  follow(found, usual_inliers_);
  follow(residual, usual_residual_);
}

void DenseOdometry::set_initial_motion(const Eigen::Vector3d& velocity_m_s,
                                       const Eigen::Vector3d& angular_rate_rad_s) {
  motion_->set_initial_motion(velocity_m_s, angular_rate_rad_s);
}

void DenseOdometry::take_imu(const Pose& body_from_imu, std::span<const ImuSample> samples) {
  if (!config_.imu_enabled || uses_imu_) return;
  rig_.body_from_imu = body_from_imu;
  const NavState last = motion_->predict(last_scan_);
  auto smoother = std::make_unique<ImuSmoother>(config_.motion, body_from_imu, &log_);
  for (const ImuSample& sample : samples)
    smoother->add_imu(sample);
  smoother->take_over(last);
  motion_ = std::move(smoother);
  uses_imu_ = true;
}

void DenseOdometry::move_world(const Pose& new_world_from_old_world) {
  motion_->move_world(new_world_from_old_world);
  weather_.move_world(new_world_from_old_world);
  scan_motion_.move_world(new_world_from_old_world);
  agreement_.move_world(new_world_from_old_world);
}

void DenseOdometry::save(BinaryWriter& writer) const {
  writer.put(last_matched_);
  writer.put(usual_inliers_);
  writer.put(usual_residual_);
  writer.put(lidars_);
  writer.put(last_scan_);
  scan_motion_.save(writer);
  agreement_.save(writer);
  motion_->save(writer);
  carried_.save(writer);
  weather_.save(writer);
}

void DenseOdometry::load(BinaryReader& reader) {
  last_matched_ = reader.get<bool>();
  usual_inliers_ = reader.get<double>();
  usual_residual_ = reader.get<double>();
  lidars_ = reader.get<std::uint64_t>();
  last_scan_ = reader.get<TimeNs>();
  scan_motion_.load(reader);
  agreement_.load(reader);
  motion_->load(reader);
  carried_.load(reader);
  weather_.load(reader);
}

}  // namespace understory
