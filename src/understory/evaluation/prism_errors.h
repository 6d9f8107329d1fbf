#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <vector>

#include "understory/evaluation/alignment.h"
#include "understory/evaluation/trajectory.h"

namespace understory {

// Errors of the prism's place as the estimate has it, metres.
struct PrismErrors {
  std::size_t pairs = 0;
  Alignment alignment = Alignment::kNone;
  bool alignment_determined = true;
  Pose truth_from_estimate;  // the motion of the alignment
  double ape_rmse_m = 0.0;
  double ape_plane_rmse_m = 0.0;
  double ape_mean_m = 0.0;
  double ape_median_m = 0.0;
  double ape_max_m = 0.0;
};

// Compares an estimate with the places of a prism at `prism_in_body` (the lever arm, metres). Each
// place goes with the pose nearest in time, at most tolerance_s away; nothing is interpolated.
// Alignment by least squares over the prism's places; kFirst is a ConfigError, as a place has no
// attitude. Nothing if no times agree.
[[nodiscard]] std::optional<PrismErrors> evaluate_prism(const Trajectory& estimate,
                                                        const std::vector<StampedPoint>& truth,
                                                        const Eigen::Vector3d& prism_in_body,
                                                        Alignment alignment, double tolerance_s);

}  // namespace understory
