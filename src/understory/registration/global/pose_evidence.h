#pragma once

#include "understory/geometry/pose.h"
#include "understory/registration/global/search_cloud.h"

namespace understory {

// How well a source lies on a target, in one quick look: of up to 600 points above the ground.
struct QuickFit {
  double near = 0.0;          // share of them within about 0.6 m of the target
  double seen_through = 0.0;  // share that lies where the target's lidar saw farther
  [[nodiscard]] double score() const { return near - seen_through; }
};

// `target_from_source` is between the level frames of the clouds.
[[nodiscard]] QuickFit quick_fit(const SearchCloud& target, const SearchCloud& source,
                                 const Pose& target_from_source);

// Share of the source's points, on and above the ground, in a voxel of 0.2 m that the target holds,
// too, added up for both directions: 0..2.
[[nodiscard]] double common_voxels(const SearchCloud& target, const SearchCloud& source,
                                   const Pose& target_from_source);

// What speaks for and against a pose of the source on the target. Shares are means of both
// directions: source on target and target on source.
struct PoseEvidence {
  double near = 0.0;          // share of points above the ground within about 0.6 m of the other
  double seen_through = 0.0;  // share that lies where the other's lidar saw farther
  double looked_at = 0.0;     // directions in which that could be told: 0, 0.5 or 1
  double fine = 0.0;          // share of points in a voxel of 0.2 m that the other cloud holds, too
  double fine_aside = 0.0;    // the same, mean of the poses 0.4 m and 3 degrees beside it
  double peak_off_m = 0.0;    // how far the greatest such share lies from the pose in the plane
  double matched = 0.0;       // uprights of the source that lie on one of the target
  double by_chance = 0.0;     // so many would, by chance
};

// Deterministic, thread-safe. `target_from_source` is between the level frames.
[[nodiscard]] PoseEvidence weigh_pose(const SearchCloud& target, const SearchCloud& source,
                                      const Pose& target_from_source);

}  // namespace understory
