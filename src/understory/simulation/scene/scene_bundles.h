#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <memory>
#include <unordered_map>
#include <vector>

#include "understory/simulation/scene/object_field.h"
#include "understory/simulation/scene/ray_shape.h"
#include "understory/simulation/scene/scene.h"

namespace understory {

// What a ray meets first, as the caster found it.
struct Met {
  static constexpr unsigned kNothing = ~0U;

  float range_m = std::numeric_limits<float>::infinity();  // as if no ray met anything
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  // of any length, in the frame of the shape
  unsigned instance = kNothing;                      // none: a part of the fixed scene
  unsigned geometry = kNothing;                      // of the fixed scene or of the shape
  unsigned primitive = kNothing;                     // of the geometry
};

// A scene for casting whole beams: fixed parts, and instances of shapes. Built once in any order,
// then `finish`. Casting is thread-safe.
class SceneBundles {
 public:
  // Parts of the fixed scene, at most once for each number of a geometry.
  void add_part(unsigned geometry, const Shape& triangles);
  void add_part(unsigned geometry, const Cones& cones);
  // `key` is any name that add_instance then uses.
  void add_shape(const void* key, RayShape shape);
  // Numbers of instances follow each other from 0.
  void add_instance(unsigned instance, const void* key,
                    const ObjectField::Placement& world_from_shape);
  void finish();

  // The field of instances, to be moved and shown between casts.
  [[nodiscard]] ObjectField& field() { return field_; }

  // What rays meet in [near_m, far_m]; at most eight that go nearly the same way.
  void cast(const Ray* rays, std::size_t count, float near_m, float far_m, Met* met) const;

 private:
  // Geometries of one kind in one shape: the numbers of primitives of each begin at `first`.
  struct Part {
    unsigned geometry;
    unsigned first;
  };
  [[nodiscard]] Met read(std::uint32_t object, std::uint32_t primitive, float range_m,
                         const Ray& ray) const;

  Shape triangles_;
  Cones cones_;
  std::vector<Part> triangle_parts_;
  std::vector<Part> cone_parts_;
  std::unique_ptr<RayShape> surfaces_;  // of triangles_
  std::unique_ptr<RayShape> rods_;      // of cones_
  std::unordered_map<const void*, std::unique_ptr<RayShape>> shapes_;
  ObjectField field_;
};

}  // namespace understory
