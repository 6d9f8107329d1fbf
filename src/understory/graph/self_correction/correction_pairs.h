#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/graph/loops/view_cone.h"
#include "understory/registration/stems/sparse_icp.h"
#include "understory/util/config/config.h"

namespace understory {

// Which pairs of views are matched again, and in which order: P0 section 2.4, P1 section 2.3.

// Two views that may be matched again.
struct CorrectionPair {
  int j = 0;  // the earlier view
  int i = 0;
  double overlap = 0.0;  // lambda, of the sectors at the poses as they are
  double error_m = 0.0;  // e at these poses
  [[nodiscard]] int gap() const { return i - j; }
};

// Which of the promising pairs are matched.
enum class PairRule {
  kPoissonDisks,  // P0 (28, 29)
  // What P0's section 3 proposes: choice and order by the association of Delaunay stars. The pair
  // that is expected to tell most, then the one that tells most beside it.
  kDelaunayStars
};

// How pairs of views are drawn and chosen, P0 section 2.4.
struct PairConfig {
  PairRule rule = PairRule::kPoissonDisks;
  int tested = 100'000;    // pairs of views drawn at random
  int shortest_gap = 2;    // views
  int longest_gap = 1000;  // views; 0: any
  // lambda of step 1. The paper draws from 0.2 on, but accepts no match that ends below 0.4.
  double min_overlap = 0.4;
  // (27): a match is acceptable if its error is below the first plus overlap times the second.
  double error_m = 0.3;
  double error_per_overlap_m = 0.5;
  int chosen = 100;            // m
  double outlier_ratio = 0.4;  // gamma, of the pairs of stems that e is the mean of
};
void describe(ConfigTable& table, PairConfig& config);

// P0 (27).
[[nodiscard]] bool acceptable(double error_m, double overlap, const PairConfig& config);

// e of a pair of views as they are placed. It is a mean distance in the plane. From each stem of
// the source that lies in the target's sector, the distance to the target's nearest stem counts.
// The worst share of `outlier_ratio` is left out. NaN where fewer than `kFewestStems` lie in the
// sector.
[[nodiscard]] double placed_error(const SparseTarget& target, const SparsePoints& source,
                                  const Pose& target_from_source, const ConeOverlap& overlap,
                                  double outlier_ratio);

// I2 of P0 section 2.4, step 1: pairs drawn at random, by overlap, then by (27). Ascending by j,
// then i; every pair once. Deterministic; same result for any number of threads.
[[nodiscard]] std::vector<CorrectionPair> promising_pairs(const std::vector<SparseTarget>& targets,
                                                          const std::vector<Pose>& world_from_view,
                                                          const ConeOverlap& overlap,
                                                          const PairConfig& config,
                                                          std::uint64_t seed);

// I of P0 section 2.4, steps 2 and 3, (28) and (29): about `config.chosen` of the pairs, spread
// nearly like Poisson disks over the plane of (j, i). In the order of the pairs given.
[[nodiscard]] std::vector<CorrectionPair> poisson_disk_choice(
    const std::vector<CorrectionPair>& pairs, int wanted);

// Order of corrections, P0 section 3 and table 1.
// By gain: not by gaps; see graph/loops/gain_queue.h.
enum class CorrectionOrder { kSmallGaps, kMediumGaps, kRandom, kGain };
// Medium first: by the distance of the gap from the median gap.
[[nodiscard]] std::vector<CorrectionPair> ordered(std::vector<CorrectionPair> pairs,
                                                  CorrectionOrder order, std::uint64_t seed);

// P1 section 2.3: all pairs of a lattice of every `spacing`-th view, at most `longest_gap` apart,
// by i, then from the longest gap to the shortest. Overlaps and errors are not filled in.
[[nodiscard]] std::vector<CorrectionPair> lattice_pairs(int views, int spacing, int longest_gap);

}  // namespace understory
