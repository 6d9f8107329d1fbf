#include <algorithm>
#include <numbers>

#include "understory/odometry/motion/motion_model.h"

#include "understory/geometry/symmetric_solver.h"

namespace understory {
namespace {

void describe_lidar(ConfigTable& table, LidarNoiseConfig& config) {
  table.add_enum("source", config.source,
                 {{"fitness", LidarNoise::kFitness},
                  {"information", LidarNoise::kInformation},
                  {"both", LidarNoise::kBoth}},
                 "covariance of a lidar factor: from the fitness, from the matcher's information "
                 "matrix, or from the matrix with that of the fitness as a floor");
  table.add("sigma_rotation_deg", config.sigma_rotation_deg, {1e-4, 10.0}, "deg",
            "standard deviation of one match at good fitness");
  table.add("sigma_translation_m", config.sigma_translation_m, {1e-5, 10.0}, "m",
            "standard deviation of one match at good fitness");
  table.add("fitness_threshold_m2", config.fitness_threshold_m2, {0.0, 100.0}, "m^2",
            "mean squared distance above which the standard deviation grows; 0: as the method of "
            "matching needs it");
  table.add("fitness_scale", config.fitness_scale, {0.0, 1e6}, "1/m^4",
            "growth of that standard deviation with the square of the excess; 0: as the method of "
            "matching needs it");
  table.add("information_divisor", config.information_divisor, {1.0, 1e9}, "",
            "divisor of the matcher's information, because its points are not independent");
}

void describe_imu(ConfigTable& table, ImuNoiseConfig& config) {
  table.add("gyro_noise_rad_s_sqrt_hz", config.gyro_noise_rad_s_sqrt_hz, {1e-8, 1.0},
            "rad/s/sqrt(Hz)", "white noise of the gyroscope");
  table.add("accel_noise_m_s2_sqrt_hz", config.accel_noise_m_s2_sqrt_hz, {1e-7, 10.0},
            "m/s^2/sqrt(Hz)", "white noise of the accelerometer, vibration included");
  table.add("gyro_bias_walk_rad_s2_sqrt_hz", config.gyro_bias_walk_rad_s2_sqrt_hz, {1e-9, 1.0},
            "rad/s^2/sqrt(Hz)", "random walk of the gyroscope's bias");
  table.add("accel_bias_walk_m_s3_sqrt_hz", config.accel_bias_walk_m_s3_sqrt_hz, {1e-8, 10.0},
            "m/s^3/sqrt(Hz)", "random walk of the accelerometer's bias");
  table.add("gyro_bias_sigma_rad_s", config.gyro_bias_sigma_rad_s, {1e-6, 1.0}, "rad/s",
            "standard deviation of the gyroscope's bias at switch-on");
  table.add("accel_bias_sigma_m_s2", config.accel_bias_sigma_m_s2, {1e-5, 10.0}, "m/s^2",
            "standard deviation of the accelerometer's bias at switch-on");
  table.add("gravity_m_s2", config.gravity_m_s2, {9.7, 9.9}, "m/s^2", "magnitude of gravity");
  table.add("gyro_range_deg_s", config.gyro_range_deg_s, {1.0, 1e5}, "deg/s",
            "larger rates are saturated and dropped");
  table.add("accel_range_m_s2", config.accel_range_m_s2, {1.0, 1e5}, "m/s^2",
            "larger accelerations are saturated and dropped");
  table.add(
      "max_gap_s", config.max_gap_s, {0.001, 1.0}, "s",
      "longest gap between IMU samples that is bridged; over longer ones velocity is constant");
}

void describe_gate(ConfigTable& table, MotionConfig& config) {
  table.add("velocity_gate_m_s", config.velocity_gate_m_s, {0.0, 1000.0}, "m/s",
            "a match that changes the velocity by more is dropped; 0 turns the gates off");
  table.add("angular_gate_deg_s", config.angular_gate_deg_s, {0.0, 1e5}, "deg/s",
            "a match that turns faster than this against the prediction is dropped; 0 turns the "
            "gate off");
  table.add_enum("velocity_gate_reference", config.velocity_gate_reference,
                 {{"prediction", VelocityGateReference::kPrediction},
                  {"previous", VelocityGateReference::kPreviousState}},
                 "what the velocity is compared to: the IMU's prediction, or the last state");
  table.add("velocity_gate_patience", config.velocity_gate_patience, {0, 1000}, "",
            "matches dropped in a row after which the next one is used");
}

}  // namespace

void describe(ConfigTable& table, MotionConfig& config) {
  table.add_enum("method", config.method,
                 {{"fixed_lag", SmootherMethod::kFixedLag}, {"isam2", SmootherMethod::kIsam2}},
                 "smoother of the states at scan rate");
  table.add("window", config.window, {2, 200}, "states", "length of the fixed lag");
  table.add("iterations", config.iterations, {1, 20}, "", "Gauss-Newton steps per scan");
  table.add("isam2_restart", config.isam2_restart, {2, 10000}, "states",
            "iSAM2 starts anew from its marginals after this many states");
  table.section("imu", [&] { describe_imu(table, config.imu); });
  table.section("lidar", [&] { describe_lidar(table, config.lidar); });
  describe_gate(table, config);
  table.add("level_world", config.level_world,
            "level the world once in the first seconds, when the vertical is known");
  table.add("covariance_from_residuals", config.covariance_from_residuals,
            "state covariances at the size that residuals between matches and IMU speak for");
  table.add("motion_accel_sigma_m_s2", config.motion_accel_sigma_m_s2, {1e-3, 1e3},
            "m/s^2/sqrt(Hz)", "acceleration of the carrier where no IMU measures it");
  table.add("motion_angular_accel_sigma_rad_s2", config.motion_angular_accel_sigma_rad_s2,
            {1e-3, 1e3}, "rad/s^2/sqrt(Hz)",
            "angular acceleration of the carrier where no IMU measures it");
}

Matrix6d lidar_covariance(const LidarFactor& factor, const LidarNoiseConfig& config) {
  if (factor.covariance) return *factor.covariance;
  // P4 (36), with the printed form's "low fitness" read as a large mean squared distance.
  const double excess = std::max(0.0, factor.fitness_m2 - config.fitness_threshold_m2);
  const double growth = 1.0 + config.fitness_scale * excess * excess;
  const double rotation = growth * config.sigma_rotation_deg * std::numbers::pi / 180.0;
  const double translation = growth * config.sigma_translation_m;
  Vector6d floor;
  floor << Eigen::Vector3d::Constant(rotation * rotation),
      Eigen::Vector3d::Constant(translation * translation);
  Matrix6d covariance = floor.asDiagonal();
  if (config.source == LidarNoise::kFitness) return covariance;

  // Inverse of the information with weak directions cut off at 1 rad and 1 km.
  Matrix6d information = factor.information / config.information_divisor;
  information.diagonal().head<3>().array() += 1.0;
  information.diagonal().tail<3>().array() += 1e-6;
  const Matrix6d matched = SymmetricSolver<6>(information).inverse();
  const Matrix6d symmetric = 0.5 * (matched + matched.transpose());
  if (config.source == LidarNoise::kBoth) return covariance + symmetric;
  covariance.setZero();
  // Alone it still needs a floor, or a dense cloud would claim micrometres.
  covariance.diagonal() << Eigen::Vector3d::Constant(1e-8), Eigen::Vector3d::Constant(1e-6);
  return covariance + symmetric;
}

}  // namespace understory
