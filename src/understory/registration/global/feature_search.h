#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"

namespace understory {

// A corner or an end of something, and what lies around it. The descriptor is a spin image about
// the vertical (Johnson and Hebert, Using Spin Images for Efficient Object Recognition, 1999,
// section 2). Levelled frame of its cloud, metres.
struct LocalFeature {
  static constexpr std::size_t kRadii = 6;
  static constexpr std::size_t kHeights = 8;
  using Image = std::array<float, kRadii * kHeights>;

  Eigen::Vector3d at = Eigen::Vector3d::Zero();
  Image image{};  // unit length
};

// The corners and ends of what stands above the ground; plain walls have none between these.
// `points`: levelled, thinned evenly; `above_m`: their heights above the ground. At most `most`,
// spread evenly. Thread-safe, deterministic.
[[nodiscard]] std::vector<LocalFeature> find_local_features(const Points& points,
                                                            const std::vector<float>& above_m,
                                                            std::size_t most);

// A motion on which pairs of features that look alike agree.
struct FeatureMatch {
  Pose target_from_source;  // a turn about z and a shift
  int matched = 0;          // pairs that lie on each other
};

// Motions that bring features onto features that look alike, anywhere and at any heading; the best
// first, at most `most`. Of the features that are each other's most alike, pairs as far apart in
// both clouds are consistent. Those with the most consistent pairs in common (Chen et al., SC2-PCR,
// 2022, (4)) begin a fit each. Thread-safe, deterministic.
[[nodiscard]] std::vector<FeatureMatch> match_local_features(
    const std::vector<LocalFeature>& target, const std::vector<LocalFeature>& source,
    std::size_t most);

}  // namespace understory
