#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "understory/forest/stems/stem_detector.h"
#include "understory/forest/tiles/crown_tiles.h"
#include "understory/forest/tiles/stem_tiles.h"

namespace understory {

struct InventoryResult;

// Where the scanner was when a place was in its view, metres, both in the world frame. What stands
// in between is not looked at. Empty: the place was never in view.
using Lookouts = std::function<std::vector<Eigen::Vector3d>(const Eigen::Vector3d& place)>;

// The height of a stem's top as it is listed: NaN where the tree may go on above the view.
[[nodiscard]] double listed_height(const InventoryResult& result, const StemFit& stem, double top_m,
                                   const Lookouts& lookouts);

// Takes posts and people that stand alone out of `result.stems`. They end suddenly below 2.3 m. The
// half metre above their end would show 40 points of a stem that went on; what stands within 10 m
// hides a part of them. The search for stems drops those by itself that have something near them or
// behind them.
void drop_low_ends(const SlicesNear& slices, const StemDetectorConfig& config,
                   const Lookouts& lookouts, InventoryResult& result);

// Says how sure the heights of `result.trees` are, and which are lower bounds:
// Where the view is known (`lookouts`):
// - if the metre above the top would show fewer than two points, did the tree go on as in the metre
//   below. That is their number times the ratio of how well both are seen;
// - if points go on above the top: two or more within four metres, and a tenth of those of the
//   metre below, unless ghosts of other pulses fill the sky as well.
// Of the others some are less sure: that metre would show fewer than twelve, or the half metre
// below the top has fewer than five. Where it is not known:
// - of fewer than five points in the half metre below the top;
// - where tops end with the view (trees/view_limit.h), by their distance from `scanner`, or
//   without that by the number of returns over the diameter.
// Where the ground at the foot was not seen, a height is less sure (GroundModel::unseen).
void judge_tops(const StemTops& tops, const Lookouts& lookouts,
                const std::vector<Eigen::Vector3d>& scanner, InventoryResult& result);

}  // namespace understory
