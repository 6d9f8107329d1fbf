#include "understory/simulation/scene/ray_shape.h"

namespace understory {

// The primitives come after the tree, in its order: while it is built there is nothing but boxes.
template <class Make>
void RayShape::plant_tree(const std::vector<Eigen::AlignedBox3f>& boxes, const Make& make) {
  tree_ = BoxTree(boxes);
  std::vector<decltype(make(0U))> ordered;
  ordered.reserve(boxes.size());
  places_.resize(boxes.size());
  for (const std::uint32_t number : tree_.order()) {
    places_[number] = static_cast<std::uint32_t>(ordered.size());
    ordered.push_back(make(number));
  }
  primitives_ = std::move(ordered);
}

RayShape::RayShape(const Shape& triangles) {
  const auto corner = [&](std::size_t number, int i) {
    return triangles.vertices[static_cast<std::size_t>(triangles.triangles[number][i])];
  };
  std::vector<Eigen::AlignedBox3f> boxes(triangles.triangles.size());
  for (std::size_t i = 0; i < boxes.size(); ++i)
    boxes[i].extend(corner(i, 0)).extend(corner(i, 1)).extend(corner(i, 2));
  plant_tree(boxes, [&](std::uint32_t number) {
    return Triangle(corner(number, 0), corner(number, 1), corner(number, 2));
  });
}

RayShape::RayShape(const Cones& cones) {
  const auto make = [&](std::uint32_t number) {
    const Vertex4& low = cones.points[cones.first[number]];
    const Vertex4& high = cones.points[cones.first[number] + 1];
    return RoundCone(Eigen::Vector3f(low.x, low.y, low.z), low.radius,
                     Eigen::Vector3f(high.x, high.y, high.z), high.radius);
  };
  std::vector<Eigen::AlignedBox3f> boxes(cones.first.size());
  for (std::size_t i = 0; i < boxes.size(); ++i)
    boxes[i] = make(static_cast<std::uint32_t>(i)).box();
  plant_tree(boxes, make);
}

RayShape::RayShape(const std::vector<TreeCloud::Disc>& discs) {
  const auto make = [&](std::uint32_t number) {
    return Disc{discs[number].centre, discs[number].normal, discs[number].radius_m};
  };
  std::vector<Eigen::AlignedBox3f> boxes(discs.size());
  for (std::size_t i = 0; i < boxes.size(); ++i)
    boxes[i] = make(static_cast<std::uint32_t>(i)).box();
  plant_tree(boxes, make);
}

void RayShape::cast(const RayLanes& rays, LaneMask active, float near, RayHits& struck,
                    const Entered* entered) const {
  const FatRay beam(rays, active, tree_.frame());
  std::visit(
      [&](const auto& primitives) {
        const std::vector<std::uint32_t>& order = tree_.order();
        float far = largest(select(active, struck.range, Lanes(0.0F)));
        walk(
            tree_, beam, near, far,
            [&](std::uint32_t place) { __builtin_prefetch(&primitives[place]); },
            [&](std::uint32_t place, float) {
              if (primitives[place].meet(rays, near, order[place], struck)) {
                far = largest(select(active, struck.range, Lanes(0.0F)));
              }
            },
            entered);
      },
      primitives_);
}

Eigen::Vector3f RayShape::normal(std::uint32_t primitive, const Eigen::Vector3f& place) const {
  return std::visit(
      [&](const auto& primitives) -> Eigen::Vector3f {
        return primitives[places_[primitive]].normal(place);
      },
      primitives_);
}

}  // namespace understory
