#include "understory/pipeline/georeferencing/methods/placement_methods.h"

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
       "split, fit3 or closed, by the smallest expected error (gnss-path if no fix has a time of "
       "the run). With --tree-map or --dem all sources together",
       place_by_auto},
      {GeoreferenceMethod::kSplit, "split",
       "heading and position from the fixes in the plane, height and tilt separately",
       place_by_split},
      {GeoreferenceMethod::kClosed, "closed", "closed form, all fixes with equal weight",
       place_by_closed_form},
      {GeoreferenceMethod::kFit3, "fit3", "positions weighted by their covariances", place_by_fit3},
      {GeoreferenceMethod::kFit6, "fit6", "poses: positions smoothed with the IMU of the recording",
       place_by_fit6},
      {GeoreferenceMethod::kPoints, "points",
       "surveyed points that are seen in the map or were stood on at known times", place_by_points},
      {GeoreferenceMethod::kGnssPath, "gnss-path",
       "one motion in the plane between both paths, no common clock needed", place_by_gnss_path},
      {GeoreferenceMethod::kTerrain, "terrain", "height and tilt from a terrain model",
       place_by_terrain},
      {GeoreferenceMethod::kTrees, "trees",
       "heading and position by the pattern of trees in a map of trees or a cloud from the air",
       place_by_trees}};
  return kMethods;
}

std::string reason_of(const InputError& error) {
  const std::string text = error.what();
  const std::string file = error.file() + ": ";
  return text.rfind(file, 0) == 0 ? text.substr(file.size()) : text;
}

std::string other_heights(const Placement& placement) {
  if (!placement.heights.empty()) return placement.heights;
  const bool told = placement.gnss.empty() ||
                    std::any_of(placement.gnss.begin(), placement.gnss.end(),
                                [](const GnssRow& row) { return std::isfinite(row.fix.height_m); });
  return told ? "" : std::string(kHeightsOfOrigin) + ", as no fix has a height";
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
