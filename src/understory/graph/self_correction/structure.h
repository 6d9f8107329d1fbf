#pragma once

#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"

namespace understory {

// What stands above the ground in a levelled cloud (z up): stems and undergrowth between two
// heights. Ground looks alike everywhere, so agreement on it tells little about the place; stems
// tell. Immutable; thread-safe.
class Structure {
 public:
  // Heights above the ground, metres; `cell_m` is the size of the cells in which points match.
  Structure(const Points& levelled, double low_m, double high_m, double cell_m);

  [[nodiscard]] const Points& points() const { return points_; }

  // Share of `source`'s points, moved by `this_from_source`, that lie in or beside an occupied cell
  // here. The denominator is those that fall where this cloud has seen anything. 0 if fewer than
  // `min_points` do.
  [[nodiscard]] double overlap(const Points& source, const Pose& this_from_source,
                               std::size_t min_points) const;

 private:
  [[nodiscard]] static std::uint64_t column(double x, double y);

  double cell_m_;
  Points points_;
  std::unordered_set<std::uint64_t> cells_;  // dilated by one cell
  std::unordered_set<std::uint64_t> seen_;   // columns with any point
};

}  // namespace understory
