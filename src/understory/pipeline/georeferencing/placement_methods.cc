#include "understory/pipeline/georeferencing/placement_methods.h"

namespace understory {

const std::vector<PlacementMethod>& placement_methods() {
  static const std::vector<PlacementMethod> kMethods{
      {GeoreferenceMethod::kGnssPath, "gnss-path",
       "one motion in the plane between both paths, no common clock needed", place_by_gnss_path},
      {GeoreferenceMethod::kTerrain, "terrain", "height and tilt from a terrain model",
       place_by_terrain},
      {GeoreferenceMethod::kTrees, "trees",
       "turn and shift by the pattern of the trees in a map of trees or a cloud from the air",
       place_by_trees}};
  return kMethods;
}

}  // namespace understory
