#pragma once

#include <optional>

#include "understory/geometry/pose.h"
#include "understory/odometry/imu/imu_buffer.h"
#include "understory/odometry/stems/stem_levelling.h"
#include "understory/sensor/scan.h"
#include "understory/util/config/config.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// What the IMU tells the positioning by stems: turns and the vertical.
struct StemImuConfig {
  bool use = true;
  // Specific force is averaged over that time, carried along by the gyroscope: what the body
  // accelerates in it, it must have gained in speed.
  double gravity_time_s = 10.0;
  double gravity_sd_deg = 0.3;  // of up from it
  double bias_time_s = 30.0;    // over which the gyroscope's bias is taken from the matches
};
void describe(ConfigTable& table, StemImuConfig& config);

// What an IMU, where there is one, says to the sparse front end: turns and up. All in the frame of
// the body. Not thread-safe; deterministic; copied with the front end, without its samples.
class StemImu {
 public:
  explicit StemImu(const StemImuConfig& config) : config_(config) {}

  struct Motion {
    Eigen::Quaterniond previous_from_now = Eigen::Quaterniond::Identity();
    Eigen::Vector3d rate_in_scan = Eigen::Vector3d::Zero();  // rad/s, mean over the scan
    Eigen::Vector3d mean_force = Eigen::Vector3d::Zero();    // m/s^2, in the axes at the first
    double seconds = 0.0;
  };
  // From the scan before to this one; empty where samples are missing.
  [[nodiscard]] std::optional<Motion> motion(const ImuBuffer& samples, TimeNs before,
                                             const Scan& scan, const Pose& body_from_imu) const;
  // Goes on by that motion. `matched` is the same turn by the stems, if they were matched.
  void take(const Motion& motion, const std::optional<Eigen::Quaterniond>& matched);
  // Nothing is known of the time since the last scan.
  void forget() { force_seconds_ = 0.0; }
  // Up by the stems and by gravity as it would be after that motion, each by what it is worth.
  [[nodiscard]] StemUp up(const StemUp& by_stems, const Motion& motion) const;
  [[nodiscard]] const Eigen::Vector3d& gyro_bias() const { return gyro_bias_; }

  // The whole state, bit for bit.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  // Mean specific force once that motion has been taken, axes of the body at its end.
  [[nodiscard]] Eigen::Vector3d force_after(const Motion& motion) const;

  StemImuConfig config_;
  Eigen::Vector3d gyro_bias_ = Eigen::Vector3d::Zero();  // rad/s
  Eigen::Vector3d force_ = Eigen::Vector3d::Zero();      // m/s^2, mean
  double force_seconds_ = 0.0;                           // that it is the mean of
  double bias_seconds_ = 0.0;
};

}  // namespace understory
