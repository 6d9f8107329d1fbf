#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "understory/registration/gaussian/gaussian_match.h"
#include "understory/registration/icp/icp_map.h"
#include "understory/registration/loam/ring_features.h"
#include "understory/registration/matcher.h"
#include "understory/util/config/config.h"

namespace understory {

// What LOAM and LeGO-LOAM's method set. The map has edges and planes apart, each as ICP has it,
// with the covariance of the surroundings of each point.
struct LoamConfig {
  RingFeaturesConfig features;
  double max_distance_m = 0.5;  // farther neighbours are no match
  double line_ratio = 3.0;      // largest over middle variance of edges that make a line, at least
  double plane_ratio = 0.1;     // smallest through middle variance of a plane, at most
  GaussianStepsConfig steps;
  IcpMapConfig map;
  // Where the guess may be far off, matching begins with these; 0: as it goes on.
  double far_distance_m = 1.0;
  double far_kernel_sigmas = 15.0;
  int rounds = 3;  // loam_ground: ground, then edges, so many times at most
};

// LOAM (Zhang and Singh 2014; P4 (39)): edges to lines and planes to planes of the map.
struct LoamMatcherConfig {
  static constexpr const char* kName = "loam";
  static constexpr const char* kSummary = "edges and planes by the rings of a scan";
  static constexpr FitnessNoise kFitnessNoise{0.013, 320.0};

  LoamConfig loam;
};
// See MatcherConfigs.
void describe(ConfigTable& table, LoamMatcherConfig& config);
[[nodiscard]] std::unique_ptr<const Matcher> make_matcher(const LoamMatcherConfig& config);
[[nodiscard]] std::vector<SuitedSetting> suited_settings(const LoamMatcherConfig& config,
                                                         const ScanTraits& traits);

// LeGO-LOAM's method (Shan and Englot 2018, section III): ground first, for height, roll and pitch;
// then edges, for the place in the plane and the heading.
struct LoamGroundMatcherConfig {
  static constexpr const char* kName = "loam_ground";
  static constexpr const char* kSummary = "ground and edges in two steps";
  static constexpr FitnessNoise kFitnessNoise{0.013, 320.0};  // of LOAM

  LoamConfig loam;
};
// See MatcherConfigs.
void describe(ConfigTable& table, LoamGroundMatcherConfig& config);
[[nodiscard]] std::unique_ptr<const Matcher> make_matcher(const LoamGroundMatcherConfig& config);
[[nodiscard]] std::vector<SuitedSetting> suited_settings(const LoamGroundMatcherConfig& config,
                                                         const ScanTraits& traits);

// What a map of features is made of. Ground meets ground alone with LeGO-LOAM's method (section
// III.D); with LOAM `ground` is `planes`.
struct LoamMaps {
  IcpMapPtr edges;
  IcpMapPtr planes;
  IcpMapPtr ground;
  [[nodiscard]] std::size_t size() const {
    return edges->size() + planes->size() + (ground == planes ? 0 : ground->size());
  }
  [[nodiscard]] const IcpMap& of(PointFeature feature) const {
    if (feature == PointFeature::kEdge) return *edges;
    return feature == PointFeature::kGround ? *ground : *planes;
  }
};

// The maps with the distances of one stage; see internal::GaussianAccumulator. The source has
// features.
class LoamTarget {
 public:
  static constexpr bool kExactGradient = false;
  struct Known {
    IcpMap::Known search;
    std::uint32_t of = UINT32_MAX;  // the point that `rows` belong to
    bool tells = false;
    Eigen::Matrix3d rows = Eigen::Matrix3d::Zero();
  };

  LoamTarget(LoamMaps maps, const LoamConfig& config) : maps_(std::move(maps)), config_(config) {}
  [[nodiscard]] std::size_t size() const { return maps_.size(); }
  // Lines across and planes along their normal, in units of `sigma_m`: LOAM (2, 3).
  [[nodiscard]] bool pair(const GaussianSource& source, std::size_t i, const Eigen::Vector3d& at,
                          const Eigen::Matrix3d& rotation, Known& known, GaussianPair& pair) const;
  [[nodiscard]] double most_squared() const {
    return config_.max_distance_m * config_.max_distance_m / noise_m2();
  }
  [[nodiscard]] double noise_m2() const { return config_.steps.sigma_m * config_.steps.sigma_m; }

 private:
  LoamMaps maps_;
  LoamConfig config_;
};

}  // namespace understory
