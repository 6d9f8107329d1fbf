#include "understory/evaluation/prism_errors.h"

#include <algorithm>
#include <cmath>

#include "understory/evaluation/association.h"
#include "understory/util/error.h"
#include "understory/util/median.h"

namespace understory {

std::optional<PrismErrors> evaluate_prism(const Trajectory& estimate,
                                          const std::vector<StampedPoint>& truth,
                                          const Eigen::Vector3d& prism_in_body, Alignment alignment,
                                          double tolerance_s) {
  if (alignment == Alignment::kFirst) {
    throw ConfigError({"--align first: a prism has no attitude, expected none, yaw or se3"});
  }
  std::vector<Eigen::Vector3d> estimated;
  std::vector<Eigen::Vector3d> measured;
  for (const auto& [i, j] : internal::nearest_in_time(estimate, truth, tolerance_s)) {
    estimated.push_back(estimate[i].world_from_body * prism_in_body);
    measured.push_back(truth[j].point);
  }
  if (estimated.empty()) return std::nullopt;
  AlignmentResult moved{Pose(), true, 0.0};
  if (alignment == Alignment::kYaw) moved = align_points_yaw(estimated, measured);
  if (alignment == Alignment::kSe3) moved = align_points_se3(estimated, measured);
  PrismErrors errors;
  errors.pairs = estimated.size();
  errors.alignment = alignment;
  errors.alignment_determined = moved.determined;
  errors.truth_from_estimate = moved.target_from_source;
  std::vector<double> distances;
  double sum = 0.0;
  double sum_plane = 0.0;
  for (std::size_t i = 0; i < estimated.size(); ++i) {
    const Eigen::Vector3d off = moved.target_from_source * estimated[i] - measured[i];
    sum += off.squaredNorm();
    sum_plane += off.head<2>().squaredNorm();
    distances.push_back(off.norm());
    errors.ape_mean_m += off.norm();
  }
  const auto count = static_cast<double>(distances.size());
  errors.ape_rmse_m = std::sqrt(sum / count);
  errors.ape_plane_rmse_m = std::sqrt(sum_plane / count);
  errors.ape_mean_m /= count;
  errors.ape_max_m = *std::max_element(distances.begin(), distances.end());
  errors.ape_median_m = upper_median(std::move(distances));
  return errors;
}

}  // namespace understory
