#pragma once

#include <optional>
#include <vector>

#include "understory/odometry/imu/preintegration.h"

namespace understory {

// An absolute pose of the IMU as a factor.
struct PoseFactor {
  Pose world_from_imu;
  Matrix6d covariance = Matrix6d::Identity();  // right perturbation, rotation first
};

// Between one state and the next: the motion and what is needed to integrate it again.
struct MotionInterval {
  std::vector<InertialSample> samples;  // empty: constant-velocity stand-in
  Preintegration motion;
};

// What the IMU measured between two states in the bytes of checkpoints, and back.
void put_interval(BinaryWriter& writer, const MotionInterval& interval);
[[nodiscard]] MotionInterval get_interval(BinaryReader& reader);

// The prior before the first scan, as standard deviations.
struct InitialUncertainty {
  double rotation_rad = 1e-4;  // the first pose defines the world, so next to nothing
  double position_m = 1e-4;
  double velocity_m_s = 10.0;
  double gyro_bias_rad_s = 0.03;
  double accel_bias_m_s2 = 0.2;
  double tilt_rad = 0.17;  // of gravity in the world
};

// Fixed-lag smoother over the last states: Gauss-Newton over the window, the oldest state
// marginalised exactly (at its linearisation) into a Gaussian prior on the next. The direction of
// gravity in the world is estimated with the states. A first attitude that was off by some degrees
// is then not taken for a bias of the accelerometer. Plain values throughout: bounded memory,
// written and read bit for bit. Not thread-safe.
class WindowSmoother {
 public:
  struct Config {
    int window = 15;
    int iterations = 2;
    ImuNoiseConfig imu;
  };

  explicit WindowSmoother(const Config& config) : config_(config) {}

  // Starts with one state. `up_in_world`: unit vector against gravity.
  void start(const ImuState& state, const Eigen::Vector3d& up_in_world,
             const InitialUncertainty& sigma);
  [[nodiscard]] bool started() const { return !states_.empty(); }

  // Adds the state at the end of `interval`, predicted, with an optional lidar factor, and
  // optimises.
  void add(TimeNs stamp, const MotionInterval& interval, const std::optional<PoseFactor>& lidar);

  [[nodiscard]] const ImuState& latest() const { return states_.back(); }
  [[nodiscard]] const std::vector<ImuState>& states() const { return states_; }
  // Marginal covariance of the latest state, and of the tilt of gravity (2 x 2, rad^2).
  [[nodiscard]] const Matrix15d& covariance() const { return covariance_; }
  [[nodiscard]] const Eigen::Matrix2d& tilt_covariance() const { return tilt_covariance_; }
  // Gravity in the world, m/s^2, pointing down.
  [[nodiscard]] Eigen::Vector3d gravity() const;
  // Sets the direction of gravity (before any factor has told about it).
  void set_up(const Eigen::Vector3d& up_in_world);

  // Moves all states, factors and the direction of gravity to another world.
  void move_world(const Pose& new_from_old);

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  // Normal equations of the window: block tridiagonal in the states, bordered by the gravity.
  struct System;
  // Gaussian on the oldest state and gravity: cost 1/2 d^T information d - vector^T d with
  // d = (local(point, state), tilt difference).
  struct Prior {
    ImuState point;
    Eigen::Quaterniond gravity_rotation = Eigen::Quaterniond::Identity();
    Eigen::Matrix<double, 17, 17> information = Eigen::Matrix<double, 17, 17>::Zero();
    Eigen::Matrix<double, 17, 1> vector = Eigen::Matrix<double, 17, 1>::Zero();
  };

  [[nodiscard]] System linearise() const;
  void add_prior(System& system) const;
  void add_interval(System& system, std::size_t k) const;
  void add_lidar(System& system, std::size_t k) const;
  void optimise(int iterations);
  void reintegrate();
  void marginalise_oldest();

  Config config_;
  std::vector<ImuState> states_;
  std::vector<MotionInterval> intervals_;  // intervals_[k] leads from states_[k] to states_[k + 1]
  std::vector<std::optional<PoseFactor>> lidar_;                          // one per state
  Eigen::Quaterniond gravity_rotation_ = Eigen::Quaterniond::Identity();  // up = rotation * z
  Prior prior_;
  Matrix15d covariance_ = Matrix15d::Zero();
  Eigen::Matrix2d tilt_covariance_ = Eigen::Matrix2d::Zero();
  std::uint64_t added_ = 0;  // states ever
};

}  // namespace understory
