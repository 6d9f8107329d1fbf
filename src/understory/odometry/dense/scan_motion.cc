#include "understory/odometry/dense/scan_motion.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "understory/geometry/pose_io.h"
#include "understory/odometry/dense/scan_path.h"
#include "understory/odometry/odometry_constants.h"

namespace understory {
namespace {

using namespace odometry_constants::scan_motion;

// So loose that the guess hardly binds: what is looked for is a guess that is wrong.
constexpr ScanPathConfig kLoose{30.0, 60.0, 8, 6.0};

}  // namespace

Vector6d motion_in_metres(Vector6d motion) {
  motion.head<3>() *= kRangeM;
  return motion;
}

void ScanMotionSums::add(const Vector6d& within, const Vector6d& between) {
  const double product = within.dot(between);
  ++probes_;
  products_ += product;
  squares_ += between.squaredNorm();
  along_ += product * product / between.squaredNorm();
}

ScanMotion ScanMotionSums::motion() const {
  if (probes_ == 0) return {};
  const double ratio = products_ / squares_;
  const double rest = std::max(0.0, along_ - ratio * products_);
  const double sd = probes_ > 1 ? std::sqrt(rest / (squares_ * (probes_ - 1))) : 0.0;
  return {probes_, ratio, sd};
}

void ScanMotionSums::save(BinaryWriter& writer) const {
  writer.put(probes_);
  writer.put(products_);
  writer.put(squares_);
  writer.put(along_);
}

void ScanMotionSums::load(BinaryReader& reader) {
  probes_ = reader.get<int>();
  products_ = reader.get<double>();
  squares_ = reader.get<double>();
  along_ = reader.get<double>();
}

void ScanMotionWatch::add(const MatchTarget& target, const BodyCloud& source,
                          const std::vector<StampedPose>& guess, const StampedPose& matched,
                          TimeNs duration) {
  const std::optional<StampedPose> before = std::exchange(last_, matched);
  ++since_probe_;
  if (!before || since_probe_ < kEvery || duration <= 0 || guess.size() < 2) return;
  const double between = to_seconds(matched.stamp - before->stamp);
  if (between <= 0.0 || between > kLongestStepS) return;
  const Vector6d moved =
      motion_in_metres((before->world_from_body.inverse() * matched.world_from_body).log() *
                       (to_seconds(duration) / between));
  if (moved.norm() < kLeastMotionM) return;
  since_probe_ = 0;
  const ScanPathCorrection correction =
      match_scan_path(target, source, duration, matched.world_from_body, kLoose);
  if (correction.iterations == 0) return;
  const Pose guessed = guess.front().world_from_body.inverse() * guess.back().world_from_body;
  const Vector6d within = motion_in_metres(guessed.log() + correction.at_end - correction.at_start);
  sums_.add(within, moved);
}

void ScanMotionWatch::move_world(const Pose& new_world_from_old_world) {
  if (last_) last_->world_from_body = new_world_from_old_world * last_->world_from_body;
}

void ScanMotionWatch::save(BinaryWriter& writer) const {
  put_optional(writer, last_, put_stamped_pose);
  writer.put(since_probe_);
  sums_.save(writer);
}

void ScanMotionWatch::load(BinaryReader& reader) {
  last_ = get_optional(reader, get_stamped_pose);
  since_probe_ = reader.get<int>();
  sums_.load(reader);
}

}  // namespace understory
