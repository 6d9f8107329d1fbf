#pragma once

#include <span>

#include "understory/registration/match_sums.h"
#include "understory/registration/ndt/ndt_map.h"
#include "understory/registration/registration.h"
#include "understory/util/config/config.h"

namespace understory {

// Settings of the match to normal distributions, P4 (40).
struct NdtConfig {
  enum class Search {
    k1,
    k7,
    k8,
    k27
  };  // own cell; with face neighbours; the 2x2x2 cells around
      // the point; with all neighbours
  enum class Hessian { kGaussNewton, kNewton };

  Search search = Search::k1;
  Hessian hessian = Hessian::kGaussNewton;
  // Share of points expected to match nothing, P4 after (41) [Magnusson 2009, (6.8)].
  double outlier_ratio = 0.3;
  // The first steps see normals this much wider, which pull from farther away. They end when a step
  // is shorter than `wide_until_m` (turns count at the mean range of the points).
  double widening = 3.0;
  double wide_until_m = 0.02;
  int max_iterations = 30;
  double step_translation_m = 1e-3;  // converged when a step is smaller than both
  double step_rotation_rad = 1e-4;
  double max_step_m = 0.5;          // longest step; rotations scaled by the mean range
  double degenerate_ratio = 0.003;  // a direction with less than this share of the strongest
                                    // direction's information counts as undetermined
  int min_matches = 50;
  // Neighbouring points see the same cell and share its error: this share of them counts as
  // independent. Scales the matching cost against the prior, and the information.
  double independent_share = 0.05;
};
void describe(ConfigTable& table, NdtConfig& config);

// Matches a source cloud to the target, P4 (41), by Newton steps to where the gradient vanishes.
// The cost is the sum over points of -log of a mixture, plus the terms; the mixture is the cell's
// normal and a uniform distribution. Source points should be thinned by a voxel filter first.
// Parallel; same bits for any number of threads. Thread-safe. `coarser`: of the same cloud, with
// larger cells; points whose cell in `target` has too few points for a distribution are matched to
// these. Null: such points match nothing.
[[nodiscard]] RegistrationResult register_ndt(const NdtMap& target, const NdtSource& source,
                                              const Pose& guess, const PoseTerms& terms,
                                              const NdtConfig& config,
                                              const NdtMap* coarser = nullptr);

// Coarse to fine: each map in turn, the result of one is the guess of the next. `coarser` goes with
// the last.
[[nodiscard]] RegistrationResult register_ndt(std::span<const NdtMapPtr> targets,
                                              const NdtSource& source, const Pose& guess,
                                              const PoseTerms& terms, const NdtConfig& config,
                                              const NdtMap* coarser = nullptr);

// The cost that register_ndt minimises (terms left out), with its gradient and Hessian with respect
// to a right perturbation. For tests and for those who optimise it with other terms.
[[nodiscard]] MatchSums ndt_cost(const NdtMap& target, const NdtSource& source,
                                 const Pose& target_from_source, const NdtConfig& config,
                                 double widening = 1.0, const NdtMap* coarser = nullptr);

}  // namespace understory
