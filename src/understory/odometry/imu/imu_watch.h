#pragma once

#include <vector>

#include "understory/odometry/dense/trust_monitor.h"
#include "understory/odometry/imu/preintegration.h"
#include "understory/odometry/motion/motion_scale.h"

namespace understory {

// Where matching saw the IMU at one scan.
struct ImuMatch {
  TimeNs stamp = 0;
  Pose world_from_imu;
  double rotation_sigma_rad = 0.0;  // standard deviation about the least certain axis
};

// Watches the IMU during a run: whether it agrees with the lidar, and whether it is silent. It says
// in the log, once each, how its standing changes. Not thread-safe.
class ImuWatch {
 public:
  // `log` may be null, must outlive the watch.
  ImuWatch(double gravity_m_s2, Log* log) : monitor_(gravity_m_s2), log_(log) {}

  // False while the IMU is better left out; see TrustMonitor.
  [[nodiscard]] bool usable() const { return monitor_.usable(); }
  [[nodiscard]] bool on_probation() const { return monitor_.on_probation(); }
  [[nodiscard]] ImuTrust trust() const;

  // The scan matches keep contradicting what the IMU predicts, now.
  void suspect(TimeNs now);
  // See MotionModel::vouch_for_imu.
  void vouch_until(TimeNs until) { monitor_.vouch_until(until); }
  [[nodiscard]] bool vouched_for(TimeNs now) const { return monitor_.vouched_for(now); }
  // Time goes on to the scan at `now`; to be called before compare() and note_samples().
  void pass_time(TimeNs now);
  // Two matches in a row and the samples between them (not empty), with ends at the two stamps.
  void compare(const ImuMatch& from, const ImuMatch& to,
               const std::vector<InertialSample>& samples);
  // Whether there were any usable samples between two scans. There are none where a gap is longer
  // than the filter bridges, or while the IMU is left out.
  void note_samples(bool any, TimeNs from, TimeNs to);

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  // Runs `change` on the monitor and says what it changed.
  template <class Change>
  void change_standing(TimeNs now, const Change& change);

  TrustMonitor monitor_;
  MotionScale scale_;
  TimeNs compared_ = 0;  // stamp of the last match in it
  Log* log_;
  bool silent_ = false;  // no samples over the last interval
  TimeNs without_ = 0;   // intervals without usable samples, in all
};

}  // namespace understory
