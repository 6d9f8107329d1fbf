#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "understory/calibration/lidar_imu/lidar_imu_calibration.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// How an IMU sits on the body and how late its clock is, as the windows of a run so far tell it.
struct OnlineImuEstimate {
  Pose body_from_imu;
  double late_s = 0.0;  // the IMU's stamp, as it was handed in, less that of the lidar
  // Of rotation (right perturbation, frame of the IMU, rad), place (body frame, m) and lateness
  // (s). Zero along what no window tells: there the given values stand.
  Eigen::Matrix<double, 7, 7> covariance = Eigen::Matrix<double, 7, 7>::Zero();
  double duration_s = 0.0;  // of the path in the windows
  std::size_t windows = 0;  // that told something
  // Whether lateness, rotation or place differ from what is given. Chance does not explain it: they
  // are three standard deviations off in a direction. It matters: 0.5 ms, 0.05 degrees or 1 cm.
  bool differs = false;
};

// Refines place and clock of an IMU while a run goes on. Windows of 20 s are handed to
// `calibrate_lidar_imu`, one after the other, and what they tell is joined by their covariances.
// The scans are deskewed by the IMU. An error of its clock moves their first points and not their
// middles, so the path of the middles is taken. Its errors hardly depend on the IMU then. Memory is
// bounded by a window. Not thread-safe; deterministic.
class OnlineImuCalibration {
 public:
  // Of the IMU, in order of time. Those that cannot be used are dropped.
  void add_sample(const ImuSample& sample);
  // Pose of the body at the middle of a scan, by its match alone, in order of time. The samples so
  // far reach beyond it. `given` is what the scans are mapped with: the same at each call.
  void add_scan(const StampedPose& world_from_body_at_middle, const Pose& given);
  // The world of the scans to come is another one than that of the scans before.
  void move_world(const Pose& new_world_from_old_world);
  // The scans to come lie in another world, nobody knows where.
  void break_off();

  // Of the windows so far; a started one of 10 s and more counts. Nothing where none tells.
  [[nodiscard]] std::optional<OnlineImuEstimate> finished() const;
  // The same without a started one: it changes once a window.
  [[nodiscard]] std::optional<OnlineImuEstimate> so_far() const;

  // The whole state, bit for bit.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  using Vector7d = Eigen::Matrix<double, 7, 1>;
  using Matrix7d = Eigen::Matrix<double, 7, 7>;

  void end_window();

  ImuBuffer imu_{ImuNoiseConfig(), nullptr};
  std::vector<StampedPose> window_;
  Pose given_;
  TimeNs newest_sample_ = 0;
  // Normal equations of the steps from the given values, in units of 1 degree, 0.1 m and 5 ms.
  Matrix7d information_ = Matrix7d::Zero();
  Vector7d weighted_ = Vector7d::Zero();
  double duration_s_ = 0.0;
  std::size_t windows_ = 0;
};

}  // namespace understory
