#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "understory/registration/gaussian/gaussian_match.h"
#include "understory/registration/icp/icp_map.h"
#include "understory/registration/matcher.h"
#include "understory/util/config/config.h"

namespace understory {

// What both methods of P3 (3-5) set. Targets are maps as ICP has them, with the covariance of the
// surroundings of each point.
struct GaussianIcpConfig {
  double max_distance_m = 0.5;  // farther neighbours are no match
  GaussianStepsConfig steps;
  int source_neighbours = 12;  // Gaussian to Gaussian: from which a source covariance is found
  IcpMapConfig map;
  // Where the guess may be far off, matching begins with these; 0: as it goes on.
  double far_distance_m = 1.0;
  double far_kernel_sigmas = 15.0;
};

// Points of the source to Gaussians of the target, P3 (3), as three point-to-plane terms (5).
struct PointToGaussianConfig {
  static constexpr const char* kName = "point_to_gaussian";
  static constexpr const char* kSummary = "nearest points, as three planes each";
  static constexpr FitnessNoise kFitnessNoise{0.015, 860.0};  // of GICP

  GaussianIcpConfig icp;
};
// See MatcherConfigs.
void describe(ConfigTable& table, PointToGaussianConfig& config);
[[nodiscard]] std::unique_ptr<const Matcher> make_matcher(const PointToGaussianConfig& config);
[[nodiscard]] std::vector<SuitedSetting> suited_settings(const PointToGaussianConfig& config,
                                                         const ScanTraits& traits);

// The same with W of (5) the sum of both covariances, the source's rotated.
struct GaussianToGaussianConfig {
  static constexpr const char* kName = "gaussian_to_gaussian";
  static constexpr const char* kSummary = "the same, the source's surroundings too";
  static constexpr FitnessNoise kFitnessNoise{0.015, 860.0};  // of GICP

  GaussianIcpConfig icp;
};
// See MatcherConfigs.
void describe(ConfigTable& table, GaussianToGaussianConfig& config);
[[nodiscard]] std::unique_ptr<const Matcher> make_matcher(const GaussianToGaussianConfig& config);
[[nodiscard]] std::vector<SuitedSetting> suited_settings(const GaussianToGaussianConfig& config,
                                                         const ScanTraits& traits);

// The target of both, over a map with covariances: see internal::GaussianAccumulator.
class GaussianIcpTarget {
 public:
  static constexpr bool kExactGradient = false;  // W is that of the step, as in P3 section 3.1
  struct Known {
    IcpMap::Known search;
    std::uint32_t of = UINT32_MAX;  // the point that `rows` belong to
    Eigen::Matrix3d rows = Eigen::Matrix3d::Zero();
  };

  // `source_too`: the source's points are Gaussians as well.
  GaussianIcpTarget(IcpMapPtr map, const GaussianIcpConfig& config, bool source_too)
      : map_(std::move(map)),
        source_neighbours_(source_too ? config.source_neighbours : 0),
        max_distance_m_(config.max_distance_m),
        variance_(config.steps.sigma_m * config.steps.sigma_m) {}
  [[nodiscard]] std::size_t size() const { return map_->size(); }
  [[nodiscard]] GaussianSource source_of(const Points& points) const;
  [[nodiscard]] bool pair(const GaussianSource& source, std::size_t i, const Eigen::Vector3d& at,
                          const Eigen::Matrix3d& rotation, Known& known, GaussianPair& pair) const;
  [[nodiscard]] double most_squared() const {
    return max_distance_m_ * max_distance_m_ / variance_;
  }
  [[nodiscard]] double noise_m2() const { return variance_; }

 private:
  IcpMapPtr map_;
  int source_neighbours_;  // 0: the source's points are points
  double max_distance_m_;
  double variance_;  // m^2
};

}  // namespace understory
