#include "understory/odometry/stems/stem_imu.h"

#include <algorithm>
#include <cmath>

#include "understory/odometry/odometry_constants.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

using namespace odometry_constants::stem_imu;

}  // namespace

void describe(ConfigTable& table, StemImuConfig& config) {
  table.add("use", config.use, "use turns and vertical of the recording's IMU, where it has one");
  table.add("gravity_time_s", config.gravity_time_s, {0.5, 600.0}, "s",
            "time over which specific force is averaged, carried along by the gyroscope");
  table.add("gravity_sd_deg", config.gravity_sd_deg, {0.01, 30.0}, "deg",
            "standard deviation of the vertical from it");
  table.add("bias_time_s", config.bias_time_s, {1.0, 10'000.0}, "s",
            "time over which the gyroscope's bias is taken from the matches");
}

std::optional<StemImu::Motion> StemImu::motion(const ImuBuffer& samples, TimeNs before,
                                               const Scan& scan, const Pose& body_from_imu) const {
  const std::vector<InertialSample> between = samples.slice(before, scan.stamp);
  if (between.size() < 2) return std::nullopt;
  const Eigen::Quaterniond body_from_imu_turn = body_from_imu.rotation();
  const Preintegration whole = preintegrate(between, body_from_imu_turn.conjugate() * gyro_bias_,
                                            Eigen::Vector3d::Zero(), {});
  Motion motion;
  motion.seconds = whole.duration;
  motion.previous_from_now =
      (body_from_imu_turn * whole.rotation * body_from_imu_turn.conjugate()).normalized();
  motion.mean_force = body_from_imu_turn * whole.velocity / whole.duration;
  // A scan of one moment has the rate of that.
  std::vector<InertialSample> within{between.back()};
  if (scan.end() > scan.stamp) within = samples.slice_available(scan.stamp, scan.end());
  if (within.empty()) return std::nullopt;
  for (const InertialSample& sample : within) {
    motion.rate_in_scan +=
        body_from_imu_turn * sample.angular_rate() / static_cast<double>(within.size());
  }
  motion.rate_in_scan -= gyro_bias_;
  return motion;
}

void StemImu::take(const Motion& motion, const std::optional<Eigen::Quaterniond>& matched) {
  force_ = force_after(motion);
  force_seconds_ = std::min(force_seconds_ + motion.seconds, config_.gravity_time_s);
  if (!matched) return;
  const Eigen::Vector3d off =
      so3_log(matched->conjugate() * motion.previous_from_now) / motion.seconds;
  bias_seconds_ = std::min(bias_seconds_ + motion.seconds, config_.bias_time_s);
  gyro_bias_ += motion.seconds / bias_seconds_ * off;
  gyro_bias_ = gyro_bias_.cwiseMax(-kLargestGyroBias).cwiseMin(kLargestGyroBias);
}

Eigen::Vector3d StemImu::force_after(const Motion& motion) const {
  const double share =
      motion.seconds / std::min(force_seconds_ + motion.seconds, config_.gravity_time_s);
  const Eigen::Vector3d mean = force_ + std::clamp(share, 0.0, 1.0) * (motion.mean_force - force_);
  return motion.previous_from_now.conjugate() * mean;
}

StemUp StemImu::up(const StemUp& by_stems, const Motion& motion) const {
  const double seconds = std::min(force_seconds_ + motion.seconds, config_.gravity_time_s);
  const double gravity_sd =
      config_.gravity_sd_deg * kDegree * std::sqrt(config_.gravity_time_s / seconds);
  StemUp result = by_stems;
  Eigen::Vector3d sum = force_after(motion).normalized() / (gravity_sd * gravity_sd);
  double information = 1.0 / (gravity_sd * gravity_sd);
  if (by_stems.stems > 0) {
    const double variance =
        kStandLeans * kStandLeans + by_stems.spread_rad * by_stems.spread_rad / by_stems.stems;
    sum += by_stems.up_in_body / variance;
    information += 1.0 / variance;
  }
  result.up_in_body = sum.normalized();
  result.sd_rad = 1.0 / std::sqrt(information);
  result.stems = std::max(1, by_stems.stems);
  return result;
}

void StemImu::save(BinaryWriter& writer) const {
  writer.put_doubles(gyro_bias_.data(), 3);
  writer.put_doubles(force_.data(), 3);
  writer.put(force_seconds_);
  writer.put(bias_seconds_);
}

void StemImu::load(BinaryReader& reader) {
  reader.get_doubles(gyro_bias_.data(), 3);
  reader.get_doubles(force_.data(), 3);
  force_seconds_ = reader.get<double>();
  bias_seconds_ = reader.get<double>();
}

}  // namespace understory
