#include "understory/map/foot_heights.h"

#include <algorithm>
#include <cstddef>

#include "understory/map/map_constants.h"
#include "understory/util/error.h"
#include "understory/util/median.h"

namespace understory {

using namespace map_constants::foot_heights;

std::optional<CarriedHeight> carried_height(const std::vector<StemView>& views,
                                            const std::vector<Pose>& world_from_body) {
  UNDERSTORY_CHECK(views.size() == world_from_body.size());
  std::vector<double> heights;
  for (std::size_t i = 0; i < views.size(); ++i) {
    std::vector<double> above;
    for (const Stem& stem : views[i].stems) {
      const Eigen::Vector3d foot = world_from_body[i].rotation() * stem.point.cast<double>();
      if (foot.head<2>().norm() < kNearM) above.push_back(-foot.z());
    }
    if (above.size() >= kFewestFeet) heights.push_back(upper_median(std::move(above)));
  }
  if (heights.size() < kFewestViews) return std::nullopt;
  std::sort(heights.begin(), heights.end());
  const auto quantile = [&](double share) {
    return heights[static_cast<std::size_t>(share * static_cast<double>(heights.size() - 1))];
  };
  return CarriedHeight{quantile(kTail), quantile(0.5), quantile(1.0 - kTail),
                       static_cast<int>(heights.size())};
}

bool feet_leave_the_ground(const CarriedHeight& carried) {
  return carried.high_m - carried.low_m > kWidestRangeM;
}

}  // namespace understory
