#pragma once

#include <cstddef>
#include <cstdint>
#include <numbers>

// The fitted and chosen numbers of the layer `features` that are no settings, which stand in the
// Config structs. One namespace for each file that uses them. A comment gives the unit (none: a
// plain number), the meaning, and in brackets where the number comes from:
//   chosen   by judgement, fitted to nothing
//   bound    by physics, geometry, statistics, memory or time
//   tuned    on the recordings named; where none are, on simulated ones with seeds up to 19
// or real clouds and measurements by their page.
// The weights of the score of stems stand in stem_score.cc: benchmarks/stem_score.py fits them and
// writes them there.
namespace understory::features_constants {

namespace ground_guess {  // features/ground_guess.cc
// m: edge of a cell that keeps its lowest return [chosen]
inline constexpr double kCell = 1.5;
// m: edge of a patch that shares one plane [chosen]
inline constexpr double kPatch = 3.0;
// cells to each side of a patch's middle that its plane is fitted to [chosen]
inline constexpr int kReach = 4;
// m/m: slopes of the ground that are expected, one standard deviation [chosen]
inline constexpr double kSlopeSd = 0.15;
// m: scatter of lowest returns about a plane [chosen]
inline constexpr double kRelief = 0.08;
// m: error of a height where the ground shows all around. Feet are 10 to 13 cm off where the fit
// leaves 5 cm open [tuned on lieksa1 to lieksa3, seed 5]
inline constexpr double kLeastSd = 0.1;
// m: what a fit leaves open where feet are off by kLeastSd [tuned on lieksa1 to lieksa3, seed 5]
inline constexpr double kFitSd = 0.05;
// m/m: from there on feet are off six times as much more, as lowest returns that are no ground
// lift the plane [tuned on lieksa1 to lieksa3, seed 5]
inline constexpr double kGrowth = 6.0;
// m: error of a height where the ground hides [chosen]
inline constexpr double kMostSd = 1.0;
}  // namespace ground_guess

namespace ring_view {  // features/ring_view.cc
// m: width of a section at most [bound: stems of forests in use]
inline constexpr double kWidest = 1.0;
// m: what lies no farther behind a section is part of the same thicket [chosen]
inline constexpr double kRoughDepth = 0.5;
// m: returns that near to a place are at it [chosen]
inline constexpr double kDepthMargin = 0.3;
// steps of a ring: so far apart, a return is missing between two [chosen]
inline constexpr float kGap = 1.6F;
// steps of a ring: one lost return does not cut a run [chosen]
inline constexpr float kBridged = 2.6F;
}  // namespace ring_view

namespace stem_chain {  // features/stem_chain.cc
// Squared Mahalanobis distance in the plane within which a section is on a line; chi squared of 2
// degrees, 99.8 % [bound: statistics]
inline constexpr double kGate = 12.0;
// m along a stem without a section [chosen]
inline constexpr double kLongestGap = 3.0;
// Radii by which the mean of a round surface seen from one side lies before the axis [bound:
// geometry, P1 F11]
inline constexpr double kMeanDepth = std::numbers::pi / 4.0;
// m/m: radius lost per metre of height. Seen from one side the surface leans back by pi/4 of
// that, 0.22 degrees [chosen: stems lose 1 cm of diameter a metre]
inline constexpr double kUsualTaper = -0.005;
// m: error of the worst section's centre [chosen]
inline constexpr double kWorstSection = 0.06;
}  // namespace stem_chain

namespace stem_segments {  // features/stem_segments.cc
// rad: lean of stems against up, one standard deviation [chosen]
inline constexpr double kLeanSd = 0.05;
// Usual radii: diameters are told where returns are nearer to each other. Where fewer than three
// fall on a stem its edges are lost more often than not, and it looks thin [chosen, on simulated
// frames]
inline constexpr double kFineSpacing = 0.7;
// m: above this error a diameter says more about the spacing of the beams than about the stem
// [chosen]
inline constexpr double kDiameterKnown = 0.025;
// rad: levels differ enough to look again [chosen]
inline constexpr double kUpMatters = 0.03;
// m above the ground: lowest point of a stem where the ground is unknown [chosen]
inline constexpr double kUsualStart = 0.3;
}  // namespace stem_segments

}  // namespace understory::features_constants
