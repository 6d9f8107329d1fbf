#pragma once

#include <vector>

#include "understory/registration/icp/icp_map.h"
#include "understory/registration/icp/surface.h"
#include "understory/registration/match_sums.h"
#include "understory/registration/registration.h"
#include "understory/registration/robust_loss.h"
#include "understory/util/config/config.h"

namespace understory {

// Settings of generalised ICP, Segal et al. 2009.
struct GicpConfig {
  double max_distance_m = 0.5;  // farther neighbours are no match
  // A point is taken to lie on its surface to `sigma_m`, and anywhere along it to
  // `along_sigma_m`. Segal et al., section III.B, have 1 and sqrt(1e-3) of it.
  double sigma_m = 0.03;
  double along_sigma_m = 1.0;
  double kernel_sigmas = 3.0;  // scale of the kernel
  RobustLossConfig loss;
  int source_neighbours = 12;  // from which a source point's surface is found
  double max_planarity = 0.1;  // see IcpConfig
  int max_iterations = 30;
  double max_step_m = 0.5;
  double step_translation_m = 1e-3;  // converged when a step is smaller than both
  double step_rotation_rad = 1e-4;
  double degenerate_ratio = 0.003;
  int min_matches = 50;
  double independent_share = 0.05;  // share of the points that counts as independent
};
void describe(ConfigTable& table, GicpConfig& config);

// Generalised ICP, P4 (42) [Segal et al., Generalized-ICP, 2009, (2)]. Each point of source and
// target is a normal distribution that is flat along its surface. The distance of a pair counts in
// the metric of the sum of the two. `surfaces` are the source's, see source_surfaces. Parallel;
// same bits for any number of threads. Thread-safe.
[[nodiscard]] RegistrationResult register_gicp(const IcpMap& target, const Points& source,
                                               const std::vector<SurfacePatch>& surfaces,
                                               const Pose& guess, const PoseTerms& terms,
                                               const GicpConfig& config);

// The surface around each point of a cloud.
[[nodiscard]] std::vector<SurfacePatch> source_surfaces(const Points& source,
                                                        const GicpConfig& config);

// The cost that register_gicp minimises (terms left out). `known`: of each source point, see
// IcpMap::nearest.
[[nodiscard]] MatchSums gicp_cost(const IcpMap& target, const Points& source,
                                  const std::vector<SurfacePatch>& surfaces,
                                  const Pose& target_from_source, const GicpConfig& config,
                                  std::vector<IcpMap::Known>& known);

// Covariance of a point on a surface, m^2.
[[nodiscard]] Eigen::Matrix3d surface_covariance(const SurfacePatch& patch,
                                                 const GicpConfig& config);

}  // namespace understory
