#include "understory/map/clouds/near_columns.h"

#include <cmath>
#include <cstddef>

#include "understory/map/map_constants.h"

namespace understory {

using namespace map_constants::near_columns;

void NearColumns::add(const KeyframeCloud& cloud, const Pose& world_from_body) {
  for (std::size_t i = 0; i < cloud.points.size(); i += kEachOf) {
    const KeyframePoint& p = cloud.points[i];
    const Eigen::Vector3d place = Eigen::Vector3f(p.x, p.y, p.z).cast<double>();
    if (place.norm() < near_m_) ++points_[column_of(world_from_body * place)];
  }
}

bool NearColumns::hold(const Eigen::Vector3d& place) const {
  const auto found = points_.find(column_of(place));
  return found != points_.end() && found->second >= kFewestPoints;
}

std::uint64_t NearColumns::column_of(const Eigen::Vector3d& place) {
  const auto index = [](double metres) {
    return static_cast<std::uint32_t>(static_cast<std::int32_t>(std::floor(metres / kColumnM)));
  };
  return (std::uint64_t{index(place.x())} << 32U) | index(place.y());
}

}  // namespace understory
