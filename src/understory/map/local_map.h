#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "understory/geometry/feature_points.h"
#include "understory/geometry/pose.h"
#include "understory/registration/matchers.h"
#include "understory/util/config/config.h"

namespace understory {

// Which keyframes make the map that scans are matched to.
struct LocalMapConfig {
  // The method that scans are matched to the map by, and what the map is made of for it.
  MatcherConfig matcher;
  Viewpoint viewpoint;  // of the keyframes
  // Accumulate: every keyframe within the radius stays, however old. Recent: only the last
  // keyframes, thinned by a voxel grid of their positions (P4 section 3.1.1, Local Map).
  enum class Method { kAccumulate, kRecent };
  Method method = Method::kAccumulate;
  double radius_m = 80.0;         // accumulate: what is farther from the body is forgotten
  int recent_keyframes = 15;      // recent: theta_lm
  double recent_spacing_m = 2.0;  // recent: one keyframe per cube of this edge
  // Accumulate: bytes that it may take; where the map takes more, its radius becomes smaller. 0:
  // any. By the limit of the memory of the run, no setting of its own.
  double most_bytes = 0.0;
};
// Without the matcher, whose section stands by itself.
void describe(ConfigTable& table, LocalMapConfig& config);

// A keyframe's thinned cloud and where it is.
struct PlacedPoints {
  const FeaturePoints* points_in_body = nullptr;
  Pose world_from_body;
};

// One keyframe that went into a local map; `forget` as in LocalMap::insert. (64-bit, so that
// there is no padding in a checkpoint.)
struct LocalMapInsertion {
  std::uint64_t keyframe = 0;
  std::uint64_t forget = 0;
};

// The map around the carrier that scans are matched to: what the matcher makes of keyframes. Hands
// out immutable snapshots that stay valid while it goes on. Not thread-safe itself.
class LocalMap {
 public:
  // Throws ConfigError for settings of the matcher that cannot be.
  explicit LocalMap(const LocalMapConfig& config);

  // Adds a keyframe and, if `forget`, drops what is too far from it. Then, too, the radius becomes
  // smaller where the map takes more than `most_bytes`, and larger again where it takes far less.
  void insert(const PlacedPoints& keyframe, bool forget);
  void clear();
  // What it takes, about (TargetBuilder::bytes).
  [[nodiscard]] double bytes() const { return builder_->bytes(); }
  // The present radius, and the radius of the map when it was empty. An empty map with that radius
  // and the same insertions becomes the same map again.
  [[nodiscard]] double radius_m() const { return radius_m_; }
  [[nodiscard]] double first_radius_m() const { return first_radius_m_; }
  // Of an empty map.
  void set_radius(double radius_m) { radius_m_ = first_radius_m_ = radius_m; }
  [[nodiscard]] MatchTargetPtr snapshot();

 private:
  void fit(const Eigen::Vector3d& place);

  double most_radius_m_;
  double most_bytes_;
  double radius_m_;
  double first_radius_m_;
  std::unique_ptr<TargetBuilder> builder_;
};

// Which of the keyframes at these positions (oldest first) P4's local map is made of. Of the most
// recent `recent_keyframes` (or all, if fewer) it is the one nearest to the mean of each cube of
// `recent_spacing_m`.
[[nodiscard]] std::vector<std::size_t> recent_keyframes(
    const std::vector<Eigen::Vector3d>& positions, const LocalMapConfig& config);

// All keyframes, of those at these positions, that lie within the radius of the last one, as
// insertions into an empty map. `first` is the index of the first position.
[[nodiscard]] std::vector<LocalMapInsertion> keyframes_within_reach(
    const std::vector<Eigen::Vector3d>& positions, std::size_t first, double radius_m);

}  // namespace understory
