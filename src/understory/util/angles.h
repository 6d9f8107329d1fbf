#pragma once

#include <numbers>

namespace understory {

inline constexpr double kDegree = std::numbers::pi / 180.0;  // radians
inline constexpr double kTau = 2.0 * std::numbers::pi;       // radians of a full turn
inline constexpr double kDegPerRad = 180.0 / std::numbers::pi;

}  // namespace understory
