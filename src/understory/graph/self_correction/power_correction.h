#pragma once

#include <string>
#include <vector>

#include "understory/geometry/pose.h"

namespace understory {

// Spreading of a better match between two views over the views between them by powers of the
// correction: P0 section 2.2, P1 section 2.3. Frames are numbered as they were taken, j < i.

// The power u_l that a view l between j and i is given; 0 at j, 1 at i.
enum class PowerCoefficient {
  kIndex,       // P0 (21): share of the views
  kPathLength,  // P0 section 4.1 (1): share of the way
  kMatchError,  // P0 section 4.1 (1), P1 (5): share of the steps' match errors, from j + 1
  kMetric,      // P0 (31): share of the distance in SE(3) from j
  kScrew        // P0 (32): the nearest point of the screw path from j to i
};

// What the power acts on.
enum class PowerForm {
  // P0 (19), P1 (3): t'_lj = t_lj D^u with D = t_ij^-1 t'_ij: in the frame of view l itself.
  kPrinted,
  // As corrected: t'_lj = (t'_ij t_ij^-1)^u t_lj: in the frame of view j. A view that looks
  // elsewhere than i is moved the way that i is moved, not the way that its own frame is turned.
  kCorrected
};

// How a correction is spread over the views between.
struct PowerConfig {
  PowerCoefficient coefficient = PowerCoefficient::kPathLength;
  PowerForm form = PowerForm::kCorrected;
  // a and b of the distance d = sqrt(a theta^2 + b |q|^2) of (31) and (32). a is the mean square of
  // the distance of stems, so that d is about how far they move.
  double metric_rotation_m2 = 400.0;
  double metric_translation = 1.0;
};

// d of P0 section 4.1 (2), metres.
[[nodiscard]] double motion_metric(const Pose& motion, const PowerConfig& config);

// u_l for l = j..i (i - j + 1 values), not clipped: 0 first and 1 last. `step_errors` holds e_k of
// the step from k - 1 to k, for kMatchError. Where a measure is 0 all the way, the index stands in.
[[nodiscard]] std::vector<double> power_coefficients(const std::vector<Pose>& world_from_view,
                                                     const std::vector<double>& step_errors, int j,
                                                     int i, const PowerConfig& config);

// Places view i by its new match to j, and spreads the correction over the views between, P0 (19).
// All later views move with it rigidly, P0 (20). Views up to j stay. Other poses' differences do
// not change: T'_k^-1 T'_l = T_k^-1 T_l for k, l >= i.
void apply_power_correction(std::vector<Pose>& world_from_view,
                            const std::vector<double>& step_errors, int j, int i,
                            const Pose& j_from_i, const PowerConfig& config);

}  // namespace understory
