#include "understory/registration/global/pose_evidence.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "understory/registration/global/global_constants.h"

namespace understory {

namespace {

using namespace registration_constants::pose_evidence;

struct Looks {
  double near = 0.0;
  double seen_through = 0.0;
};

Looks look(const SearchCloud& target, const SearchCloud& source, const Pose& target_from_source,
           std::size_t most) {
  const Eigen::Matrix3f rotation = target_from_source.rotation_matrix().cast<float>();
  const Eigen::Vector3f shift = target_from_source.translation().cast<float>();
  const std::size_t count = std::min(source.plants.size(), most);
  Looks looks;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3f at = rotation * source.plants[i * source.plants.size() / count] + shift;
    if (target.near->near(at)) {
      looks.near += 1.0;
    } else if (target.view && target.view->look(at) == RangeView::Sight::kSeenThrough) {
      looks.seen_through += 1.0;
    }
  }
  const double all = std::max(1.0, static_cast<double>(count));
  return {looks.near / all, looks.seen_through / all};
}

// Share of some points of the source in voxels that the target holds.
double held_share(const SearchCloud& target, const Points& source, const Pose& pose) {
  const Eigen::Matrix3f rotation = pose.rotation_matrix().cast<float>();
  const Eigen::Vector3f shift = pose.translation().cast<float>();
  const std::size_t count = std::min(source.size(), kFinePoints);
  std::size_t held = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3f& point = source[i * source.size() / count];
    held += holds_points(target, rotation * point + shift) ? 1 : 0;
  }
  return static_cast<double>(held) / std::max(1.0, static_cast<double>(count));
}

// How far the top of a parabola through three heights, one step apart, lies from the middle one.
double top_of(double before, double middle, double after, double step) {
  const double curve = 2.0 * middle - before - after;
  if (!(curve > kLeastCurve)) return step;
  return std::clamp(0.5 * step * (after - before) / curve, -step, step);
}

void weigh_fine(const SearchCloud& target, const SearchCloud& source, const Pose& pose,
                PoseEvidence& evidence) {
  const auto both = [&](const Pose& at) {
    return 0.5 * (held_share(target, source.plants, at) +
                  held_share(source, target.plants, at.inverse()));
  };
  const auto moved = [&](double x, double y, double yaw) {
    // Turned about the source's origin.
    return Pose(
        Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())) * pose.rotation(),
        pose.translation() + Eigen::Vector3d(x, y, 0.0));
  };
  evidence.fine = both(pose);
  const double left = both(moved(-kAside, 0.0, 0.0));
  const double right = both(moved(kAside, 0.0, 0.0));
  const double back = both(moved(0.0, -kAside, 0.0));
  const double ahead = both(moved(0.0, kAside, 0.0));
  const double turned = both(moved(0.0, 0.0, kTurnAside)) + both(moved(0.0, 0.0, -kTurnAside));
  evidence.fine_aside = (left + right + back + ahead + turned) / 6.0;
  evidence.peak_off_m = std::hypot(top_of(left, evidence.fine, right, kAside),
                                   top_of(back, evidence.fine, ahead, kAside));
}

void weigh_uprights(const SearchCloud& target, const SearchCloud& source, const Pose& pose,
                    PoseEvidence& evidence) {
  if (target.uprights.empty()) return;
  for (const Upright& upright : source.uprights) {
    const Eigen::Vector2d at =
        (pose * Eigen::Vector3d(upright.at.x(), upright.at.y(), upright.ground_m)).head<2>();
    int around = 0;
    bool met = false;
    for (const Upright& other : target.uprights) {
      const double square = (other.at - at).squaredNorm();
      around += square < kAround * kAround ? 1 : 0;
      met = met || square < kMet * kMet;
    }
    evidence.matched += met ? 1.0 : 0.0;
    evidence.by_chance += around * kMet * kMet / (kAround * kAround);
  }
}

}  // namespace

QuickFit quick_fit(const SearchCloud& target, const SearchCloud& source,
                   const Pose& target_from_source) {
  const Looks looks = look(target, source, target_from_source, kQuickPoints);
  return {looks.near, looks.seen_through};
}

double common_voxels(const SearchCloud& target, const SearchCloud& source,
                     const Pose& target_from_source) {
  const Pose back = target_from_source.inverse();
  double sum = 0.0;
  for (const Points SearchCloud::*part : {&SearchCloud::plants, &SearchCloud::ground})
    sum += held_share(target, source.*part, target_from_source) +
           held_share(source, target.*part, back);
  return 0.5 * sum;
}

PoseEvidence weigh_pose(const SearchCloud& target, const SearchCloud& source,
                        const Pose& target_from_source) {
  const Looks there = look(target, source, target_from_source, kLookPoints);
  const Looks back = look(source, target, target_from_source.inverse(), kLookPoints);
  PoseEvidence evidence;
  evidence.near = 0.5 * (there.near + back.near);
  evidence.looked_at = (target.view ? 0.5 : 0.0) + (source.view ? 0.5 : 0.0);
  evidence.seen_through = 0.5 * (there.seen_through + back.seen_through);
  weigh_fine(target, source, target_from_source, evidence);
  weigh_uprights(target, source, target_from_source, evidence);
  return evidence;
}

}  // namespace understory
