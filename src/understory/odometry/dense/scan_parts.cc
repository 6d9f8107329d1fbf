#include "understory/odometry/dense/scan_parts.h"

#include <algorithm>
#include <cmath>

#include "understory/geometry/matrix_inverse.h"
#include "understory/util/error.h"

namespace understory {

std::vector<Scan> parts_of(const Scan& scan, double fraction) {
  UNDERSTORY_CHECK(fraction > 0.0 && fraction <= 1.0);
  const TimeNs duration = scan.end() - scan.stamp;
  if (!scan.has_point_times || duration <= 0) return {};
  const auto count = static_cast<std::size_t>(std::max(1.0, std::round(1.0 / fraction)));
  const double step = fraction * static_cast<double>(duration);
  std::vector<Scan> parts(count);
  for (const ScanPoint& point : scan.points) {
    const auto at = static_cast<std::size_t>(static_cast<double>(point.t_ns) / step);
    parts[std::min(at, count - 1)].points.push_back(point);
  }
  std::erase_if(parts, [](const Scan& part) { return part.points.empty(); });
  for (Scan& part : parts) {
    std::uint32_t first = part.points.front().t_ns;
    for (const ScanPoint& point : part.points)
      first = std::min(first, point.t_ns);
    for (ScanPoint& point : part.points)
      point.t_ns -= first;
    part.stamp = scan.stamp + static_cast<TimeNs>(first);
    part.ring_count = scan.ring_count;
  }
  return parts;
}

Pose fuse(const NavState& predicted, const Pose& match, const Matrix6d& covariance) {
  const Matrix6d gain =
      predicted.pose_covariance * inverse_matrix(predicted.pose_covariance + covariance);
  return predicted.world_from_body *
         Pose::exp(gain * right_difference(match, predicted.world_from_body));
}

}  // namespace understory
