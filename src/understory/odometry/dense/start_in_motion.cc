#include "understory/odometry/dense/start_in_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "understory/odometry/odometry_constants.h"
#include "understory/util/time.h"

namespace understory {
namespace {

using namespace odometry_constants::start_in_motion;

// Of the sectors of 10 degrees around the lidar, those with a point.
int sectors_of(const Scan& scan) {
  constexpr int kSectors = 36;
  std::array<bool, kSectors> seen{};
  for (const ScanPoint& p : scan.points) {
    const double turn = std::atan2(p.y, p.x) / (2.0 * std::numbers::pi) + 0.5;
    seen[static_cast<std::size_t>(std::clamp(static_cast<int>(turn * kSectors), 0, 35))] = true;
  }
  return static_cast<int>(std::count(seen.begin(), seen.end(), true));
}

}  // namespace

bool is_part_of_turn(const Scan& first, const Scan& second) {
  if (!first.has_point_times || !second.has_point_times)
    return sectors_of(first) < kPartShare * sectors_of(second);
  const auto turn = static_cast<double>(second.end() - second.stamp);
  return static_cast<double>(first.end() - first.stamp) < kPartShare * turn &&
         static_cast<double>(second.stamp - first.stamp) < kPartShare * turn;
}

std::optional<AssumedMotion> better_start(const Scan& first, const Scan& second,
                                          const Pose& world_from_first,
                                          const Pose& world_from_second,
                                          const AssumedMotion& assumed, bool rate_is_known) {
  const double between = to_seconds(second.stamp - first.stamp);
  if (!(between > 0.0 && between < kLongestBetweenS)) return std::nullopt;
  const double lasting = to_seconds(first.end() - first.stamp);
  // Right differences are along the screw: to first order the velocity at the first scan.
  const Vector6d turned = right_difference(world_from_second, world_from_first) / between;
  const Eigen::Vector3d rate =
      rate_is_known ? assumed.angular_rate_rad_s : Eigen::Vector3d(turned.head<3>());
  const double smear = (turned.tail<3>() - assumed.velocity_m_s).norm() * lasting +
                       (rate - assumed.angular_rate_rad_s).norm() * lasting * kSmearRangeM;
  if (smear <= kLeastSmearM) return std::nullopt;
  return AssumedMotion{turned.tail<3>(), rate};
}

}  // namespace understory
