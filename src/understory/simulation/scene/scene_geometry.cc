#include "understory/simulation/scene/scene_geometry.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "understory/util/error.h"

namespace understory {
namespace {

template <typename T>
T* buffer(RTCGeometry geometry, RTCBufferType type, RTCFormat format, std::size_t count) {
  void* memory = rtcSetNewGeometryBuffer(geometry, type, 0, format, sizeof(T),
                                         std::max<std::size_t>(count, 1));
  UNDERSTORY_CHECK(memory != nullptr);
  return static_cast<T*>(memory);
}

}  // namespace

RTCGeometry cone_geometry(RTCDevice device, const Cones& cones) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE);
  std::copy(
      cones.points.begin(), cones.points.end(),
      buffer<Vertex4>(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT4, cones.points.size()));
  std::copy(cones.first.begin(), cones.first.end(),
            buffer<unsigned>(geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT, cones.first.size()));
  return geometry;
}

RTCGeometry shape_geometry(RTCDevice device, const Shape& shape) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  std::copy(shape.vertices.begin(), shape.vertices.end(),
            buffer<Eigen::Vector3f>(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3,
                                    shape.vertices.size()));
  std::copy(shape.triangles.begin(), shape.triangles.end(),
            buffer<Eigen::Vector3i>(geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3,
                                    shape.triangles.size()));
  return geometry;
}

RTCGeometry disc_geometry(RTCDevice device, const std::vector<TreeCloud::Disc>& discs) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_ORIENTED_DISC_POINT);
  auto* vertices =
      buffer<Vertex4>(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT4, discs.size());
  auto* normals =
      buffer<Eigen::Vector3f>(geometry, RTC_BUFFER_TYPE_NORMAL, RTC_FORMAT_FLOAT3, discs.size());
  for (const TreeCloud::Disc& disc : discs) {
    *vertices++ = {disc.centre.x(), disc.centre.y(), disc.centre.z(), disc.radius_m};
    *normals++ = disc.normal;
  }
  return geometry;
}

Shape terrain_shape(const Terrain& terrain) {
  const int columns = terrain.columns();
  const int rows = terrain.rows();
  Shape shape;
  shape.vertices.reserve(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column)
      shape.vertices.push_back(terrain.vertex(column, row).cast<float>());
  }
  shape.triangles.reserve(2 * shape.vertices.size());
  for (int row = 0; row + 1 < rows; ++row) {
    for (int column = 0; column + 1 < columns; ++column) {
      const int sw = row * columns + column;
      shape.triangles.emplace_back(sw, sw + 1, sw + columns + 1);
      shape.triangles.emplace_back(sw, sw + columns + 1, sw + columns);
    }
  }
  return shape;
}

Shape board_shape(const StandObject& object) {
  Shape shape;
  for (const StandObject::Board& board : object.boards) {
    const int first = static_cast<int>(shape.vertices.size());
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3d place((corner & 1) != 0 ? board.high.x() : board.low.x(),
                                  (corner & 2) != 0 ? board.high.y() : board.low.y(),
                                  (corner & 4) != 0 ? board.high.z() : board.low.z());
      shape.vertices.push_back(place.cast<float>());
    }
    constexpr int kFaces[6][4] = {{0, 1, 3, 2}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                  {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 3, 7, 5}};
    for (const auto& face : kFaces) {
      shape.triangles.emplace_back(first + face[0], first + face[1], first + face[2]);
      shape.triangles.emplace_back(first + face[0], first + face[2], first + face[3]);
    }
  }
  return shape;
}

Cones rod_cones(const StandObject& object) {
  Cones cones;
  for (const Wood& rod : object.rods) {
    cones.add(rod.from, rod.radius_from_m);
    cones.join();
    cones.add(rod.to, rod.radius_to_m);
  }
  return cones;
}

Shape building_shape(const Building& house) {
  const Eigen::Vector3f half = 0.5F * house.size_m.cast<float>();
  const float wall = house.size_m.cast<float>().z();
  const float ridge = wall + 0.6F * half.y();
  const Eigen::Vector3f corners[10] = {{-half.x(), -half.y(), -1.0F}, {half.x(), -half.y(), -1.0F},
                                       {half.x(), half.y(), -1.0F},   {-half.x(), half.y(), -1.0F},
                                       {-half.x(), -half.y(), wall},  {half.x(), -half.y(), wall},
                                       {half.x(), half.y(), wall},    {-half.x(), half.y(), wall},
                                       {-half.x(), 0.0F, ridge},      {half.x(), 0.0F, ridge}};
  const Eigen::AngleAxisf turn(static_cast<float>(house.yaw_rad), Eigen::Vector3f::UnitZ());
  Shape shape;
  for (const Eigen::Vector3f& corner : corners)
    shape.vertices.push_back(house.foot.cast<float>() + turn * corner);
  shape.triangles = {{0, 1, 5}, {0, 5, 4}, {1, 2, 6}, {1, 6, 5}, {2, 3, 7}, {2, 7, 6}, {3, 0, 4},
                     {3, 4, 7}, {4, 5, 9}, {4, 9, 8}, {7, 8, 9}, {7, 9, 6}, {4, 8, 7}, {5, 6, 9}};
  return shape;
}

}  // namespace understory
