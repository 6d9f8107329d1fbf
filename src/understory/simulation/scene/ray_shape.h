#pragma once

#include <cstdint>
#include <span>
#include <variant>
#include <vector>

#include "understory/simulation/scene/box_tree.h"
#include "understory/simulation/scene/primitives.h"
#include "understory/simulation/scene/scene_geometry.h"

namespace understory {

// A shape that beams are cast at, eight rays at a time: primitives of one kind and the tree of
// their boxes. Immutable, thread-safe.
class RayShape {
 public:
  explicit RayShape(const Shape& triangles);
  explicit RayShape(const Cones& cones);
  explicit RayShape(const std::vector<TreeCloud::Disc>& discs);

  // Lowers struck.range where the rays of `active` meet something between `near` and it.
  // struck.primitive is then its number in the shape that this was made of. What is known of the
  // root of tree() may be given.
  void cast(const RayLanes& rays, LaneMask active, float near, RayHits& struck,
            const Entered* entered = nullptr) const;

  // Of any length; `place` is on the primitive.
  [[nodiscard]] Eigen::Vector3f normal(std::uint32_t primitive, const Eigen::Vector3f& place) const;

  [[nodiscard]] const BoxTree& tree() const { return tree_; }

 private:
  // make(number) gives a primitive.
  template <class Make>
  void plant_tree(const std::vector<Eigen::AlignedBox3f>& boxes, const Make& make);

  BoxTree tree_;
  // In the order of the tree's leaves.
  std::variant<std::vector<Triangle>, std::vector<RoundCone>, std::vector<Disc>> primitives_;
  std::vector<std::uint32_t> places_;  // of each primitive in the above
};

}  // namespace understory
