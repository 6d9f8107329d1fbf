#include "understory/simulation/ray_shape.h"

namespace understory {

template <class Kind>
void RayShape::plant_tree(const std::vector<Kind>& primitives,
                          const std::vector<Eigen::AlignedBox3f>& boxes) {
  tree_ = BoxTree(boxes);
  std::vector<Kind> ordered;
  ordered.reserve(primitives.size());
  places_.resize(primitives.size());
  for (const std::uint32_t number : tree_.order()) {
    places_[number] = static_cast<std::uint32_t>(ordered.size());
    ordered.push_back(primitives[number]);
  }
  primitives_ = std::move(ordered);
}

RayShape::RayShape(const Shape& triangles) {
  std::vector<Triangle> primitives;
  std::vector<Eigen::AlignedBox3f> boxes;
  for (const Eigen::Vector3i& corners : triangles.triangles) {
    const auto corner = [&](int i) {
      return triangles.vertices[static_cast<std::size_t>(corners[i])];
    };
    primitives.emplace_back(corner(0), corner(1), corner(2));
    boxes.emplace_back(corner(0));
    boxes.back().extend(corner(1)).extend(corner(2));
  }
  plant_tree(primitives, boxes);
}

RayShape::RayShape(const Cones& cones) {
  std::vector<RoundCone> primitives;
  std::vector<Eigen::AlignedBox3f> boxes;
  for (const unsigned first : cones.first) {
    const Vertex4& low = cones.points[first];
    const Vertex4& high = cones.points[first + 1];
    primitives.emplace_back(Eigen::Vector3f(low.x, low.y, low.z), low.radius,
                            Eigen::Vector3f(high.x, high.y, high.z), high.radius);
    boxes.push_back(primitives.back().box());
  }
  plant_tree(primitives, boxes);
}

RayShape::RayShape(const std::vector<TreeCloud::Disc>& discs) {
  std::vector<Disc> primitives;
  std::vector<Eigen::AlignedBox3f> boxes;
  for (const TreeCloud::Disc& disc : discs) {
    primitives.push_back({disc.centre, disc.normal, disc.radius_m});
    boxes.push_back(primitives.back().box());
  }
  plant_tree(primitives, boxes);
}

void RayShape::cast(const RayLanes& rays, LaneMask active, float near, Struck& struck,
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
