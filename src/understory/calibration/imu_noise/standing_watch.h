#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "understory/sensor/imu_sample.h"

namespace understory {

// A time during which an IMU stood still.
struct StandingStretch {
  TimeNs from = 0;
  TimeNs to = 0;
  [[nodiscard]] double duration_s() const { return to_seconds(to - from); }
};

// Finds when an IMU stood still, by windows of a second. Nothing shakes or turns it within one, and
// its mean rates and forces are those of the stretch that it goes on with. A stretch also ends at a
// gap of more than half a second. Memory grows with the number of stretches. Not thread-safe.
class StandingWatch {
 public:
  // The next sample; stamps must ascend.
  void add(const ImuSample& sample);
  // All stretches so far in their order, with the one that still lasts. Of a recording that stands
  // from its first to its last sample this is one stretch from the first to the last stamp.
  [[nodiscard]] std::vector<StandingStretch> stretches() const;

 private:
  using Vector6d = Eigen::Matrix<double, 6, 1>;  // rad/s, m/s^2

  void begin_window(TimeNs stamp);
  void close_window();
  void end_stretch();
  [[nodiscard]] bool is_quiet(const Vector6d& mean) const;

  std::vector<StandingStretch> done_;
  StandingStretch stretch_;
  bool standing_ = false;
  Vector6d stretch_mean_ = Vector6d::Zero();
  TimeNs window_from_ = 0;
  TimeNs last_ = 0;
  std::uint64_t count_ = 0;
  Vector6d first_ = Vector6d::Zero();  // of the window: taken off, so that no digits are lost
  Vector6d sum_ = Vector6d::Zero();
  Vector6d squares_ = Vector6d::Zero();
};

}  // namespace understory
