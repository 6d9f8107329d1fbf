#include "understory/pipeline/georeferencing/placement_methods.h"

namespace understory {

const std::vector<PlacementMethod>& placement_methods() {
  static const std::vector<PlacementMethod> kMethods{
      {GeoreferenceMethod::kGnssPath, "gnss-path",
       "one motion in the plane between both paths, no common clock needed", place_by_gnss_path},
      {GeoreferenceMethod::kTerrain, "terrain", "height and tilt from a terrain model",
       place_by_terrain}};
  return kMethods;
}

}  // namespace understory
