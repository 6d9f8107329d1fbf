#include "understory/simulation/scene/scene_bundles.h"

#include <algorithm>
#include <array>
#include <bit>

#include "understory/util/error.h"

namespace understory {
namespace {

// Numbers that no instance has.
constexpr std::uint32_t kNone = ~0U;
constexpr std::uint32_t kSurfaces = ~0U - 1;
constexpr std::uint32_t kRods = ~0U - 2;

Lanes bits(std::uint32_t number) {
  return {std::bit_cast<float>(number)};
}

// The last ray fills the lanes that are left over.
RayLanes lanes_of(const Ray* rays, std::size_t count) {
  std::array<std::array<float, kLanes>, 6> values;
  for (std::size_t i = 0; i < kLanes; ++i) {
    const Ray& ray = rays[std::min(i, count - 1)];
    for (std::size_t k = 0; k < 3; ++k) {
      values[k][i] = ray.origin[static_cast<Eigen::Index>(k)];
      values[k + 3][i] = ray.direction[static_cast<Eigen::Index>(k)];
    }
  }
  const auto of = [&](std::size_t k) { return Lanes::load(values[k].data()); };
  const bool one_origin =
      std::all_of(rays, rays + count, [&](const Ray& ray) { return ray.origin == rays->origin; });
  return {{of(0), of(1), of(2)}, {of(3), of(4), of(5)}, one_origin};
}

}  // namespace

void SceneBundles::add_part(unsigned geometry, const Shape& triangles) {
  triangle_parts_.push_back({geometry, static_cast<unsigned>(triangles_.triangles.size())});
  const auto first = static_cast<int>(triangles_.vertices.size());
  triangles_.vertices.insert(triangles_.vertices.end(), triangles.vertices.begin(),
                             triangles.vertices.end());
  for (const Eigen::Vector3i& corners : triangles.triangles)
    triangles_.triangles.push_back(corners + Eigen::Vector3i::Constant(first));
}

void SceneBundles::add_part(unsigned geometry, const Cones& cones) {
  cone_parts_.push_back({geometry, static_cast<unsigned>(cones_.first.size())});
  const auto first = static_cast<unsigned>(cones_.points.size());
  cones_.points.insert(cones_.points.end(), cones.points.begin(), cones.points.end());
  for (const unsigned point : cones.first)
    cones_.first.push_back(first + point);
}

void SceneBundles::add_shape(const void* key, RayShape shape) {
  shapes_[key] = std::make_unique<RayShape>(std::move(shape));
}

void SceneBundles::add_instance(unsigned instance, const void* key,
                                const ObjectField::Placement& world_from_shape) {
  const auto found = shapes_.find(key);
  UNDERSTORY_CHECK(found != shapes_.end());
  UNDERSTORY_CHECK(field_.add(*found->second, world_from_shape) == instance);
}

void SceneBundles::finish() {
  surfaces_ = std::make_unique<RayShape>(triangles_);
  triangles_ = {};
  rods_ = std::make_unique<RayShape>(cones_);
  cones_ = {};
  field_.commit();
}

void SceneBundles::cast(const Ray* rays, std::size_t count, float near_m, float far_m,
                        Met* met) const {
  const RayLanes lanes = lanes_of(rays, count);
  const LaneMask all = Lanes(0.0F) <= Lanes(0.0F);
  RayHits struck{far_m, bits(kNone), bits(kNone)};
  // First what stands in the way most surely: leaves behind it need not be looked for.
  const auto meet_fixed = [&](const RayShape& shape, std::uint32_t object) {
    const Lanes before = struck.range;
    shape.cast(lanes, all, near_m, struck);
    struck.object = select(struck.range < before, bits(object), struck.object);
  };
  meet_fixed(*surfaces_, kSurfaces);
  meet_fixed(*rods_, kRods);
  field_.cast(lanes, all, near_m, struck);
  std::array<float, kLanes> ranges;
  std::array<float, kLanes> objects;
  std::array<float, kLanes> primitives;
  struck.range.store(ranges.data());
  struck.object.store(objects.data());
  struck.primitive.store(primitives.data());
  for (std::size_t i = 0; i < count; ++i) {
    met[i] = read(std::bit_cast<std::uint32_t>(objects[i]),
                  std::bit_cast<std::uint32_t>(primitives[i]), ranges[i], rays[i]);
  }
}

Met SceneBundles::read(std::uint32_t object, std::uint32_t primitive, float range_m,
                       const Ray& ray) const {
  if (object == kNone) return {};
  const Eigen::Vector3f place = ray.origin + range_m * ray.direction;
  if (object != kSurfaces && object != kRods)
    return {range_m, field_.normal(object, primitive, place), object, 0, primitive};
  const bool surface = object == kSurfaces;
  const std::vector<Part>& parts = surface ? triangle_parts_ : cone_parts_;
  const auto part = std::find_if(parts.rbegin(), parts.rend(),
                                 [&](const Part& it) { return it.first <= primitive; });
  return {range_m, (surface ? *surfaces_ : *rods_).normal(primitive, place), Met::kNothing,
          part->geometry, primitive - part->first};
}

}  // namespace understory
