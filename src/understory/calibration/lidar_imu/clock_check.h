#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "understory/calibration/lidar_imu/path_and_imu.h"
#include "understory/odometry/imu/imu_buffer.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/time.h"

namespace understory {

// How far clock and axes of an IMU seem to be off from what a run takes them for.
struct ClockCheckResult {
  double duration_s = 0.0;  // of the motion that tells it
  double late_s = 0.0;      // the IMU's stamp less that of the lidar, for one moment
  double late_sd_s = 0.0;
  double turned_rad = 0.0;     // between the IMU's true and its given axes
  double turned_sd_rad = 0.0;  // 0: turns about up tell none
  // Above 5 ms and 1 degree, and many standard deviations from none.
  [[nodiscard]] bool clock_is_off() const;
  [[nodiscard]] bool axes_are_off() const;
};

// Looks at every run whether the turns that scan matching finds are those of the gyroscope, at the
// same times and about the same axes. The fit is that of `calibrate_lidar_imu` without the
// accelerometer, linear about the given place and clock. Unlike there, the scans are deskewed by
// the IMU. Their turns then lead from the middle of one scan to that of the next. It keeps the four
// stretches of 250 steps that tell the most, and changes nothing. Not thread-safe.
class LidarImuClockCheck {
 public:
  // What the matches tell of a turn: all of it, or the turn about up alone. Matches of stems whose
  // tilt is that of the IMU tell the latter. These tell the lateness, and no turn of the axes.
  enum class Turns { kAll, kAboutUp };
  // `noise`: limits of the samples.
  LidarImuClockCheck() : LidarImuClockCheck(ImuNoiseConfig()) {}
  explicit LidarImuClockCheck(const ImuNoiseConfig& noise, Turns turns = Turns::kAll)
      : turns_(turns), imu_(noise, nullptr) {}

  // In order of time.
  void add_sample(const ImuSample& sample);
  // A scan as it was matched, without what the IMU says of its place. Takes the attitude of the
  // body at its stamp, and the time of its last point.
  void add_scan(TimeNs stamp, TimeNs end, const Eigen::Quaterniond& world_from_body,
                const Eigen::Quaterniond& body_from_imu);
  // The world of the scans to come is another one than that of the scans before.
  void turn_world(const Eigen::Quaterniond& new_world_from_old_world);
  // A scan without a match: steps do not reach over it.
  void break_off();

  // Nothing where less than 10 s of motion in stretches of 6 s tell it, or it is not told to 10 ms.
  [[nodiscard]] std::optional<ClockCheckResult> result() const;

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  // A scan that waits for samples of the IMU behind it.
  struct Seen {
    TimeNs stamp = 0;
    TimeNs middle = 0;
    std::array<double, 4> world_from_imu{0, 0, 0, 1};  // x y z w
  };
  // From one scan to the next, in the axes of the IMU.
  struct Step {
    double duration_s = 0.0;
    std::array<double, 3> turn{};         // by the gyroscope, rotation vector
    std::array<double, 3> difference{};   // from it to the turn by the lidar
    std::array<double, 3> rate_change{};  // of the turn rate, from middle to middle
    std::array<double, 3> up{};           // z of the world
  };
  using Stretch = std::vector<Step>;

  [[nodiscard]] std::optional<Step> step(const Seen& from, const Seen& to) const;
  [[nodiscard]] std::optional<Eigen::Vector3d> rate_at(TimeNs stamp) const;
  [[nodiscard]] double strength(const Stretch& stretch) const;
  [[nodiscard]] PathResiduals residuals_of(const Stretch& stretch) const;
  void keep();

  Turns turns_;
  ImuBuffer imu_;
  std::vector<Seen> seen_;  // at most two
  Stretch current_;
  std::vector<Stretch> kept_;
};

}  // namespace understory
