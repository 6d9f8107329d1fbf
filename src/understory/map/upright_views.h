#pragma once

#include <vector>

#include "understory/geometry/plane/plane_grid.h"
#include "understory/geometry/pose.h"
#include "understory/sensor/stem_view.h"

namespace understory {

// Views whose frames stand upright on the whole, as what is seen from above needs.
struct UprightViews {
  std::vector<SparsePoints> points;   // of the stems, metres, in the frame of each view
  std::vector<Pose> world_from_view;  // z of the world is up
};

// The views turned by one rotation that is the same for all. It is none where the body stands
// upright: the mean of all views has its z axis within 20 degrees of up. Other bodies are those of
// a lidar whose mounting is not known, or of a carrier with other axes. Where the body hangs over
// by more than 120 degrees, half a turn about the x axis comes first. Throws Error where the sizes
// differ. Deterministic; thread-safe.
[[nodiscard]] UprightViews upright_views(const std::vector<StemView>& views,
                                         const std::vector<Pose>& world_from_body);

}  // namespace understory
