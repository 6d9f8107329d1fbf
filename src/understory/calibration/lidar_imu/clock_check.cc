#include "understory/calibration/lidar_imu/clock_check.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "understory/calibration/calibration_constants.h"
#include "understory/calibration/lidar_imu/coloured_fit.h"
#include "understory/geometry/large_solvers.h"
#include "understory/geometry/pose.h"
#include "understory/geometry/symmetric_solver.h"

namespace understory {

using namespace calibration_constants::clock_check;

namespace {

using Eigen::Vector3d;

constexpr Eigen::Index kBiasParameter = 7;
constexpr Eigen::Index kBendParameter = 34;

Vector3d vector_of(const std::array<double, 3>& values) {
  return {values[0], values[1], values[2]};
}

std::array<double, 3> array_of(const Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}

Eigen::Quaterniond quaternion_of(const std::array<double, 4>& xyzw) {
  return {xyzw[3], xyzw[0], xyzw[1], xyzw[2]};
}

std::array<double, 4> array_of(const Eigen::Quaterniond& q) {
  return {q.x(), q.y(), q.z(), q.w()};
}

// Weak knowledge beside the run, as `calibrate_lidar_imu` has it. Parameters that turns say nothing
// of are held.
LidarImuMatrix weak_information() {
  using namespace calibration_constants::lidar_imu_calibration;
  LidarImuStep sd = LidarImuStep::Ones();
  sd.head<3>().setConstant(kGivenRotation);
  sd[kLatenessParameter] = kGivenLatenessS;
  sd.segment<3>(kBiasParameter).setConstant(kGivenGyroBias);
  sd[kBendParameter] = kGivenBend;
  return sd.cwiseAbs2().cwiseInverse().asDiagonal();
}

}  // namespace

bool ClockCheckResult::clock_is_off() const {
  return std::abs(late_s) > std::max(kTellLatenessS, kTellSigmas * late_sd_s);
}

bool ClockCheckResult::axes_are_off() const {
  return turned_sd_rad > 0.0 && turned_rad > std::max(kTellTurnRad, kTellSigmas * turned_sd_rad);
}

void LidarImuClockCheck::add_sample(const ImuSample& sample) {
  imu_.add(sample);
  imu_.forget_before(sample.stamp - from_seconds(kMemoryS));  // where no scan comes
}

void LidarImuClockCheck::add_scan(TimeNs stamp, TimeNs end,
                                  const Eigen::Quaterniond& world_from_body,
                                  const Eigen::Quaterniond& body_from_imu) {
  // The samples reach to the middle of the scan before, not to that of this one.
  if (seen_.size() == 2) {
    if (const std::optional<Step> next = step(seen_[0], seen_[1])) {
      current_.push_back(*next);
    } else {
      keep();
    }
    if (current_.size() == kStretchSteps) keep();
    seen_.erase(seen_.begin());
  }
  seen_.push_back({stamp, stamp + (end - stamp) / 2, array_of(world_from_body * body_from_imu)});
  imu_.forget_before(seen_.front().stamp - from_seconds(kRateWindowS));
}

void LidarImuClockCheck::turn_world(const Eigen::Quaterniond& new_world_from_old_world) {
  for (Seen& scan : seen_)
    scan.world_from_imu = array_of(new_world_from_old_world * quaternion_of(scan.world_from_imu));
}

void LidarImuClockCheck::break_off() {
  seen_.clear();
  keep();
}

std::optional<Vector3d> LidarImuClockCheck::rate_at(TimeNs stamp) const {
  const TimeNs half = from_seconds(kRateWindowS);
  const auto samples = imu_.slice(stamp - half, stamp + half);
  if (samples.size() < 2) return std::nullopt;
  const Preintegration motion =
      preintegrate(samples, Vector3d::Zero(), Vector3d::Zero(), ImuNoiseConfig());
  return so3_log(motion.rotation) / motion.duration;
}

std::optional<LidarImuClockCheck::Step> LidarImuClockCheck::step(const Seen& from,
                                                                 const Seen& to) const {
  const double duration_s = to_seconds(to.stamp - from.stamp);
  if (!(duration_s > 0.0 && duration_s < kLongestCheckedStepS)) return std::nullopt;
  const auto samples = imu_.slice(from.stamp, to.stamp);
  const auto rate_before = rate_at(from.middle);
  const auto rate_after = rate_at(to.middle);
  if (samples.size() < 2 || !rate_before || !rate_after) return std::nullopt;
  const Eigen::Quaterniond turn =
      preintegrate(samples, Vector3d::Zero(), Vector3d::Zero(), ImuNoiseConfig()).rotation;
  const Eigen::Quaterniond by_lidar =
      quaternion_of(from.world_from_imu).conjugate() * quaternion_of(to.world_from_imu);
  return Step{duration_s, array_of(so3_log(turn)), array_of(so3_log(turn.conjugate() * by_lidar)),
              array_of(Vector3d(*rate_after - turn.conjugate() * *rate_before)),
              array_of(Vector3d(quaternion_of(to.world_from_imu).conjugate() * Vector3d::UnitZ()))};
}

// Sum of squares of what a second of lateness changes.
double LidarImuClockCheck::strength(const Stretch& stretch) const {
  double sum = 0.0;
  for (const Step& one : stretch) {
    const Vector3d change = vector_of(one.rate_change);
    const double about_up = change.dot(vector_of(one.up));
    sum += turns_ == Turns::kAll ? change.squaredNorm() : about_up * about_up;
  }
  return sum;
}

// Puts the current stretch to those that are kept, where it tells more than one of them.
void LidarImuClockCheck::keep() {
  Stretch stretch = std::exchange(current_, {});
  if (stretch.size() < kFewestSteps) return;
  if (kept_.size() < kStretches) {
    kept_.push_back(std::move(stretch));
    return;
  }
  const auto weakest = std::min_element(
      kept_.begin(), kept_.end(),
      [this](const Stretch& a, const Stretch& b) { return strength(a) < strength(b); });
  if (strength(stretch) > strength(*weakest)) *weakest = std::move(stretch);
}

// What each step leaves unexplained, and how it changes with the parameters.
PathResiduals LidarImuClockCheck::residuals_of(const Stretch& stretch) const {
  const auto count = static_cast<Eigen::Index>(stretch.size());
  PathResiduals residuals;
  residuals.axes = turns_ == Turns::kAll ? 3 : 1;
  residuals.values.resize(residuals.axes * count);
  residuals.by_step.setZero(residuals.axes * count, kLidarImuParameters);
  const auto rate = [&](Eigen::Index k) {
    const Step& one = stretch[static_cast<std::size_t>(std::clamp<Eigen::Index>(k, 0, count - 1))];
    return Vector3d(vector_of(one.turn) / one.duration_s);
  };
  // Bends of the scans before and behind the step, see LidarImuState.
  const auto bend = [&](Eigen::Index scan) {
    return Vector3d(rate(scan + 1) - rate(scan) - rate(scan - 1) + rate(scan - 2));
  };
  for (Eigen::Index k = 0; k < count; ++k) {
    const Step& one = stretch[static_cast<std::size_t>(k)];
    Eigen::Matrix<double, 3, kLidarImuParameters> rows;
    rows.setZero();
    rows.leftCols<3>() = skew(vector_of(one.turn));
    rows.col(kLatenessParameter) = -vector_of(one.rate_change);
    rows.middleCols<3>(kBiasParameter) = one.duration_s * Eigen::Matrix3d::Identity();
    rows.col(kBendParameter) = -0.5 * one.duration_s * (bend(k + 1) - bend(k));
    const Vector3d difference = vector_of(one.difference);
    if (turns_ == Turns::kAll) {
      residuals.values.segment<3>(3 * k) = difference;
      residuals.by_step.middleRows<3>(3 * k) = rows;
    } else {
      const Vector3d up = vector_of(one.up);
      residuals.values[k] = up.dot(difference);
      residuals.by_step.row(k) = up.transpose() * rows;
    }
  }
  return residuals;
}

std::optional<ClockCheckResult> LidarImuClockCheck::result() const {
  LidarImuClockCheck all = *this;
  all.keep();
  ClockCheckResult found;
  NormalEquations equations;
  for (const Stretch& stretch : all.kept_) {
    for (const Step& one : stretch)
      found.duration_s += one.duration_s;
    add_coloured(residuals_of(stretch), equations);
  }
  if (found.duration_s < kShortestCheckedS) return std::nullopt;
  equations.information += weak_information();
  const LargeSymmetricSolver solver(equations.information);
  const LidarImuMatrix covariance =
      calibration_constants::lidar_imu_calibration::kPathsAreWorse * solver.inverse();
  const LidarImuStep step = -solver.solve(equations.gradient);
  found.late_s = step[kLatenessParameter];
  found.late_sd_s = std::sqrt(covariance(kLatenessParameter, kLatenessParameter));
  if (!(found.late_sd_s < kMostToldSdS)) return std::nullopt;
  if (turns_ == Turns::kAboutUp) return found;
  const Vector3d turned = step.head<3>();
  found.turned_rad = turned.norm();
  const Eigen::Matrix3d turns = covariance.topLeftCorner<3, 3>();
  const Vector3d axis = turned.stableNormalized();
  found.turned_sd_rad = 1.0 / std::sqrt(axis.dot(SymmetricSolver<3>(turns).solve(axis)));
  return found;
}

void LidarImuClockCheck::save(BinaryWriter& writer) const {
  imu_.save(writer);
  writer.put(seen_);
  writer.put(current_);
  writer.put(static_cast<std::uint64_t>(kept_.size()));
  for (const Stretch& stretch : kept_)
    writer.put(stretch);
}

void LidarImuClockCheck::load(BinaryReader& reader) {
  imu_.load(reader);
  seen_ = reader.get_vector<Seen>();
  current_ = reader.get_vector<Step>();
  kept_.clear();
  const auto count = reader.get<std::uint64_t>();
  for (std::uint64_t i = 0; i < count; ++i)
    kept_.push_back(reader.get_vector<Step>());
}

}  // namespace understory
