#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "understory/simulation/scene/box_tree.h"
#include "understory/simulation/scene/ray_shape.h"

namespace understory {

// Many objects, each a shape placed somewhere, for casting beams at. Casting is thread-safe,
// everything else is not.
class ObjectField {
 public:
  using Placement = Eigen::Matrix<float, 3, 4>;  // world from shape

  // The shape must outlive the field. Returns the object's number; before `commit` it is not there.
  std::uint32_t add(const RayShape& shape, const Placement& world_from_shape);
  void move(std::uint32_t object, const Placement& world_from_shape);
  void show(std::uint32_t object, bool present);
  // Makes the above hold. What the field looks like depends on where its objects are, not on where
  // they were. How fast it is depends on where they were at the first commit.
  void commit();

  // As RayShape::cast; struck.object is the number of what was met.
  void cast(const RayLanes& rays, LaneMask active, float near, RayHits& struck) const;

  [[nodiscard]] Eigen::Vector3f normal(std::uint32_t object, std::uint32_t primitive,
                                       const Eigen::Vector3f& place_in_world) const;

 private:
  struct Object {
    const RayShape* shape;
    Placement shape_from_world;
    bool present;
  };

  // The boxes of the first parts of an object's tree in the world, as those of a node. A ray that
  // meets none of them need not be turned into the shape's frame.
  struct Parts {
    std::array<std::array<float, kLanes>, 6> planes;
  };

  std::vector<Object> objects_;
  std::vector<Parts> parts_;
  std::vector<Eigen::AlignedBox3f> boxes_;
  BoxTree tree_;
};

}  // namespace understory
