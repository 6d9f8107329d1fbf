#pragma once

#include <optional>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/sensor/stem_view.h"

namespace understory {

// How high the body is carried above the feet of the stems around it, over all views. Metres.
struct CarriedHeight {
  double low_m = 0.0;  // 5 % of the views are carried lower
  double middle_m = 0.0;
  double high_m = 0.0;  // 5 % are carried higher
  int views = 0;        // with enough stems near them
};

// Of each view the median height of the body above the feet within some metres, with the tilt of
// its pose. A person or a machine carries a scanner at one height. So a wide range says that the
// points of the stems do not lie on the ground. Heights and tilt of the path then follow their
// errors, and nothing else shows it. The plane is not touched by that. Nothing where fewer than 20
// views have three stems near them. Deterministic.
[[nodiscard]] std::optional<CarriedHeight> carried_height(const std::vector<StemView>& views,
                                                          const std::vector<Pose>& world_from_body);

// Whether a range is wider than a carrier explains.
[[nodiscard]] bool feet_leave_the_ground(const CarriedHeight& carried);

}  // namespace understory
