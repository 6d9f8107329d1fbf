#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <vector>

#include "understory/simulation/scene/crown_shapes.h"
#include "understory/simulation/site.h"
#include "understory/simulation/stand/stand.h"

namespace understory {

// The true crown of a tree. NaN where it has none, or where its shape is not known.
struct TrueCrown {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

  double base_m = kUnknown;   // above the foot: where the lowest living branch leaves the stem
  double area_m2 = kUnknown;  // of the convex outline of the living crown, seen from above
  double volume_m3 =
      kUnknown;  // sum of the convex outlines of layers of 25 cm times their thickness
};

// The crowns of a stand without wind, measured from the shapes that a scene of the same stand and
// seed is made of. Dead branches do not count. Immutable, thread-safe.
class TrueCrowns {
 public:
  TrueCrowns(const StandConfig& config, std::uint64_t seed);
  [[nodiscard]] TrueCrown of(const GrownTree& tree) const;

 private:
  // The corners of the outline of each layer, in the frame of the shape.
  using Layers = std::vector<std::vector<Eigen::Vector3f>>;

  std::vector<GrownCrown> crowns_;  // without their triangles
  std::vector<Layers> layers_;      // of each of them
};

// The corners of the convex outline of places in the plane, against the clock. Fewer than three
// where they have no area.
[[nodiscard]] std::vector<Eigen::Vector2d> convex_outline(std::vector<Eigen::Vector2d> places);

// The area inside of corners that go around against the clock.
[[nodiscard]] double polygon_area(const std::vector<Eigen::Vector2d>& corners);

}  // namespace understory
