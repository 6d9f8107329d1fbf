#include "understory/registration/stems/go_icp_bounds.h"

#include <algorithm>
#include <cmath>

#include "understory/util/error.h"

namespace understory {
namespace {

constexpr double kAnywhere = 1e9;  // no limit to the search, metres

// Chord of a turn by at most `angle`, on a circle of radius 1.
double chord(double angle) {
  return 2.0 * std::sin(std::min(0.5 * angle, 0.5 * M_PI));
}

// About the vertical, a change of a tilt of `angle` turns by up to this share of itself. It is the
// third row of SO(3)'s left Jacobian, (1 - cos t) / t, largest at 2.33 rad.
double yaw_of_tilt(double angle) {
  constexpr double kLargestAt = 2.331122370;
  const double t = std::min(angle, kLargestAt);
  return t < 1e-4 ? 0.5 * t : (1.0 - std::cos(t)) / t;
}

Eigen::Quaterniond tilt_of(double x, double y) {
  const Eigen::Vector3d vector(x, y, 0.0);
  const double angle = vector.norm();
  if (angle < 1e-12) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, vector / angle));
}

Eigen::Quaterniond yaw_of(double yaw) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()));
}

}  // namespace

Eigen::Quaterniond GoIcpBox::turn() const {
  return yaw_of(middle[kYaw]) * tilt_of(middle[kTiltX], middle[kTiltY]);
}

Pose GoIcpBox::target_from_source(const Pose& guess) const {
  return Pose(turn() * guess.rotation(), guess.translation() + middle.segment<3>(kX));
}

GoIcpBox::Sides GoIcpBox::sides_of(const Pose& target_from_source, const Pose& guess) {
  const Eigen::Quaterniond turn = target_from_source.rotation() * guess.rotation().inverse();
  // Swing and twist: the twist about the vertical is the yaw, what is left before it the tilt.
  const double yaw = 2.0 * std::atan2(turn.z(), turn.w());
  const Eigen::AngleAxisd tilt(yaw_of(-yaw) * turn);
  Sides sides;
  sides[kYaw] = std::remainder(yaw, 2.0 * M_PI);
  const double angle = std::remainder(tilt.angle(), 2.0 * M_PI);
  sides.segment<2>(kTiltX) = angle * tilt.axis().head<2>();
  sides.segment<3>(kX) = target_from_source.translation() - guess.translation();
  return sides;
}

GoIcpBounds::GoIcpBounds(const SparseTarget& target, const SparsePoints& source, const Pose& guess,
                         Metric metric, double outlier_ratio, double margin_m)
    : grid_(target.grid),
      table_(target.grid, margin_m),
      metric_(metric),
      keep_(trimmed_count(source.size(), outlier_ratio)),
      origin_(guess.translation()) {
  UNDERSTORY_CHECK(source.size() >= kFewestStems);
  for (const Eigen::Vector3d& point : source) {
    points_.push_back(guess.rotation() * point);
    radii_.push_back(points_.back().head<2>().norm());
    lengths_.push_back(points_.back().norm());
    reach_m_ = std::max(reach_m_, radii_.back());
    mean_radius_m_ += radii_.back() / static_cast<double>(source.size());
  }
  middle_.resize(points_.size());
  lower_.resize(points_.size());
}

GoIcpErrors GoIcpBounds::of(const GoIcpBox& box) {
  metric_ == Metric::kPlane ? in_plane(box) : in_space(box);
  return {trimmed(middle_), trimmed(lower_)};
}

double GoIcpBounds::motion_m(GoIcpBox::Side side, double half) const {
  return side < GoIcpBox::kX ? half * mean_radius_m_ : half;
}

void GoIcpBounds::in_plane(const GoIcpBox& box) {
  const double c = std::cos(box.middle[GoIcpBox::kYaw]);
  const double s = std::sin(box.middle[GoIcpBox::kYaw]);
  const double x = origin_.x() + box.middle[GoIcpBox::kX];
  const double y = origin_.y() + box.middle[GoIcpBox::kY];
  const double turn = chord(box.half_yaw());
  const double shift = box.half_shift();
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Eigen::Vector3d& p = points_[i];
    const double squared =
        table_.squared_distance(c * p.x() - s * p.y() + x, s * p.x() + c * p.y() + y);
    middle_[i] = squared;
    const double less = std::max(std::sqrt(squared) - turn * radii_[i] - shift, 0.0);
    lower_[i] = less * less;
  }
}

// A tilt moves points up and down. It moves them sideways only by their height above the sensor,
// and by how far they have moved up or down already. So what a box of tilts can do is bounded apart
// for the plane, where it is little, and for the height. The distance in the plane bounds that in
// space.
void GoIcpBounds::in_space(const GoIcpBox& box) {
  const auto& middle = box.middle;
  const Eigen::Matrix3d turn = box.turn().toRotationMatrix();
  const Eigen::Vector3d shift = origin_ + middle.segment<3>(GoIcpBox::kX);
  const double half_chord = chord(box.half_yaw());
  const double tilt = box.half_tilt();
  const double sideways =
      0.5 * tilt + yaw_of_tilt(middle.segment<2>(GoIcpBox::kTiltX).norm() + tilt);
  const double shift_plane = box.half.segment<2>(GoIcpBox::kX).norm();
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Eigen::Vector3d q = turn * points_[i];
    const Eigen::Vector3d at = q + shift;
    const double tilted = tilt * std::min(lengths_[i], std::abs(q.z()) + sideways * lengths_[i]);
    const double plane = half_chord * q.head<2>().norm() + tilted + shift_plane;
    const double up = tilt * lengths_[i] + box.half[GoIcpBox::kZ];
    const double flat = std::sqrt(table_.squared_distance(at.x(), at.y()));
    middle_[i] = grid_.nearest(at, kAnywhere, 1.0).squared_m2;
    const double less =
        std::max({flat - plane, std::sqrt(middle_[i]) - std::hypot(plane, up), 0.0});
    lower_[i] = less * less;
  }
}

double GoIcpBounds::trimmed(std::vector<double>& squared) const {
  const auto end = squared.begin() + static_cast<std::ptrdiff_t>(keep_);
  if (end < squared.end()) std::nth_element(squared.begin(), end, squared.end());
  double sum = 0.0;
  for (auto value = squared.begin(); value != end; ++value)
    sum += *value;
  return std::sqrt(sum / static_cast<double>(keep_));
}

}  // namespace understory
