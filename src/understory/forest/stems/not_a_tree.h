#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>

#include "understory/forest/stems/stem_detector.h"

namespace understory {

// Why what looks like a stem is none.
enum class TreeDoubt : std::uint8_t {
  kNone,        // nothing speaks against it
  kEndsLow,     // a post, a person: it ends below 2.3 m, where things around it go on
  kPartOfPlane  // a wall or its corner: its surface goes on beside it as a vertical plane
};

// Calls the visitor for each point of the slices whose x and y are within `reach` (m) of `centre`;
// others may come, too.
using PointsNear = std::function<void(const Eigen::Vector2d& centre, double reach,
                                      const std::function<void(const SlicePoint&)>& visit)>;

// What the points around a fitted stem say against it, by the numbers of
// stem_constants::not_a_tree (docs/method/forest.md, Stems). `near` gives the points that the stem
// was found in, in its frame: metres, heights above the ground from config.lowest_m to
// config.highest_m. Without points above a stem's end, near it or around it, nothing is said: they
// may be out of view.
[[nodiscard]] TreeDoubt doubt_of(const StemFit& stem, const PointsNear& near,
                                 const StemDetectorConfig& config);

// A stem that ends suddenly below 2.3 m with nothing above its end: how many points it has in its
// last half metre. A stem that went on would show as many in the next one, were that as well in
// view. 0: it goes on, ends gradually, within foliage or higher up. `near` as above.
[[nodiscard]] int points_before_sudden_end(const StemFit& stem, const PointsNear& near,
                                           const StemDetectorConfig& config);

}  // namespace understory
