#include "understory/odometry/stems/stem_front_end.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "understory/geometry/pose_io.h"
#include "understory/odometry/odometry_constants.h"

namespace understory {
namespace {

using namespace odometry_constants::stem_front_end;

double reach_of(const StemView& view, const StemUp& up) {
  std::vector<double> ranges;
  for (const Stem& stem : view.stems)
    ranges.push_back(plane_range_m(stem, up.up_in_body));
  if (ranges.empty()) return 0.0;
  const auto at = ranges.begin() + static_cast<std::ptrdiff_t>(9 * (ranges.size() - 1) / 10);
  std::nth_element(ranges.begin(), at, ranges.end());
  return *at;
}

}  // namespace

void describe(ConfigTable& table, ViewChoiceConfig& config) {
  table.add_enum("rule", config.rule,
                 {{"fixed", ViewChoiceConfig::Rule::kFixed},
                  {"overlap", ViewChoiceConfig::Rule::kOverlap},
                  {"region", ViewChoiceConfig::Rule::kRegion}},
                 "when a positioned scan is kept as a view of the map: after a fixed motion, by "
                 "overlap, or by convergence region");
  table.add("distance_m", config.distance_m, {0.0, 20.0}, "m",
            "rule fixed: a view is kept after this motion of the body since the last one");
  table.add("turn_deg", config.turn_deg, {0.0, 180.0}, "deg",
            "rule fixed: a view is kept after this turn of the body since the last one");
  table.add("overlap", config.overlap, {0.0, 1.0}, "",
            "rule overlap: a view is kept when its overlap with the map falls to this share of "
            "that after the last kept view");
  table.add("region", config.region, {0.0, 10.0}, "",
            "rule region: a view is kept when the motion since the last one leaves this share of "
            "the region where matching converges");
}

void describe(ConfigTable& table, StemFrontEndConfig& config) {
  table.add("min_score", config.min_score, {0.0, 1.0}, "",
            "least probability with which a segment counts as a stem");
  table.add("max_range_m", config.max_range_m, {5.0, 200.0}, "m",
            "range up to which stems are detected");
  table.add("predict_turn", config.predict_turn,
            "predict the next pose with the last turn going on; false: with the last heading");
  table.section("keep", [&] { describe(table, config.keep); });
  table.section("imu", [&] { describe(table, config.imu); });
  table.section("odometry", [&] { describe(table, config.odometry); });
}

StemView StemFrontEnd::view_of(const Scan& scan, int frame, const FoundStems& found,
                               const Vector6d& motion_per_s) const {
  StemView view;
  view.frame = frame;
  view.stamp = scan.stamp;
  std::vector<std::size_t> first_of_lidar;
  for (const LidarStems& lidar : found.lidars) {
    first_of_lidar.push_back(view.stems.size());
    for (const StemSegment& segment : lidar.found.stems) {
      const Pose stamp_from_lidar =
          Pose::exp(1e-9 * segment.t_ns * motion_per_s) * lidar.body_from_lidar;
      view.stems.push_back(stem_of(segment, stamp_from_lidar, lidar.found.up));
    }
  }
  drop_double_stems(first_of_lidar, view.stems);
  return view;
}

bool StemFrontEnd::to_be_kept(const StemScan& result) {
  const auto due = [&] {
    const Pose moved = last_kept_->inverse() * result.step.world_from_body;
    const double shift_m = moved.translation().norm();
    switch (config_.keep.rule) {
      case ViewChoiceConfig::Rule::kFixed:
        return shift_m >= config_.keep.distance_m ||
               moved.angle() * 180.0 / std::numbers::pi >= config_.keep.turn_deg;
      case ViewChoiceConfig::Rule::kOverlap:
        best_overlap_ = std::max(best_overlap_, result.step.overlap);
        return result.step.overlap <= config_.keep.overlap * best_overlap_;
      case ViewChoiceConfig::Rule::kRegion: {
        const ConvergenceRegion region = convergence_region(
            result.step.spacing_m, std::max(result.reach_m, 1.0), 1.0 - result.step.overlap);
        const double share = std::max(config_.keep.region, 1e-6);
        return !region.contains(shift_m / share, moved.angle() / share, 0.0);
      }
    }
    return true;
  };
  if (last_kept_ && !due()) return false;
  last_kept_ = result.step.world_from_body;
  best_overlap_ = 0.0;
  return true;
}

void StemFrontEnd::watch_imu(const StemScan& result, const Rig& rig, const ImuBuffer* samples) {
  if (samples == nullptr || !config_.imu.use || !rig.body_from_imu) return;
  const TimeNs now = result.view.stamp;
  watch_.pass_time(now);
  if (!last_matched_ || result.step.status != SparseStepStatus::kTracked) return;
  const std::vector<InertialSample> between = samples->slice(last_->stamp, now);
  if (between.empty()) return;
  watch_.compare({last_->stamp, last_->world_from_body * *rig.body_from_imu},
                 {now, result.step.world_from_body * *rig.body_from_imu}, between);
}

StemFrontEnd::Guess StemFrontEnd::guess(const Scan& scan, int frame, const Rig& rig,
                                        const FoundStems& found, const ImuBuffer* samples,
                                        double since) const {
  Guess guess;
  guess.motion_per_s = motion_per_s_;
  if (config_.predict_turn) guess.step = Pose::exp(since * motion_per_s_);
  if (samples != nullptr && config_.imu.use && rig.body_from_imu && watch_.usable())
    guess.by_imu = imu_.motion(*samples, last_->stamp, scan, *rig.body_from_imu);
  if (guess.by_imu) {
    Vector6d step = since * motion_per_s_;
    step.head<3>() = so3_log(guess.by_imu->previous_from_now);
    guess.step = Pose::exp(step);
    guess.motion_per_s.head<3>() = guess.by_imu->rate_in_scan;
  }
  if (!scan.has_point_times) return guess;
  // The step of a first try says how the body moved up to this scan. The scan itself lies half a
  // step later than the middle of that. Where scans follow each other without a pause, what is
  // taken out wrongly would come back larger by such an outlook, so there is none.
  const bool pauses = to_seconds(scan.end() - scan.stamp) < kPause * since;
  SparseOdometry trial = odometry_;
  const StemView view = view_of(scan, frame, found, guess.motion_per_s);
  const SparseStep step =
      trial.track(view, guess.step, stem_up(view, rig.body_from_lidar.rotation() * found.up));
  const Vector6d latest = (last_->world_from_body.inverse() * step.world_from_body).log() / since;
  if (step.status != SparseStepStatus::kTracked && step.status != SparseStepStatus::kSearched)
    return guess;
  guess.motion_per_s = pauses ? Vector6d(1.5 * latest - 0.5 * motion_per_s_) : latest;
  if (guess.by_imu) guess.motion_per_s.head<3>() = guess.by_imu->rate_in_scan;
  if (config_.predict_turn || guess.by_imu) guess.step = Pose::exp(since * latest);
  return guess;
}

StemFrontEnd::FoundStems StemFrontEnd::find_stems(const Scan& scan, const Rig& rig,
                                                  const ImuBuffer* samples) {
  StemSegmentConfig config;
  config.min_score = config_.min_score;
  config.max_range_m = config_.max_range_m;
  std::vector<std::uint8_t> use;
  if (config_.machine_boxes) use = outside_machine(scan, rig, *config_.machine_boxes);
  FoundStems best;
  double most = -1.0;
  for (const Eigen::Vector3d& up : possible_ups(scan, rig, samples)) {
    config.up = up;
    std::vector<LidarStems> lidars = find_stems_of_lidars(scan, rig, config, use);
    double standing = 0.0;
    std::size_t stems = 0;
    for (const LidarStems& lidar : lidars) {
      standing += standing_stems(lidar.found);
      stems += lidar.found.stems.size();
    }
    const bool surely = stems >= kFewestStanding && standing > kMoreStanding * most;
    if (most >= 0.0 && !surely) continue;
    most = standing;
    best.up = up_by_stems(lidars, up);
    best.lidars = std::move(lidars);
    best.any = stems > 0;
  }
  if (best.any) up_in_lidar_ = best.up;
  return best;
}

std::vector<Eigen::Vector3d> StemFrontEnd::possible_ups(const Scan& scan, const Rig& rig,
                                                        const ImuBuffer* samples) const {
  if (up_in_lidar_) return {*up_in_lidar_};
  const Eigen::Quaterniond lidar_from_body = rig.body_from_lidar.rotation().inverse();
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  std::vector<Eigen::Vector3d> axes;
  if (samples != nullptr && config_.imu.use && rig.body_from_imu) {
    Eigen::Vector3d force = Eigen::Vector3d::Zero();
    for (const InertialSample& sample :
         samples->samples(scan.stamp - from_seconds(kFirstForceS), scan.end()))
      force += sample.specific_force();
    if (force.norm() > 0.0)
      axes.emplace_back((lidar_from_body * (rig.body_from_imu->rotation() * force)).normalized());
  }
  axes.push_back(z);
  axes.emplace_back(lidar_from_body * z);
  std::vector<Eigen::Vector3d> ups;
  for (const Eigen::Vector3d& axis : axes) {
    for (const double sign : {1.0, -1.0}) {
      const Eigen::Vector3d up = sign * axis;
      const bool known = std::any_of(ups.begin(), ups.end(), [&](const Eigen::Vector3d& other) {
        return other.dot(up) > kSameUp;
      });
      if (!known) ups.push_back(up);
    }
  }
  return ups;
}

StemScan StemFrontEnd::add(const Scan& scan, int frame, const Rig& rig, const ImuBuffer* samples) {
  const FoundStems found = find_stems(scan, rig, samples);
  StemScan result;
  const double since = last_ ? to_seconds(scan.stamp - last_->stamp) : 0.0;
  const bool follows = last_ && since > kShortestStep && since < kLongestStep;
  Guess guess;
  if (follows) {
    result.expected = last_->world_from_body * Pose::exp(since * motion_per_s_);
    guess = this->guess(scan, frame, rig, found, samples, since);
  }
  result.view = view_of(scan, frame, found, guess.motion_per_s);
  result.motion_rad_s = guess.motion_per_s.head<3>().norm();
  StemUp up = stem_up(result.view, rig.body_from_lidar.rotation() * found.up);
  if (guess.by_imu) up = imu_.up(up, *guess.by_imu);
  result.reach_m = reach_of(result.view, up);
  result.step = odometry_.track(result.view, guess.step, up);
  motion_per_s_.setZero();
  std::optional<Eigen::Quaterniond> matched;
  if (follows) {
    const Pose moved = last_->world_from_body.inverse() * result.step.world_from_body;
    motion_per_s_ = moved.log() / since;
    if (result.step.status == SparseStepStatus::kTracked) matched = moved.rotation();
  }
  if (guess.by_imu) {
    imu_.take(*guess.by_imu, matched);
  } else {
    imu_.forget();
  }
  if (follows) watch_imu(result, rig, samples);
  last_matched_ = result.step.status == SparseStepStatus::kTracked ||
                  result.step.status == SparseStepStatus::kFirst;
  last_ = StampedPose{scan.stamp, result.step.world_from_body};
  result.keep = !result.view.stems.empty() && to_be_kept(result);
  if (result.keep) odometry_.take_up_last();
  return result;
}

GatheredMotion StemFrontEnd::gathered_motion(const ImuBuffer* samples) const {
  GatheredMotion motion;
  motion.per_s = motion_per_s_;
  if (config_.imu.use && watch_.usable()) motion.samples = samples;
  motion.gyro_bias = imu_.gyro_bias();
  return motion;
}

void StemFrontEnd::save(BinaryWriter& writer) const {
  odometry_.save(writer);
  imu_.save(writer);
  watch_.save(writer);
  writer.put(last_matched_);
  put_optional(writer, up_in_lidar_,
               [](BinaryWriter& out, const Eigen::Vector3d& up) { out.put_doubles(up.data(), 3); });
  put_optional(writer, last_, put_stamped_pose);
  put_optional(writer, last_kept_, put_pose);
  writer.put(best_overlap_);
  writer.put_doubles(motion_per_s_.data(), 6);
}

void StemFrontEnd::load(BinaryReader& reader) {
  odometry_.load(reader);
  imu_.load(reader);
  watch_.load(reader);
  last_matched_ = reader.get<bool>();
  up_in_lidar_ = get_optional(reader, [](BinaryReader& in) {
    Eigen::Vector3d up;
    in.get_doubles(up.data(), 3);
    return up;
  });
  last_ = get_optional(reader, get_stamped_pose);
  last_kept_ = get_optional(reader, get_pose);
  best_overlap_ = reader.get<double>();
  reader.get_doubles(motion_per_s_.data(), 6);
}

}  // namespace understory
