#include "understory/calibration/lidar_imu/online_calibration.h"

#include <algorithm>
#include <cmath>

#include "understory/calibration/calibration_constants.h"
#include "understory/geometry/large_solvers.h"
#include "understory/geometry/pose_io.h"
#include "understory/geometry/symmetric_eigen.h"
#include "understory/util/error.h"

namespace understory {

using namespace calibration_constants::online_calibration;

namespace {

using Vector7 = Eigen::Matrix<double, 7, 1>;
using Matrix7 = Eigen::Matrix<double, 7, 7>;

// What counts as told: the limits of `calibrate_lidar_imu`.
Vector7 units() {
  using namespace calibration_constants::lidar_imu_calibration;
  Vector7 units;
  units << Eigen::Vector3d::Constant(kMostRotation), Eigen::Vector3d::Constant(kMostPlaceM),
      kMostLatenessSdS;
  return units;
}

// Inverse of a covariance in these units. What is kept as given has none to speak of, and tells
// nothing: its information is zero.
Matrix7 told_by(const Matrix7& covariance) {
  const Vector7 scale = units().cwiseInverse();
  const Matrix7 scaled = scale.asDiagonal() * covariance * scale.asDiagonal();
  const SymmetricEigen7 axes = symmetric_eigen(scaled);
  Matrix7 information = Matrix7::Zero();
  for (Eigen::Index k = 0; k < 7; ++k) {
    if (axes.values[k] < kKeptVariance) continue;
    const Vector7 axis = axes.vectors.col(k);
    information += axis * axis.transpose() / axes.values[k];
  }
  return information;
}

// Whether `step` is farther from none than chance explains, and than `least`; directions without a
// variance are not asked.
bool far_from_none(double step, double variance, double least) {
  const double sd = std::sqrt(std::max(variance, 0.0));
  return sd > 0.0 && std::abs(step) > std::max(kTakeSigmas * sd, least);
}

bool far_from_none(const Eigen::Vector3d& step, const Eigen::Matrix3d& covariance, double least) {
  const SymmetricEigen3 axes = symmetric_eigen(covariance);
  for (Eigen::Index k = 0; k < 3; ++k)
    if (far_from_none(axes.vectors.col(k).dot(step), axes.values[k], least)) return true;
  return false;
}

}  // namespace

void OnlineImuCalibration::add_sample(const ImuSample& sample) {
  imu_.add(sample);
  newest_sample_ = std::max(newest_sample_, sample.stamp);
  if (window_.empty()) imu_.forget_before(newest_sample_ - from_seconds(kMarginS));
}

void OnlineImuCalibration::add_scan(const StampedPose& world_from_body_at_middle,
                                    const Pose& given) {
  given_ = given;
  window_.push_back(world_from_body_at_middle);
  const auto is_long = [this] {
    return !window_.empty() &&
           to_seconds(window_.back().stamp - window_.front().stamp) >= kFitWindowS + kMarginS;
  };
  if (is_long()) end_window();
  if (is_long()) window_.clear();  // an IMU that has stopped
}

void OnlineImuCalibration::move_world(const Pose& new_world_from_old_world) {
  for (StampedPose& pose : window_)
    pose.world_from_body = new_world_from_old_world * pose.world_from_body;
}

void OnlineImuCalibration::break_off() {
  end_window();
  window_.clear();
}

// The samples of the IMU must reach beyond the poses at any lateness: the last poses begin the next
// window.
void OnlineImuCalibration::end_window() {
  const TimeNs covered = newest_sample_ - from_seconds(kMarginS);
  const auto end = std::find_if(window_.begin(), window_.end(),
                                [&](const StampedPose& pose) { return pose.stamp > covered; });
  const std::vector<StampedPose> path(window_.begin(), end);
  window_.erase(window_.begin(), end);
  if (path.size() < 2) return;
  const LidarImuResult found = calibrate_lidar_imu(path, imu_, given_, 0.0);
  imu_.forget_before(path.back().stamp - from_seconds(kMarginS));
  if (!found.problem.empty()) return;
  const Matrix7d information = told_by(kWindowsAreWorse * found.covariance);
  if (information.isZero(0.0)) return;
  Vector7d step;
  step << so3_log(given_.rotation().conjugate() * found.lidar_from_imu.rotation()),
      found.lidar_from_imu.translation() - given_.translation(), found.imu_late_s;
  information_ += information;
  weighted_ += information * step.cwiseQuotient(units());
  duration_s_ += found.duration_s;
  ++windows_;
}

std::optional<OnlineImuEstimate> OnlineImuCalibration::so_far() const {
  if (windows_ == 0) return std::nullopt;
  OnlineImuEstimate estimate;
  const SymmetricEigen7 axes = symmetric_eigen(information_);
  Matrix7d covariance = Matrix7d::Zero();
  for (Eigen::Index k = 0; k < 7; ++k) {
    if (axes.values[k] < 1.0) continue;  // not told
    const Vector7d axis = axes.vectors.col(k);
    covariance += axis * axis.transpose() / axes.values[k];
  }
  const Vector7d step = (covariance * weighted_).cwiseProduct(units());
  estimate.covariance = units().asDiagonal() * covariance * units().asDiagonal();
  estimate.body_from_imu = Pose(given_.rotation() * so3_exp(Eigen::Vector3d(step.head<3>())),
                                given_.translation() + step.segment<3>(3));
  estimate.late_s = step[6];
  estimate.duration_s = duration_s_;
  estimate.windows = windows_;
  estimate.differs = far_from_none(Eigen::Vector3d(step.head<3>()),
                                   estimate.covariance.topLeftCorner<3, 3>(), kTakeTurnRad) ||
                     far_from_none(Eigen::Vector3d(step.segment<3>(3)),
                                   estimate.covariance.block<3, 3>(3, 3), kTakePlaceM) ||
                     far_from_none(step[6], estimate.covariance(6, 6), kTakeLatenessS);
  return estimate;
}

std::optional<OnlineImuEstimate> OnlineImuCalibration::finished() const {
  OnlineImuCalibration all = *this;
  all.end_window();
  return all.so_far();
}

void OnlineImuCalibration::save(BinaryWriter& writer) const {
  imu_.save(writer);
  writer.put(static_cast<std::uint64_t>(window_.size()));
  for (const StampedPose& pose : window_)
    put_stamped_pose(writer, pose);
  put_pose(writer, given_);
  writer.put(newest_sample_);
  writer.put(std::vector<double>(information_.data(), information_.data() + information_.size()));
  writer.put(std::vector<double>(weighted_.data(), weighted_.data() + weighted_.size()));
  writer.put(duration_s_);
  writer.put(static_cast<std::uint64_t>(windows_));
}

void OnlineImuCalibration::load(BinaryReader& reader) {
  imu_.load(reader);
  window_.clear();
  for (auto count = reader.get<std::uint64_t>(); count > 0; --count)
    window_.push_back(get_stamped_pose(reader));
  given_ = get_pose(reader);
  newest_sample_ = reader.get<TimeNs>();
  const auto information = reader.get_vector<double>();
  const auto weighted = reader.get_vector<double>();
  UNDERSTORY_CHECK(information.size() == 49 && weighted.size() == 7);
  information_ = Eigen::Map<const Matrix7d>(information.data());
  weighted_ = Eigen::Map<const Vector7d>(weighted.data());
  duration_s_ = reader.get<double>();
  windows_ = static_cast<std::size_t>(reader.get<std::uint64_t>());
}

}  // namespace understory
