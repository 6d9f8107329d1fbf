#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/sensor/stem_view.h"
#include "understory/util/config/config.h"

namespace understory {

// One tree of a sparse map: the mean of the points at which its stem was seen.
struct MappedStem {
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  Eigen::Vector3d axis_in_world = Eigen::Vector3d::UnitZ();
  Eigen::Vector2d variance_m2 = Eigen::Vector2d::Zero();    // of one sight, x and y
  double dbh_m = std::numeric_limits<double>::quiet_NaN();  // mean of the sights that tell one
  int dbh_sights = 0;
  double dbh_squares_m2 = 0.0;  // sum of the squares of their differences from the mean
  // Mean of the variances that they state themselves; NaN where one states none.
  double dbh_own_m2 = std::numeric_limits<double>::quiet_NaN();
  double dbh_range_m = std::numeric_limits<double>::quiet_NaN();  // mean distance, in the plane
  int sights = 0;
  // Root mean square angle between the axes of its sights and their mean; needs two with an axis.
  double axis_noise_rad = std::numeric_limits<double>::quiet_NaN();
  int axis_sights = 0;
  int first_view = 0;  // indices into the views
  int last_view = 0;
  // Share of the views in whose sector it lies that saw it; 0 if it was not asked for. What is no
  // tree is seen now and then.
  double presence = 0.0;
};

// How sights of stems become trees, and which trees are listed.
struct StemMapConfig {
  double merge_m = 0.6;  // sights nearer than this to a tree's mean in the plane are of that tree
  // Above 0: trees are the alpha shapes of all sights with that radius instead (P1 section 2.3;
  // 0.5).
  double alpha_radius_m = 0.0;
  int min_sights = 3;  // trees seen less often are left out
  // And those seen in a smaller share of the views in whose sector they lie; 0: not asked for.
  double min_presence = 0.0;
  // Trees nearer than this that were never seen together, though they should have been some times,
  // are one; 0: not asked for.
  double duplicate_m = 0.0;
};
void describe(ConfigTable& table, StemMapConfig& config);
// What a tree list asks for.
[[nodiscard]] StemMapConfig tree_list_config();

// Gathers the stems of all views, placed by their poses, into trees, in the order of the views.
// Deterministic; memory grows with the trees and
// their sights.
[[nodiscard]] std::vector<MappedStem> build_stem_map(const std::vector<StemView>& views,
                                                     const std::vector<Pose>& world_from_body,
                                                     const StemMapConfig& config);

// Standard deviation of a tree's diameter, metres. It holds the scatter of the sights, and two
// errors that all of them share. A stem is not round, and its sights look from like directions. And
// wide beams make it look thicker by about `excess_m` (excess_width_m; 0: beams without width). How
// far single sights scatter is told by their scatter and by what they state themselves. NaN without
// a diameter, or where one sight states nothing.
[[nodiscard]] double dbh_sd_m(const MappedStem& stem, double excess_m);

}  // namespace understory
