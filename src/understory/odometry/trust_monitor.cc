#include "understory/odometry/trust_monitor.h"

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

namespace understory {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
// A verdict on the axes needs this much turning in all, over turns that stand out from the noise of
// matching.
constexpr double kSmallestTurn = 0.3 * kDegree;
constexpr double kEnoughTurning = 30.0 * kDegree;
constexpr int kEnoughTurns = 10;
// Share of the turning that is unexplained: below kGood all is well; above kBad something is wrong.
constexpr double kBad = 0.4;
constexpr double kGood = 0.25;
// Gravity over whole seconds: walking and driving swing it by a few degrees.
constexpr int kEnoughSeconds = 10;
constexpr double kForceSpread = 15.0 * kDegree;
constexpr double kLengthTolerance = 0.15;

// The signed permutation of axes that explains the lidar's turns best, as the largest sum of the
// matching elements of the product matrix, and how it reads: "x=+y y=-x z=+z".
struct AxesGuess {
  double agreement = -1e300;
  std::string text;
};

AxesGuess best_axes(const Eigen::Matrix3d& product) {
  const std::array<const char*, 3> names{"x", "y", "z"};
  std::array<int, 3> order{0, 1, 2};
  AxesGuess best;
  do {
    double sum = 0.0;
    std::string text;
    for (int lidar = 0; lidar < 3; ++lidar) {
      const double element = product(order[static_cast<std::size_t>(lidar)], lidar);
      sum += std::abs(element);
      text += std::string(lidar > 0 ? " " : "") + names[static_cast<std::size_t>(lidar)] +
              (element < 0.0 ? "=-" : "=+") +
              names[static_cast<std::size_t>(order[static_cast<std::size_t>(lidar)])];
    }
    if (sum > best.agreement) best = {sum, text};
  } while (std::next_permutation(order.begin(), order.end()));
  return best;
}

std::string degrees(double radians) {
  return std::to_string(static_cast<int>(std::lround(radians / kDegree)));
}

}  // namespace

void TrustMonitor::distrust(const std::string& reason) {
  if (!trust_.trusted) return;
  trust_.trusted = false;
  trust_.reason = reason;
}

void TrustMonitor::add_turn(const Eigen::Vector3d& by_lidar, const Eigen::Vector3d& by_gyro) {
  const double angle = std::max(by_lidar.norm(), by_gyro.norm());
  if (angle < kSmallestTurn) return;
  product_ += by_gyro * by_lidar.transpose();
  lidar_square_ += by_lidar.squaredNorm();
  gyro_square_ += by_gyro.squaredNorm();
  error_square_ += (by_lidar - by_gyro).squaredNorm();
  total_angle_ += angle;
  ++turns_;
  if (trust_.trusted && turns_ >= kEnoughTurns && total_angle_ > kEnoughTurning) judge_turns();
}

void TrustMonitor::judge_turns() {
  const double all = std::max(lidar_square_, gyro_square_);
  if (error_square_ < kBad * kBad * all) return;
  // What would be left with the axes turned freely (Kabsch), or swapped and mirrored.
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(product_, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0) signs.z() = -1.0;
  const double sum = lidar_square_ + gyro_square_;
  const double left_turned = sum - 2.0 * svd.singularValues().dot(signs);
  const AxesGuess axes = best_axes(product_);
  const double left_swapped = sum - 2.0 * axes.agreement;
  const Eigen::Matrix3d lidar_from_gyro =
      svd.matrixV() * signs.asDiagonal() * svd.matrixU().transpose();
  const double limit = kGood * kGood * all;
  std::string cause = "; none of the ways to turn its axes explains it";
  if (left_swapped < limit) {
    axes_wrong_ = true;
    cause = "; its axes look swapped: to agree with the lidar they would be " + axes.text;
  } else if (left_turned < limit) {
    axes_wrong_ = true;
    cause = "; the IMU looks mounted " + degrees(Eigen::AngleAxisd(lidar_from_gyro).angle()) +
            " degrees from where its extrinsics say";
  }
  distrust("gyroscope and lidar disagree on how the sensor turned (" +
           std::to_string(static_cast<int>(std::lround(100.0 * std::sqrt(error_square_ / all)))) +
           " % unexplained over " + degrees(total_angle_) + " degrees of turning)" + cause);
}

void TrustMonitor::add_force(const Eigen::Quaterniond& world_from_imu,
                             const Eigen::Vector3d& force_in_imu, double duration_s) {
  force_world_ += world_from_imu * force_in_imu * duration_s;
  force_imu_ += force_in_imu * duration_s;
  force_time_ += duration_s;
  if (force_time_ < 1.0) return;
  const Eigen::Vector3d mean = force_world_ / force_time_;
  length_sum_ += mean.norm();
  if (mean.norm() > 0.0) directions_world_ += mean.normalized();
  ++seconds_;
  force_world_.setZero();
  force_imu_.setZero();
  force_time_ = 0.0;
  if (trust_.trusted && seconds_ >= kEnoughSeconds) judge_forces();
}

void TrustMonitor::judge_forces() {
  const double length = length_sum_ / seconds_;
  if (std::abs(length - gravity_) > kLengthTolerance * gravity_) {
    distrust("mean specific force is " + std::to_string(length) + " m/s^2 instead of " +
             std::to_string(gravity_) + ": wrong unit, gravity taken out, or scale");
    return;
  }
  // Root mean square angle from the mean direction, from the length of the mean unit vector.
  const double spread = std::sqrt(std::max(0.0, 2.0 - 2.0 * directions_world_.norm() / seconds_));
  if (spread > kForceSpread)
    distrust("gravity as the accelerometer sees it swings by " + degrees(spread) +
             " degrees in the world: its axes do not fit the lidar's attitude");
}

void TrustMonitor::save(BinaryWriter& writer) const {
  writer.put(trust_.trusted);
  writer.put(trust_.reason);
  writer.put(axes_wrong_);
  writer.put_doubles(product_.data(), 9);
  for (const double value : {lidar_square_, gyro_square_, error_square_, total_angle_})
    writer.put(value);
  writer.put(turns_);
  for (const auto* v : {&force_world_, &force_imu_, &directions_world_})
    writer.put_doubles(v->data(), 3);
  writer.put(force_time_);
  writer.put(length_sum_);
  writer.put(seconds_);
}

void TrustMonitor::load(BinaryReader& reader) {
  trust_.trusted = reader.get<bool>();
  trust_.reason = reader.get_string();
  axes_wrong_ = reader.get<bool>();
  reader.get_doubles(product_.data(), 9);
  for (double* value : {&lidar_square_, &gyro_square_, &error_square_, &total_angle_})
    *value = reader.get<double>();
  turns_ = reader.get<int>();
  for (auto* v : {&force_world_, &force_imu_, &directions_world_})
    reader.get_doubles(v->data(), 3);
  force_time_ = reader.get<double>();
  length_sum_ = reader.get<double>();
  seconds_ = reader.get<int>();
}

}  // namespace understory
