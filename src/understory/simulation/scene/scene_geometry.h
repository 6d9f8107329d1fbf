#pragma once

#include <Eigen/Core>
#include <vector>

#include "understory/simulation/scene/embree.h"
#include "understory/simulation/scene/shapes.h"
#include "understory/simulation/scene/terrain.h"
#include "understory/simulation/stand/stand.h"
#include "understory/simulation/stand/tree_cloud.h"

// Embree geometries of what stands in a scene. All are new and not yet committed: the caller
// attaches and releases them.
namespace understory {

// A place and a radius, as the ray caster takes them.
struct Vertex4 {
  float x, y, z, radius;
};

// Round cones (spheres joined by their tangent cones) between consecutive points.
struct Cones {
  std::vector<Vertex4> points;
  std::vector<unsigned> first;  // index of the first point of each cone
  void add(const Eigen::Vector3d& place, double radius) {
    points.push_back({static_cast<float>(place.x()), static_cast<float>(place.y()),
                      static_cast<float>(place.z()), static_cast<float>(radius)});
  }
  void join() { first.push_back(static_cast<unsigned>(points.size()) - 1); }  // to the next point
};

// Geometries of the ray caster. The caller owns what is returned and releases it.
[[nodiscard]] RTCGeometry cone_geometry(RTCDevice device, const Cones& cones);
[[nodiscard]] RTCGeometry shape_geometry(RTCDevice device, const Shape& shape);
[[nodiscard]] RTCGeometry disc_geometry(RTCDevice device,
                                        const std::vector<TreeCloud::Disc>& discs);

// The ground, two triangles a cell of its grid, in the world frame.
[[nodiscard]] Shape terrain_shape(const Terrain& terrain);

// Walls and a pitched roof in the world frame.
[[nodiscard]] Shape building_shape(const Building& house);

// Boards and rods of a thing, in its own frame.
[[nodiscard]] Shape board_shape(const StandObject& object);
[[nodiscard]] Cones rod_cones(const StandObject& object);

}  // namespace understory
