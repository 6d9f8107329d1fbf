#include "understory/graph/loops/local_map_loop.h"

#include <fmt/format.h>

#include <numbers>
#include <numeric>
#include <vector>

#include "understory/geometry/kd_tree.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

// Of all points, however far their nearest is.
double mean_squared_distance(const Points& map, const Points& points, const Pose& map_from_points) {
  const KdTreePoints adaptor{&map};
  const KdTree tree(3, adaptor, nanoflann::KDTreeSingleIndexAdaptorParams(10));
  const Eigen::Matrix3f rotation = map_from_points.rotation_matrix().cast<float>();
  const Eigen::Vector3f translation = map_from_points.translation().cast<float>();
  std::vector<double> squared(points.size());
  parallel_for(points.size(), 256, [&](std::size_t i) {
    const Eigen::Vector3f p = rotation * points[i] + translation;
    std::uint32_t index = 0;
    float distance = 0.0F;
    tree.knnSearch(p.data(), 1, &index, &distance);
    squared[i] = static_cast<double>(distance);
  });
  return std::accumulate(squared.begin(), squared.end(), 0.0) / static_cast<double>(points.size());
}

}  // namespace

LoopVerification register_to_local_map(const LocalMapLoopInput& input,
                                       const LoopClosureConfig& config) {
  LoopVerification report;
  report.starts = 1;
  report.target_from_source = input.world_from_candidate.inverse() * input.world_from_query;
  if (input.local_map == nullptr || input.map_points_in_query.empty()) {
    report.reason = "no local map";
    return report;
  }
  const RegistrationResult match = input.local_map->match(
      input.candidate_points, input.world_from_candidate, {}, MatchStart::kFar);
  if (!match.usable()) {
    report.reason = "no match to the local map: " + match.reason;
    return report;
  }
  report.target_from_source = match.target_from_source.inverse() * input.world_from_query;
  const double rotation = config.sigma_rotation_deg * std::numbers::pi / 180.0;
  const double translation = config.sigma_translation_m;
  Vector6d variances;
  variances << Eigen::Vector3d::Constant(rotation * rotation),
      Eigen::Vector3d::Constant(translation * translation);
  report.covariance = variances.asDiagonal();
  report.overlap = match.inlier_ratio;
  report.fitness_m2 = mean_squared_distance(input.map_points_in_query, input.candidate_points,
                                            report.target_from_source.inverse());
  if (report.fitness_m2 > config.max_fitness_m2) {
    report.reason = fmt::format("mean squared distance {:.3f} m^2", report.fitness_m2);
  }
  report.accepted = report.reason.empty();
  return report;
}

}  // namespace understory
