#pragma once

#include <optional>

#include "understory/features/tree_tops.h"
#include "understory/geometry/pose.h"
#include "understory/preprocess/body_cloud.h"
#include "understory/util/config/config.h"

namespace understory {

// Which points of a scan are matched, and enter the local map.
enum class ScanPoints { kAll, kTreeTops };

// Which points are chosen, and how tops are found. Metres, square metres.
struct ScanTopsConfig {
  ScanPoints points = ScanPoints::kAll;
  TreeTopConfig top{.window_m = 0.5};  // young pines stand 1.2 m apart
  // With fewer points around its tops, all points of a scan count.
  int least_points = 300;
};
void describe(ConfigTable& table, ScanTopsConfig& config);

// The tree tops of a deskewed scan with the points around them, P2 (1), in the order of the scan.
// `world_from_body` turns its points so that z is up; `lidar` is the lidar's place in the body
// frame, metres. Nothing where all points are asked for, or the points are too few. Nothing, too,
// where the lidar hangs below the middle one of the tops: before lift-off there are hardly any in
// view. Thread-safe.
[[nodiscard]] std::optional<BodyCloud> keep_tree_tops(const BodyCloud& cloud,
                                                      const Pose& world_from_body,
                                                      const ScanTopsConfig& config);

}  // namespace understory
