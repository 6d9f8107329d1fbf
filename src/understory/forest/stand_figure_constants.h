#pragma once

#include <cstdint>

// More numbers of forest/stand, of files that few others include: see stand_constants.h.
namespace understory::forest_constants {

namespace stand_errors {  // forest/stand/stand_figures.cc
// m: standard deviation of what all heights are too high or too low by; without it the mean height
// of a plot would be surer than it is [tuned: seeds 3 and 4 of the site handheld, 0.3 m too high]
inline constexpr double kSharedHeightSd = 0.3;
}  // namespace stand_errors

namespace seen_gaps {  // forest/stand/seen_area.cc
// Cells: gaps between sparse returns up to twice as wide are filled [tuned: seeds 9 and 16 of the
// site random, where narrower ones leave mostly the surroundings of stems]
inline constexpr int kFillSparse = 4;
// Returns in half of the cells around: these are not sparse [chosen]
inline constexpr std::uint8_t kNotSparse = 2;
// m beyond the surface of a stem: its returns do not count for the density, or every stem would
// stand where it is dense [chosen]
inline constexpr double kBesideStem = 0.5;
}  // namespace seen_gaps

}  // namespace understory::forest_constants
