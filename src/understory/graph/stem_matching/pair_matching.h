#pragma once

#include <vector>

#include "understory/graph/loops/view_cone.h"
#include "understory/graph/self_correction/self_correction.h"

namespace understory {

// A new match of two views, with what it was judged by.
struct [[nodiscard]] PairMatch {
  Pose j_from_i;
  double error_before_m = 0.0;
  double error_m = 0.0;
  double overlap = 0.0;  // lambda at the match
  double outlier_ratio = 1.0;
  Matrix6d covariance = Matrix6d::Identity();
  bool by_go_icp = false;
  bool accepted = false;
  std::string reason;  // if not
};

// P0 section 2.4: ICP from the poses as they are, and Go-ICP where ICP does not end with (27) and
// an overlap of lambda0. Accepted if these hold and the error has become smaller.
PairMatch match_pair(const SparseTarget& target, const SparsePoints& source, const Pose& j_from_i,
                     const ConeOverlap& overlap, const SelfCorrectionConfig& config);

// P1 section 2.3: Go-ICP at once. Accepted if the error has become smaller, and the measured
// outlier ratio and the error are within the limits of LatticeConfig.
PairMatch match_lattice_pair(const SparseTarget& target, const SparsePoints& source,
                             const Pose& j_from_i, const ConeOverlap& overlap,
                             const SelfCorrectionConfig& config);

// Covariance of a match, right perturbation: its own, widened as stems are no independent points.
// What both sides got wrong alike is added, of which `shift_sd_m` is the part in the plane. A tilt
// turns the view about the middle of its points (`source`).
[[nodiscard]] Matrix6d match_covariance(const Matrix6d& information, const SparsePoints& source,
                                        double shift_sd_m);

// Which views are laid together, and which of their stems.
struct Gathering {
  double reach_m = 0.0;   // along the way, to each side
  int max_views = 0;      // to each side, evenly over the reach
  double merge_m = 0.0;   // stems of different views nearer than that are one
  double radius_m = 0.0;  // in the plane, of the stems that are kept; 0: all
  // Of the views within `radius_m` of a stem, so many see it, 0..1: what fewer see is no stem.
  double least_share = 0.0;
  // Noisy sights of one stem may lie so far apart that they begin two. Those within `merge_m` that
  // no view sees both are one then.
  bool join_split = false;
};

// Views around one, laid together in its frame by their poses. Stems seen in several views are
// means; those seen once among three views or more are left out.
[[nodiscard]] SparsePoints gather_views(const std::vector<SparsePoints>& views,
                                        const std::vector<Pose>& world_from_view, int centre,
                                        const Gathering& gathering);

}  // namespace understory
