#pragma once

#include <cstddef>
#include <vector>

#include "understory/evaluation/trajectory.h"
#include "understory/evaluation/trees/tree_errors.h"
#include "understory/sensor/tree.h"

namespace understory {

// c of P1 (10): matches over the mean number of trees. NaN if both are empty.
[[nodiscard]] double consistency(std::size_t matches, std::size_t trees_a, std::size_t trees_b);

// One-to-one matches within `pairing_m` after the motion in the plane that lays A on B best, from
// where they are: wide pairs first.
[[nodiscard]] std::size_t matches_after_motion(std::vector<Tree> a, const std::vector<Tree>& b,
                                               double pairing_m);

// Detection over the distance from the path (P1 figure 8).
struct DistanceRate {
  double from_m = 0.0;
  double to_m = 0.0;
  std::size_t expected = 0;  // trees of B that stand there
  std::size_t found = 0;     // of these, matched by A
  std::size_t reported = 0;  // trees of A there that match no felled tree of B
  std::size_t right = 0;     // of these, matched
  double recall = 0.0;       // found / expected, NaN without any
  double precision = 0.0;    // right / reported
  TreeErrors errors;         // of the pairs whose tree of B stands there
};

// In rings of `bin_m` out to `reach_m`. Both maps in one frame.
[[nodiscard]] std::vector<DistanceRate> rates_over_distance(const std::vector<Tree>& a,
                                                            const std::vector<Tree>& b,
                                                            const std::vector<TreePair>& pairs,
                                                            const Trajectory& path, double bin_m,
                                                            double reach_m);

// Consistency of two maps of one place (P1 (10), table 1) over the trees that both can have seen:
// those within `within_m` of both paths.
struct MapConsistency {
  std::size_t trees_a = 0;
  std::size_t trees_b = 0;
  std::size_t parts = 0;
  double as_placed = 0.0;
  double moved = 0.0;     // after the one motion in the plane that fits best
  double in_parts = 0.0;  // after a motion for each part, all matches together
};

// How the maps of two drives are compared, P1 section 2.5.
struct MapConsistencyConfig {
  double pairing_m = 0.3;  // of trees that count as the same
  double within_m = 20.0;  // the mapping range of P1
  double part_m = 50.0;    // length of the parts, along the main direction of the first path
};

// Both maps and both paths in one frame.
[[nodiscard]] MapConsistency map_consistency(const std::vector<Tree>& a, const std::vector<Tree>& b,
                                             const Trajectory& path_a, const Trajectory& path_b,
                                             const MapConsistencyConfig& config);

}  // namespace understory
