#include "understory/simulation/scene/object_field.h"

#include "understory/simulation/scene/fat_ray.h"

namespace understory {
namespace {

Lanes3 turned(const ObjectField::Placement& m, const Lanes3& v) {
  return {v.x * m(0, 0) + v.y * m(0, 1) + v.z * m(0, 2),
          v.x * m(1, 0) + v.y * m(1, 1) + v.z * m(1, 2),
          v.x * m(2, 0) + v.y * m(2, 1) + v.z * m(2, 2)};
}

Lanes3 moved(const ObjectField::Placement& m, const Lanes3& v) {
  const Lanes3 t = turned(m, v);
  return {t.x + m(0, 3), t.y + m(1, 3), t.z + m(2, 3)};
}

}  // namespace

std::uint32_t ObjectField::add(const RayShape& shape, const Placement& world_from_shape) {
  objects_.push_back({&shape, Placement::Zero(), true});
  boxes_.emplace_back();
  parts_.emplace_back();
  const auto object = static_cast<std::uint32_t>(objects_.size() - 1);
  move(object, world_from_shape);
  return object;
}

void ObjectField::move(std::uint32_t object, const Placement& world_from_shape) {
  Object& it = objects_[object];
  const Eigen::Matrix3f turn = world_from_shape.leftCols<3>();
  it.shape_from_world.leftCols<3>() = turn.inverse();
  it.shape_from_world.col(3) = -(it.shape_from_world.leftCols<3>() * world_from_shape.col(3));
  Eigen::AlignedBox3f box;
  Parts& parts = parts_[object];
  const std::array<Eigen::AlignedBox3f, kLanes> inside = it.shape->tree().first_boxes();
  for (std::size_t k = 0; k < kLanes; ++k) {
    constexpr float kSlack = 1e-4F;  // metres, for rounding
    Eigen::AlignedBox3f part;
    if (!inside[k].isEmpty()) {
      const Eigen::Vector3f middle = turn * inside[k].center() + world_from_shape.col(3);
      const Eigen::Vector3f reach = 0.5F * (turn.cwiseAbs() * inside[k].sizes());
      part.min() = (middle - reach).array() - kSlack;
      part.max() = (middle + reach).array() + kSlack;
    }
    box.extend(part);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      parts.planes[axis][k] = part.min()[static_cast<Eigen::Index>(axis)];
      parts.planes[axis + 3][k] = part.max()[static_cast<Eigen::Index>(axis)];
    }
  }
  boxes_[object] = box;
}

void ObjectField::show(std::uint32_t object, bool present) {
  objects_[object].present = present;
}

void ObjectField::commit() {
  tree_.empty() ? void(tree_ = BoxTree(boxes_)) : tree_.refit(boxes_);
}

void ObjectField::cast(const RayLanes& rays, LaneMask active, float near, RayHits& struck) const {
  if (tree_.empty()) return;
  const FatRay beam(rays, active, tree_.frame());
  BoxTree::Frame metres;
  metres.step.fill(1.0F);
  const FatRay world_beam(rays, active, metres);
  const std::vector<std::uint32_t>& order = tree_.order();
  const Lanes none(0.0F);
  float far = largest(select(active, struck.range, none));
  walk(
      tree_, beam, near, far,
      [&](std::uint32_t place) {
        __builtin_prefetch(&objects_[order[place]]);
        for (std::size_t row = 0; row < 6; row += 2)
          __builtin_prefetch(&parts_[order[place]].planes[row]);
      },
      [&](std::uint32_t place, float from) {
        const Object& object = objects_[order[place]];
        if (!object.present) return;
        const LaneMask reaching = active & (Lanes(from) < struck.range);
        if (reaching.bits() == 0) return;
        Entered entered;
        entered.children = world_beam.meet(parts_[order[place]], near, far, entered.ranges);
        if (entered.children == 0) return;
        const RayLanes inside = {moved(object.shape_from_world, rays.origin),
                                 turned(object.shape_from_world, rays.direction), rays.one_origin};
        const Lanes before = struck.range;
        object.shape->cast(inside, reaching, near, struck, &entered);
        const LaneMask nearer = struck.range < before;
        if (nearer.bits() == 0) return;
        struck.object = select(nearer, Lanes(std::bit_cast<float>(order[place])), struck.object);
        far = largest(select(active, struck.range, none));
      });
}

Eigen::Vector3f ObjectField::normal(std::uint32_t object, std::uint32_t primitive,
                                    const Eigen::Vector3f& place_in_world) const {
  const Object& it = objects_[object];
  const Eigen::Vector3f place =
      it.shape_from_world.leftCols<3>() * place_in_world + it.shape_from_world.col(3);
  return it.shape->normal(primitive, place);
}

}  // namespace understory
