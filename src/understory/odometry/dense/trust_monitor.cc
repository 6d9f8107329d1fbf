#include "understory/odometry/dense/trust_monitor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "understory/geometry/best_rotation.h"
#include "understory/odometry/odometry_constants.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

using namespace odometry_constants::trust_monitor;

// What is left of the turns' squares if the gyroscope's axes are turned by `lidar_from_gyro`. A
// constant difference may be its bias, up to what a bias can be, and is taken out.
struct TurnSums {
  const Eigen::Matrix3d& product;  // sum of gyro * lidar^T
  const Eigen::Vector3d& lidar;
  const Eigen::Vector3d& gyro;
  double lidar_square;
  double gyro_square;
  double count;
  double largest_bias;  // radians per turn
};

double unexplained(const TurnSums& sums, const Eigen::Matrix3d& lidar_from_gyro) {
  Eigen::Vector3d bias = (sums.gyro - lidar_from_gyro.transpose() * sums.lidar) / sums.count;
  if (bias.norm() > sums.largest_bias) bias *= sums.largest_bias / bias.norm();
  const Eigen::Matrix3d product = sums.product - bias * sums.lidar.transpose();
  const double gyro_square =
      sums.gyro_square - 2.0 * bias.dot(sums.gyro) + sums.count * bias.squaredNorm();
  return sums.lidar_square + gyro_square - 2.0 * (lidar_from_gyro * product).trace();
}

// One way in which the axes might be turned, and how it reads: "x=+y y=-x z=+z".
struct AxesGuess {
  double left = 1e300;
  std::string text;
};

AxesGuess best_axes(const TurnSums& sums) {
  const std::array<const char*, 3> names{"x", "y", "z"};
  std::array<std::size_t, 3> order{0, 1, 2};
  AxesGuess best;
  do {
    for (unsigned signs = 0; signs < 8; ++signs) {
      Eigen::Matrix3d turn = Eigen::Matrix3d::Zero();
      std::string text;
      for (std::size_t row = 0; row < 3; ++row) {
        const bool minus = (signs >> row & 1U) != 0;
        turn(static_cast<int>(row), static_cast<int>(order[row])) = minus ? -1.0 : 1.0;
        text += std::string(row > 0 ? " " : "") + names[row] + (minus ? "=-" : "=+") +
                names[order[row]];
      }
      const double left = unexplained(sums, turn);
      if (left < best.left) best = {left, text};
    }
  } while (std::next_permutation(order.begin(), order.end()));
  return best;
}

// The best rotation (Kabsch), with the common part in the data or taken out as a bias.
Eigen::Matrix3d best_turn(const TurnSums& sums, bool centred) {
  Eigen::Matrix3d product = sums.product;
  if (centred) product -= sums.gyro * sums.lidar.transpose() / sums.count;
  return best_rotation(product).rotation.transpose();
}

std::string degrees(double radians) {
  return std::to_string(static_cast<int>(std::lround(radians / kDegree)));
}

std::string two_decimals(double value) {
  const std::string text = std::to_string(value);
  return text.substr(0, text.find('.') + 3);
}

}  // namespace

void TrustMonitor::distrust(const std::string& reason, bool usable) {
  if (!trust_.trusted) return;
  trust_.trusted = false;
  trust_.usable = usable;
  trust_.reason = reason;
}

void TrustMonitor::join_anew() {
  joined_lidar_.setIdentity();
  joined_gyro_.setIdentity();
  joined_time_ = 0.0;
}

void TrustMonitor::begin_anew() {
  join_anew();
  product_.setZero();
  lidar_sum_.setZero();
  gyro_sum_.setZero();
  force_world_.setZero();
  force_imu_.setZero();
  directions_world_.setZero();
  lidar_turning_ = gyro_turning_ = 0.0;
  lidar_square_ = gyro_square_ = turn_time_ = total_angle_ = force_time_ = length_sum_ = 0.0;
  turns_ = seconds_ = 0;
}

void TrustMonitor::vouch_until(TimeNs until) {
  vouched_until_ = until;
  was_on_probation_ = true;
  standing_ = Standing::kProven;
  trust_.proven = true;
}

void TrustMonitor::suspect(TimeNs now) {
  if (vouched_for(now)) return;
  if (was_on_probation_) {
    return distrust(
        "the gyroscope agrees with the lidar, and the accelerometer does not: its axes look "
        "swapped or its scale wrong",
        force_spread() < kSuspectSpread);
  }
  if (standing_ != Standing::kUnproven || !trust_.trusted) return;
  standing_ = Standing::kOnProbation;
  now_ = probation_since_ = now;
  begin_anew();
}

void TrustMonitor::pass_time(TimeNs now) {
  const TimeNs before = std::exchange(now_, now);
  if (!on_probation()) return;
  trust_.doubted_s += to_seconds(now - before);
  if (to_seconds(now - probation_since_) > kLongestProbationS) {
    standing_ = Standing::kUnproven;
    begin_anew();
  }
}

void TrustMonitor::add_turn(const Eigen::Vector3d& by_lidar, const Eigen::Vector3d& by_gyro,
                            double gyro_turning, double duration_s) {
  if (vouched_for(now_)) return;
  if (!on_probation()) return take_turn(by_lidar, by_gyro, duration_s);
  lidar_turning_ += by_lidar.norm();
  gyro_turning_ += gyro_turning;
  joined_lidar_ = (joined_lidar_ * so3_exp(by_lidar)).normalized();
  joined_gyro_ = (joined_gyro_ * so3_exp(by_gyro)).normalized();
  joined_time_ += duration_s;
  if (joined_time_ < kProbationTurnS) return;
  const Eigen::Vector3d lidar = so3_log(joined_lidar_);
  const Eigen::Vector3d gyro = so3_log(joined_gyro_);
  const double time = joined_time_;
  join_anew();
  take_turn(lidar, gyro, time);
}

void TrustMonitor::take_turn(const Eigen::Vector3d& by_lidar, const Eigen::Vector3d& by_gyro,
                             double duration_s) {
  const double angle = std::max(by_lidar.norm(), by_gyro.norm());
  if (angle < kSmallestTurn) return;
  product_ += by_gyro * by_lidar.transpose();
  lidar_square_ += by_lidar.squaredNorm();
  gyro_square_ += by_gyro.squaredNorm();
  lidar_sum_ += by_lidar;
  gyro_sum_ += by_gyro;
  turn_time_ += duration_s;
  total_angle_ += angle;
  ++turns_;
  if (trust_.trusted && turns_ >= kEnoughTurns && total_angle_ > kEnoughTurning) judge_turns();
}

void TrustMonitor::judge_turns() {
  const TurnSums sums{product_,
                      lidar_sum_,
                      gyro_sum_,
                      lidar_square_,
                      gyro_square_,
                      static_cast<double>(turns_),
                      kLargestBias * turn_time_ / turns_};
  const double all = std::max(lidar_square_, gyro_square_);
  const double left = unexplained(sums, Eigen::Matrix3d::Identity());
  const double good = on_probation() ? kGoodOnProbation : kGood;
  const double limit = good * good * all;
  Eigen::Matrix3d rotation = best_turn(sums, false);
  const Eigen::Matrix3d centred = best_turn(sums, true);
  if (unexplained(sums, centred) < unexplained(sums, rotation)) rotation = centred;
  // Where most turns are about the vertical, an IMU turned about it explains most of them. Once it
  // is suspected, a turn that explains them much better is enough.
  const bool turned = on_probation() && Eigen::AngleAxisd(rotation).angle() > kSurelyTurned &&
                      unexplained(sums, rotation) < kMuchBetter * left;
  if (left < kBad * kBad * all && !turned) {
    // On probation the accelerometer has to prove itself, too.
    if (left < limit && (!on_probation() || seconds_ >= kEnoughForProbation)) {
      was_on_probation_ = on_probation();
      standing_ = Standing::kProven;
      trust_.proven = true;
    }
    return;
  }
  const AxesGuess axes = best_axes(sums);
  std::string cause;
  bool explained = true;
  if (lidar_turning_ > kEnoughTurning && gyro_turning_ > kLooksLikeDegrees * lidar_turning_) {
    cause = ". Its rates look like degrees per second";
  } else if (axes.left < limit && axes.left < kAsGood * unexplained(sums, rotation)) {
    cause = ". Its axes look swapped: to agree with the lidar they would be " + axes.text;
  } else if (unexplained(sums, rotation) < limit) {
    cause = ". The IMU looks mounted about " + degrees(Eigen::AngleAxisd(rotation).angle()) +
            " degrees from where its extrinsics say";
  } else if (standing_ == Standing::kUnproven) {
    return suspect(now_);
  } else if (total_angle_ < kEnoughUnexplained) {
    return;
  } else {
    // A lidar that positions itself alone and is contradicted all the same: the IMU is of no use.
    explained = on_probation();
    cause = ". No other orientation of its axes explains it";
  }
  distrust("gyroscope and lidar disagree on how the sensor turned (" +
               std::to_string(static_cast<int>(std::lround(100.0 * std::sqrt(left / all)))) +
               " % unexplained over " + degrees(total_angle_) + " degrees of turning)" + cause,
           !explained);
}

void TrustMonitor::add_force(const Eigen::Quaterniond& world_from_imu,
                             const Eigen::Vector3d& force_in_imu, double duration_s) {
  if (vouched_for(now_)) return;
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
  if (trust_.trusted && seconds_ >= kEnoughForLength) judge_forces();
}

// Root mean square angle from the mean direction, from the length of the mean unit vector.
double TrustMonitor::force_spread() const {
  if (seconds_ == 0) return 0.0;
  return std::sqrt(std::max(0.0, 2.0 - 2.0 * directions_world_.norm() / seconds_));
}

void TrustMonitor::judge_forces() {
  const double length = length_sum_ / seconds_;
  if (std::abs(length - gravity_) > kLengthTolerance * gravity_) {
    distrust("mean specific force is " + two_decimals(length) + " m/s^2 instead of " +
                 two_decimals(gravity_) + ": wrong unit, gravity taken out, or scale",
             false);
    return;
  }
  if (seconds_ < (on_probation() ? kEnoughForProbation : kEnoughSeconds)) return;
  const double spread = force_spread();
  if (spread > kForceSpread)
    distrust("gravity as the accelerometer measures it swings by " + degrees(spread) +
                 " degrees in the world: its axes do not fit the lidar's attitude",
             !on_probation());
}

void TrustMonitor::save(BinaryWriter& writer) const {
  writer.put(trust_.trusted);
  writer.put(trust_.reason);
  writer.put(trust_.usable);
  writer.put(trust_.proven);
  writer.put(trust_.doubted_s);
  writer.put(vouched_until_);
  writer.put(standing_);
  writer.put(was_on_probation_);
  writer.put_doubles(joined_lidar_.coeffs().data(), 4);
  writer.put_doubles(joined_gyro_.coeffs().data(), 4);
  writer.put(joined_time_);
  writer.put(now_);
  writer.put(probation_since_);
  writer.put_doubles(product_.data(), 9);
  for (const double value :
       {lidar_square_, gyro_square_, turn_time_, total_angle_, lidar_turning_, gyro_turning_})
    writer.put(value);
  writer.put(turns_);
  for (const auto* v : {&force_world_, &force_imu_, &directions_world_, &lidar_sum_, &gyro_sum_})
    writer.put_doubles(v->data(), 3);
  writer.put(force_time_);
  writer.put(length_sum_);
  writer.put(seconds_);
}

void TrustMonitor::load(BinaryReader& reader) {
  trust_.trusted = reader.get<bool>();
  trust_.reason = reader.get_string();
  trust_.usable = reader.get<bool>();
  trust_.proven = reader.get<bool>();
  trust_.doubted_s = reader.get<double>();
  vouched_until_ = reader.get<TimeNs>();
  standing_ = reader.get_enum(Standing::kProven);
  was_on_probation_ = reader.get<bool>();
  reader.get_doubles(joined_lidar_.coeffs().data(), 4);
  reader.get_doubles(joined_gyro_.coeffs().data(), 4);
  joined_time_ = reader.get<double>();
  now_ = reader.get<TimeNs>();
  probation_since_ = reader.get<TimeNs>();
  reader.get_doubles(product_.data(), 9);
  for (double* value :
       {&lidar_square_, &gyro_square_, &turn_time_, &total_angle_, &lidar_turning_, &gyro_turning_})
    *value = reader.get<double>();
  turns_ = reader.get<int>();
  for (auto* v : {&force_world_, &force_imu_, &directions_world_, &lidar_sum_, &gyro_sum_})
    reader.get_doubles(v->data(), 3);
  force_time_ = reader.get<double>();
  length_sum_ = reader.get<double>();
  seconds_ = reader.get<int>();
}

}  // namespace understory
