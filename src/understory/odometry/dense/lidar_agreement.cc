#include "understory/odometry/dense/lidar_agreement.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "understory/geometry/pose_io.h"
#include "understory/odometry/dense/scan_motion.h"
#include "understory/odometry/odometry_constants.h"

namespace understory {

using namespace odometry_constants::lidar_agreement;

bool LidarOffset::clock_is_off() const {
  return std::abs(late_s) > kLeastLateS && std::abs(late_s) > kSureClockSds * late_sd_s;
}

bool LidarOffset::place_is_off() const {
  return misplaced_m > kLeastMisplacedM && misplaced_m > kSurePlaceSds * misplaced_sd_m;
}

void LidarOffsetSums::add(const Vector6d& apart, const Vector6d& speed) {
  ++probes_;
  apart_ += apart;
  speed_ += speed;
  apart_squares_ += apart.cwiseAbs2();
  speed_squares_ += speed.cwiseAbs2();
  products_ += apart.cwiseProduct(speed);
}

std::optional<LidarOffset> LidarOffsetSums::offset(std::size_t lidar) const {
  if (probes_ < kFewestProbes) return std::nullopt;
  const double n = probes_;
  // Least squares of apart = constant - late * speed, one constant for each component.
  const double variation = (speed_squares_ - speed_.cwiseAbs2() / n).sum();
  const double covariation = (products_ - apart_.cwiseProduct(speed_) / n).sum();
  const double late = variation > 0.0 ? -covariation / variation : 0.0;
  const Vector6d constant = (apart_ + late * speed_) / n;
  const Vector6d explained = constant.cwiseAbs2() -
                             (2.0 * late / n) * constant.cwiseProduct(speed_) +
                             (late * late / n) * speed_squares_;
  const double rest = std::max(0.0, apart_squares_.sum() / n - explained.sum());
  LidarOffset offset;
  offset.lidar = lidar;
  offset.probes = probes_;
  offset.apart_m = std::sqrt(std::max(0.0, explained.sum()));
  offset.late_s = late;
  if (variation > 0.0)
    offset.late_sd_s = std::sqrt(rest * n / (kComponents * n - kParameters) / variation);
  offset.misplaced_m = constant.norm();
  offset.misplaced_sd_m = std::hypot(std::sqrt(rest / n), (speed_ / n).norm() * offset.late_sd_s);
  return offset;
}

void LidarOffsetSums::save(BinaryWriter& writer) const {
  writer.put(probes_);
  for (const Vector6d* sum : {&apart_, &speed_, &apart_squares_, &speed_squares_, &products_})
    writer.put_doubles(sum->data(), 6);
}

void LidarOffsetSums::load(BinaryReader& reader) {
  probes_ = reader.get<int>();
  for (Vector6d* sum : {&apart_, &speed_, &apart_squares_, &speed_squares_, &products_})
    reader.get_doubles(sum->data(), 6);
}

bool LidarAgreement::wants(const StampedPose& matched) {
  const std::optional<StampedPose> before = std::exchange(last_, matched);
  ++since_probe_;
  if (!before || since_probe_ < kEvery) return false;
  const double between = to_seconds(matched.stamp - before->stamp);
  if (between <= 0.0 || between > kLongestEvenStepS) return false;
  speed_ = motion_in_metres((before->world_from_body.inverse() * matched.world_from_body).log() /
                            between);
  if (speed_.norm() < kLeastSpeed) return false;
  since_probe_ = 0;
  return true;
}

void LidarAgreement::add(const std::vector<std::optional<Pose>>& poses) {
  if (poses.empty() || !poses.front()) return;
  further_.resize(std::max(further_.size(), poses.size() - 1));
  for (std::size_t i = 1; i < poses.size(); ++i) {
    if (poses[i])
      further_[i - 1].add(motion_in_metres((poses[0]->inverse() * *poses[i]).log()), speed_);
  }
}

void LidarAgreement::move_world(const Pose& new_world_from_old_world) {
  if (last_) last_->world_from_body = new_world_from_old_world * last_->world_from_body;
}

std::optional<LidarOffset> LidarAgreement::worst() const {
  std::optional<LidarOffset> worst;
  for (std::size_t i = 0; i < further_.size(); ++i) {
    const std::optional<LidarOffset> offset = further_[i].offset(i + 1);
    if (offset && (!worst || offset->apart_m > worst->apart_m)) worst = offset;
  }
  return worst;
}

void LidarAgreement::save(BinaryWriter& writer) const {
  put_optional(writer, last_, put_stamped_pose);
  writer.put(since_probe_);
  writer.put(std::uint64_t{further_.size()});
  for (const LidarOffsetSums& sums : further_)
    sums.save(writer);
}

void LidarAgreement::load(BinaryReader& reader) {
  last_ = get_optional(reader, get_stamped_pose);
  since_probe_ = reader.get<int>();
  further_.resize(reader.get<std::uint64_t>());
  for (LidarOffsetSums& sums : further_)
    sums.load(reader);
}

}  // namespace understory
