#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "understory/geometry/plane/plane_grid.h"
#include "understory/geometry/pose.h"
#include "understory/util/config/config.h"

namespace understory {

// Matching of sparse clouds (tens to hundreds of tree stems), both levelled: z up to a few degrees.
struct SparseIcpConfig {
  // Plane: yaw and the horizontal position; heights and tilt stay as guessed. Space: all six.
  enum class Metric { kPlane, kSpace };

  Metric metric = Metric::kSpace;
  // P0's gamma: share of the source points that is left out of each step, the worst first.
  double outlier_ratio = 0.4;
  int max_iterations = 60;
  double step_translation_m = 1e-4;
  double step_rotation_rad = 1e-5;
  // After the trimmed steps: the noise is taken from the residuals themselves, heights apart from
  // the plane, and pairs weigh by Student's t.
  bool refine = true;
  // Points count as overlapping when the match ends nearer than this share of L0.
  double overlap_distance_ratio = 0.1;
};
void describe(ConfigTable& table, SparseIcpConfig& config);

// How a match of stems ended.
enum class SparseIcpStatus { kConverged, kIterationLimit, kTooFewPoints };
// The name of a status in messages and tables.
[[nodiscard]] std::string to_string(SparseIcpStatus status);

// The pose of a match of stems, and how well it fits.
struct [[nodiscard]] SparseIcpResult {
  SparseIcpStatus status = SparseIcpStatus::kTooFewPoints;
  std::string reason;  // empty if converged
  Pose target_from_source;
  double error_m = 0.0;        // e: mean distance of the pairs kept by trimming
  double error_rms_m = 0.0;    // their root mean square
  double overlap = 0.0;        // P0's lambda, measured: share of source points with a near partner
  double outlier_ratio = 0.0;  // 1 - overlap
  double sigma_plane_m = 0.0;  // noise of a matched pair, per axis (refine only)
  double sigma_height_m = 0.0;
  Matrix6d information = Matrix6d::Zero();  // right perturbation, rotation first (refine only)
  int iterations = 0;
};

// Target of sparse ICP with L0, the mean distance of natural neighbours, P0 (23).
struct SparseTarget {
  // `height_sd_m`: how well each point's height is known; empty: all alike, not said how well.
  explicit SparseTarget(const SparsePoints& points, std::vector<double> height_sd_m = {});
  PlaneGrid grid;
  std::vector<double> height_sd_m;
  double l0_m = 0.0;
};

// Fewer in either cloud are not matched; `too_few_stems` says so.
constexpr std::size_t kFewestStems = 6;
[[nodiscard]] std::string too_few_stems();
// How many source points trimming keeps: the same in ICP and in the bounds of Go-ICP, whose
// certificate rests on it.
[[nodiscard]] std::size_t trimmed_count(std::size_t points, double outlier_ratio);

// Trimmed ICP between points. Where both sides say how well they know their heights, places in the
// plane decide on pairs in the main. Heights weigh by how well they are known. Deterministic;
// thread-safe.
SparseIcpResult register_sparse_icp(const SparseTarget& target, const SparsePoints& source,
                                    const Pose& guess, const SparseIcpConfig& config,
                                    const std::vector<double>& source_height_sd_m = {});

// Where ICP converges, P0 (24-26): distances that a shift and a turn may have from the solution.
struct ConvergenceRegion {
  double delta0_m = 0.0;     // (24) L0 / 2
  double theta0_rad = 0.0;   // (25) delta0 / (sqrt(1 - gamma) R)
  double phi0_rad = 0.1431;  // tilt, 8.2 degrees in the paper
  // (26) in the form with tilt.
  [[nodiscard]] bool contains(double shift_m, double yaw_rad, double tilt_rad) const;
};
// `radius_m` is R, the reach of the view; `outlier_ratio` is gamma, 0..1.
[[nodiscard]] ConvergenceRegion convergence_region(double l0_m, double radius_m,
                                                   double outlier_ratio);

}  // namespace understory
