#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/map/keyframes/keyframe.h"
#include "understory/map/local_map.h"
#include "understory/util/config/config.h"

namespace understory {

// How the first keyframes are positioned again in a map of later ones.
struct FirstKeyframesConfig {
  bool enabled = true;
  int keyframes = 25;      // at the beginning that are positioned again
  int map_keyframes = 25;  // after those, that the map begins with
  // What would move a keyframe farther than this is rejected.
  double max_m = 0.3;
  double max_deg = 2.0;
};
void describe(ConfigTable& table, FirstKeyframesConfig& config);

// The first keyframes of a map have little to be matched to: one scan, which for few rings is some
// curves on the ground. They are matched once more, last to first, to the map that those after them
// make. What odometry says of the motion to the next one is a prior. `segment` are the keyframes of
// one segment from its first on, `points` gives the i-th one's points in its body frame. Returns
// world_from_body of the first `config.keyframes` of them; nothing if the segment is too short.
// Those that do not match move along with the next. The same bits for any number of threads.
[[nodiscard]] std::vector<Pose> refine_first_keyframes(
    std::span<const Keyframe> segment,
    const std::function<std::shared_ptr<const FeaturePoints>(std::size_t)>& points,
    const LocalMapConfig& map_config, const FirstKeyframesConfig& config);

}  // namespace understory
