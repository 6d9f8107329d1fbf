#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "understory/sensor/tree.h"

namespace understory {

// How the trees of two maps become one list, P1 section 2.4.
struct TreeMergeConfig {
  double reach_m = 1.5;      // the same tree lies that near in the other map, before it is moved
  double duplicate_m = 0.6;  // trees that near after it are one, P1 section 2.4
  int smoothing = 2;         // k: the low-pass filter of (7) is applied so often, twice each time
};

// What leads each tree of a map to the other map, smoothed over natural neighbours, metres in the
// plane. P1 (8): the difference to the nearest tree, where there is one within reach. Then (7) in
// the form of the errata, ((I + D^-1 A) / 2)^(2k), over the Delaunay graph of all trees of `from`.
// Trees without a partner take what their neighbours say, so a constant difference is preserved
// whatever is missing. Zero where no tree near has a partner.
struct DeformationField {
  std::vector<Eigen::Vector2d> raw;       // v of (8), zero without a partner
  std::vector<Eigen::Vector2d> smoothed;  // per tree of `from`
  std::vector<char> paired;               // has a partner within reach
  double mean_m = 0.0;                    // e: mean length of v over the paired
};
[[nodiscard]] DeformationField deformation_field(const std::vector<Tree>& from,
                                                 const std::vector<Tree>& to,
                                                 const TreeMergeConfig& config);

// The same field at other places of the plane, such as those of the path, P1 figure 7. It is the
// mean of the smoothed vectors of the trees near, by a Gaussian of their distance. Zero where none
// is near.
//   from: the trees of `field`; places: in the frame of the trees, metres
[[nodiscard]] std::vector<Eigen::Vector2d> field_at(const std::vector<Tree>& from,
                                                    const DeformationField& field,
                                                    const std::vector<Eigen::Vector2d>& places);

// Q(w) of P1 (9): S is moved by w of its field towards L, and L by 1 - w of its own towards S. Of
// pairs nearer than `duplicate_m`, the nearest first, one tree stays. It stands half way between,
// with what the surer of both knows. Q(0) holds S where it is, Q(1) L. Numbered anew, S first.
struct MergedTrees {
  std::vector<Tree> trees;
  std::vector<int> index_in_s;  // per tree: where it comes from, -1 if not in that list
  std::vector<int> index_in_l;
  std::size_t joined = 0;  // pairs that became one
  double apart_m = 0.0;    // root mean square distance of these before they were joined
};
[[nodiscard]] MergedTrees merge_trees(const std::vector<Tree>& s, const std::vector<Tree>& l,
                                      double w, const TreeMergeConfig& config);

}  // namespace understory
