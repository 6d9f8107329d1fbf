#pragma once

#include <cstddef>
#include <cstdint>

// More numbers of forest/stand, of files that few others include: see stand_constants.h.
namespace understory::forest_constants {

namespace stand_errors {  // forest/stand/stand_figures.cc
// m: standard deviation of the error that all heights share. Without it the mean height of a plot
// would seem too certain [tuned: seeds 3 and 4 of the site handheld, 0.3 m too high]
inline constexpr double kSharedHeightSd = 0.3;
// Standard deviation of the error of a stand's height curve beyond its fit, as a share of the
// height. It holds where all tops of the plot are hidden, else in proportion to their share [tuned:
// random seeds 4, 8, 9, 14, 16, handheld seed 3: -20 to +5 %]
inline constexpr double kCurveBias = 0.1;
// Share of the standard deviation of a diameter that all diameters of a stand have in common. It is
// what the correction of wide beams and noise leaves at a site [tuned: the biases of 20 sites of
// random, docs/method/forest-experiments.md, long walks]
inline constexpr double kSharedDiameter = 0.4;
}  // namespace stand_errors

namespace expected_diameters {  // forest/stand/expected_diameters.cc
// m: standard deviation of the diameters of a stand that the search begins with [chosen]
inline constexpr double kFirstSpread = 0.05;
// m: the same at least [chosen]
inline constexpr double kLeastSpread = 0.003;
// Rounds in which mean and variance are found [bound: convergence]
inline constexpr int kRounds = 20;
// The same for which stems are sure [bound: convergence]
inline constexpr int kSureRounds = 5;
// Of the variance of a stand's diameters: that of the error of a sure one, at most [chosen: 0.1 and
// 0.03 were tried on random seeds 1, 4, 5, 9, 13 and 16]
inline constexpr double kSureShare = 0.1;
// Sure stems at least [chosen: the mean is known to a quarter of the spread]
inline constexpr std::size_t kFewestSure = 15;
}  // namespace expected_diameters

namespace seen_gaps {  // forest/stand/seen_area.cc
// Cells: gaps between sparse returns up to twice as wide are filled [tuned: seeds 9 and 16 of the
// site random: rings of a lidar with 16 or 32 beams leave such gaps on the ground]
inline constexpr int kFillSparse = 8;
// Returns in half of the cells around: these are not sparse [chosen]
inline constexpr std::uint8_t kNotSparse = 2;
// m beyond the surface of a stem: its returns do not count for the density, or every stem would
// stand where it is dense [chosen]
inline constexpr double kBesideStem = 0.5;
// Least share of the cells around that hold a return, over its median in the cloud. A thinned cloud
// shows stems with fewer returns on the ground [real clouds: one has 8 of them per square metre]
inline constexpr double kOfMedian = 0.25;
// The least such share, one return on two square metres [chosen]
inline constexpr double kThinnedShare = 0.03;
}  // namespace seen_gaps

}  // namespace understory::forest_constants
