#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <limits>
#include <vector>

#include "understory/odometry/motion/motion_model.h"

namespace understory {

// Compares what the IMU says with what the lidar says, to find swapped axes, wrong extrinsics and
// wrong units. Rotation: turns between scans by matching against integrated rates. Gravity: the
// mean specific force over a second, turned into the world by the lidar's attitude. It must point
// the same way at all times and have the length of gravity.
//
// An IMU that is contradicted before it has ever agreed is put on probation: the motion model goes
// on without it. So a wrong IMU no longer bends the lidar's turns that it is measured by, until
// there has been enough turning for a verdict. Where a run before this one found that it was right,
// it is vouched for: until then contradictions are the lidar's fault. Not thread-safe.
class TrustMonitor {
 public:
  explicit TrustMonitor(double gravity_m_s2) : gravity_(gravity_m_s2) {}

  // Turn of the IMU from scan to scan, as rotation vectors in its frame at the first scan. One is
  // from matching, one from the gyroscope without any estimate of its bias. An estimate that
  // follows the lidar would hide what is looked for. `gyro_turning`: all that it turned, to and
  // fro, radians.
  void add_turn(const Eigen::Vector3d& by_lidar, const Eigen::Vector3d& by_gyro,
                double gyro_turning, double duration_s);
  // The same where matching knows the turn too badly to say anything.
  void leave_out_turn() { join_anew(); }
  // Mean specific force between two scans with the attitude by matching in its middle.
  void add_force(const Eigen::Quaterniond& world_from_imu, const Eigen::Vector3d& force_in_imu,
                 double duration_s);

  // The scan matches keep contradicting what the IMU predicts, now.
  void suspect(TimeNs now);
  // Time goes on: a probation that comes to no verdict ends, for the IMU.
  void pass_time(TimeNs now);
  // A run before this one doubted the IMU up to `until` and found it right. Up to then nothing is
  // held against it, and it counts as proven. To be called before the first turn.
  void vouch_until(TimeNs until);
  [[nodiscard]] bool vouched_for(TimeNs now) const { return now <= vouched_until_; }
  [[nodiscard]] bool on_probation() const { return standing_ == Standing::kOnProbation; }

  // The judgement so far; stays untrusted once it is.
  [[nodiscard]] const ImuTrust& trust() const { return trust_; }
  // False if the IMU is sure to do harm: its axes are not where the rig says, or its unit is wrong.
  // (A disagreement that nothing explains may be the lidar's fault; then the IMU stays in use.)
  [[nodiscard]] bool usable() const { return trust_.usable && !on_probation(); }

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  enum class Standing { kUnproven, kOnProbation, kProven };

  void judge_turns();
  void judge_forces();
  void distrust(const std::string& reason, bool usable);
  void begin_anew();
  void join_anew();
  [[nodiscard]] double force_spread() const;
  void take_turn(const Eigen::Vector3d& by_lidar, const Eigen::Vector3d& by_gyro,
                 double duration_s);

  double gravity_;
  ImuTrust trust_;
  double lidar_turning_ = 0.0;  // in all, on probation
  double gyro_turning_ = 0.0;
  Standing standing_ = Standing::kUnproven;
  bool was_on_probation_ = false;  // and passed
  TimeNs now_ = 0;
  TimeNs probation_since_ = 0;
  TimeNs vouched_until_ = std::numeric_limits<TimeNs>::min();
  // Sums over turns: outer product of gyro and lidar, squares, vectors, and the total angle,
  // radians.
  Eigen::Matrix3d product_ = Eigen::Matrix3d::Zero();
  double lidar_square_ = 0.0;
  double gyro_square_ = 0.0;
  Eigen::Vector3d lidar_sum_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d gyro_sum_ = Eigen::Vector3d::Zero();
  double turn_time_ = 0.0;
  double total_angle_ = 0.0;
  int turns_ = 0;
  // On probation turns are joined to longer ones, because a lidar alone is less sure of each.
  Eigen::Quaterniond joined_lidar_ = Eigen::Quaterniond::Identity();
  Eigen::Quaterniond joined_gyro_ = Eigen::Quaterniond::Identity();
  double joined_time_ = 0.0;
  // The second being gathered, then sums over the unit vectors of the finished ones.
  Eigen::Vector3d force_world_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d force_imu_ = Eigen::Vector3d::Zero();
  double force_time_ = 0.0;
  Eigen::Vector3d directions_world_ = Eigen::Vector3d::Zero();
  double length_sum_ = 0.0;
  int seconds_ = 0;
};

}  // namespace understory
