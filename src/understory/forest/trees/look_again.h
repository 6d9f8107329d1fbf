#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "understory/forest/trees/tree_sheets.h"

namespace understory {

// A stem as one looks for it through the stand, metres.
struct StandingStem {
  Eigen::Vector2d place = Eigen::Vector2d::Zero();  // at breast height
  double radius_m = 0.0;
  bool weak = false;  // its diameter is to be measured again
  SeenSides seen;     // of a weak one
};

// A place from where weak stems show a side that was not seen yet.
struct LookPlace {
  Eigen::Vector2d place = Eigen::Vector2d::Zero();
  std::vector<std::size_t> stems;  // numbers of the weak ones, nearest first
};

// A few places to stand at, so that the weak stems are seen again from their unseen sides. Each is
// within 2 to 8 m of its stems, with no other stem between, outside of all stems, and where
// `walkable` is true. A stem that was seen all round has too few points, and any side of it counts.
// Places come by the number of stems that no place before them shows. Those that show fewer than
// two of them are left out, unless there is no other. Greedy cover of sets: at most 1 + ln n times
// as many places as are needed for n stems. Deterministic.
[[nodiscard]] std::vector<LookPlace> places_to_look(
    const std::vector<StandingStem>& stems,
    const std::function<bool(const Eigen::Vector2d&)>& walkable);

// Degrees of the circumference of a stem that are yet unseen and would show from a place. A place
// shows 62 degrees on both sides of the direction to it.
[[nodiscard]] int newly_seen_deg(const StandingStem& stem, const Eigen::Vector2d& from);

// Whether so little of a stem was seen that another side of it is wanted; else it was seen all
// round, and lacks points.
[[nodiscard]] bool lacks_a_side(const StandingStem& stem);

}  // namespace understory
