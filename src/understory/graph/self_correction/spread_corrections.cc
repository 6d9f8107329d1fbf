#include "understory/graph/self_correction/spread_corrections.h"

#include "understory/util/error.h"

namespace understory {
namespace {

// Metres along the path from scan to scan; a little for each scan, so that standing still does not
// divide by zero.
std::vector<double> lengths_along(std::span<const StampedPose> path) {
  constexpr double kEach = 1e-3;
  std::vector<double> lengths(path.size(), 0.0);
  for (std::size_t i = 1; i < path.size(); ++i) {
    lengths[i] =
        lengths[i - 1] + kEach +
        (path[i].world_from_body.translation() - path[i - 1].world_from_body.translation()).norm();
  }
  return lengths;
}

}  // namespace

std::vector<StampedPose> spread_corrections(std::span<const StampedPose> path,
                                            std::span<const StampedPose> corrected) {
  std::vector<StampedPose> result(path.begin(), path.end());
  const std::vector<double> lengths = lengths_along(path);
  std::vector<std::size_t> at;  // of `corrected` in the path
  std::size_t scan = 0;
  for (const StampedPose& pose : corrected) {
    while (scan < path.size() && path[scan].stamp < pose.stamp)
      ++scan;
    UNDERSTORY_CHECK(scan < path.size() && path[scan].stamp == pose.stamp);
    at.push_back(scan);
  }
  if (at.empty()) return result;
  const auto correction = [&](std::size_t k) {
    return corrected[k].world_from_body * path[at[k]].world_from_body.inverse();
  };
  for (std::size_t i = 0; i < at.front(); ++i)
    result[i].world_from_body = correction(0) * path[i].world_from_body;
  for (std::size_t k = 0; k + 1 < at.size(); ++k) {
    const Pose from = correction(k);
    const Pose to = correction(k + 1);
    const double length = lengths[at[k + 1]] - lengths[at[k]];
    for (std::size_t i = at[k] + 1; i < at[k + 1]; ++i) {
      const double share = (lengths[i] - lengths[at[k]]) / length;
      result[i].world_from_body = interpolate(from, to, share) * path[i].world_from_body;
    }
  }
  for (std::size_t k = 0; k < at.size(); ++k)
    result[at[k]].world_from_body = corrected[k].world_from_body;
  for (std::size_t i = at.back() + 1; i < path.size(); ++i)
    result[i].world_from_body = correction(at.size() - 1) * path[i].world_from_body;
  return result;
}

}  // namespace understory
