#include "understory/pipeline/georeferencing/placement_methods.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <variant>

namespace understory {
namespace {

Placement place_by_auto(const GeoreferenceRequest& request, const MovableRun& run, Log& log) {
  const bool more = !request.tree_map.empty() || !request.terrain_model.empty();
  return more ? place_by_all(request, run, log) : place_by_best(request, run, log);
}

}  // namespace

const std::vector<PlacementMethod>& placement_methods() {
  static const std::vector<PlacementMethod> kMethods{
      {GeoreferenceMethod::kAuto, "auto",
       "the one of split, fit3, closed with the smallest expected error; gnss-path where no fix is "
       "of the run's time. With --tree-map or --dem all of them together",
       place_by_auto},
      {GeoreferenceMethod::kSplit, "split",
       "heading and place from positions in the plane, height and tilt apart", place_by_split},
      {GeoreferenceMethod::kClosed, "closed", "closed form, all fixes alike", place_by_closed_form},
      {GeoreferenceMethod::kFit3, "fit3", "positions weighted by their covariances", place_by_fit3},
      {GeoreferenceMethod::kFit6, "fit6", "poses: positions smoothed with the IMU of the recording",
       place_by_fit6},
      {GeoreferenceMethod::kPoints, "points",
       "surveyed points seen in the map, or of times stood on them", place_by_points},
      {GeoreferenceMethod::kGnssPath, "gnss-path",
       "one motion in the plane between both paths, no common clock needed", place_by_gnss_path},
      {GeoreferenceMethod::kTerrain, "terrain", "height and tilt from a terrain model",
       place_by_terrain},
      {GeoreferenceMethod::kTrees, "trees",
       "turn and shift by the pattern of the trees in a map of trees or a cloud from the air",
       place_by_trees}};
  return kMethods;
}

std::string other_heights(const Placement& placement) {
  const bool told = placement.gnss.empty() ||
                    std::any_of(placement.gnss.begin(), placement.gnss.end(),
                                [](const GnssRow& row) { return std::isfinite(row.fix.height_m); });
  return told ? "" : "above the origin of the run, as no fix has a height";
}

double heading_sd_deg(const Placement& placement) {
  for (const char* key : {"sd_heading_deg", "gnss_heading_sd_deg", "trees_yaw_sd_deg"}) {
    const auto found = placement.figures.find(key);
    if (found == placement.figures.end()) continue;
    const double* value = std::get_if<double>(&found->second);
    if (value != nullptr && std::isfinite(*value)) return *value;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace understory
