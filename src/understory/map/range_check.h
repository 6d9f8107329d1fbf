#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/map/keyframes/keyframe.h"
#include "understory/registration/range_offset/range_offset.h"
#include "understory/util/config/config.h"

namespace understory {

// How views of one place are paired to tell whether all ranges are wrong by a constant.
struct RangeCheckConfig {
  bool enabled = true;
  int max_pairs = 40;        // of views; more cost time and tell little more
  double apart_m = 6.0;      // between the views of a pair
  double view_half_m = 1.5;  // keyframes up to there before and after make a view
  RangeOffsetConfig pair;
};
void describe(ConfigTable& table, RangeCheckConfig& config);

// The i-th keyframe's points in its body frame. Thread-safe.
using PointsOfKeyframe = std::function<std::shared_ptr<const Points>(std::size_t)>;

// By how much all ranges seem to be too long.
struct RangeCheck {
  int pairs = 0;  // that told something; 0: nothing else holds
  double offset_m = 0.0;
  double standard_error_m = 0.0;  // from how far pairs differ
};

// Pairs of keyframes (earlier, later) to look at: `apart_m` apart, in one segment, spread over the
// run. `segment_starts`: first keyframe of each segment, in order.
[[nodiscard]] std::vector<std::pair<std::size_t, std::size_t>> pairs_of_views(
    std::span<const Keyframe> keyframes, std::span<const std::uint64_t> segment_starts,
    const RangeCheckConfig& config);

// One estimate of those of all pairs, each weighted by its own variance and that between pairs
// (random effects: DerSimonian and Laird, Control. Clin. Trials 7, 1986). Those that lie far from
// the middle of the others count no more.
[[nodiscard]] RangeCheck combine(const std::vector<RangeOffset>& pairs);

// Whether the ranges of a finished run are too long or too short, from pairs of views of the same
// surfaces. The same bits for any number of threads.
//   lidar_in_body: where the beams begin, metres
[[nodiscard]] RangeCheck check_ranges(std::span<const Keyframe> keyframes,
                                      std::span<const std::uint64_t> segment_starts,
                                      const PointsOfKeyframe& points,
                                      const Eigen::Vector3d& lidar_in_body,
                                      const RangeCheckConfig& config);

}  // namespace understory
