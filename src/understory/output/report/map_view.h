#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "understory/georeference/systems/layer_frame.h"
#include "understory/output/report/report.h"
#include "understory/sensor/tree.h"

namespace understory {

// From the frame that the map is drawn in to the units of the picture of the map (SVG), whose y
// goes down.
struct MapView {
  double x0 = 0.0, y0 = 0.0, width = 1.0, height = 1.0, scale = 1.0;
  const LayerFrame* drawing = nullptr;  // null: the world frame
  [[nodiscard]] double x(double value) const { return (value - x0) * scale; }
  [[nodiscard]] double y(double value) const { return (y0 + height - value) * scale; }
  // A point of the world frame in the frame of the map.
  [[nodiscard]] Eigen::Vector2d drawn(const Eigen::Vector3d& point_in_world) const {
    if (drawing == nullptr) return point_in_world.head<2>();
    Eigen::Vector3d point = point_in_world;
    if (!std::isfinite(point.z())) point.z() = 0.0;
    return drawing->from_world(point).head<2>();
  }
  // The same in the picture's units.
  [[nodiscard]] Eigen::Vector2d at(const Eigen::Vector3d& point_in_world) const {
    const Eigen::Vector2d point = drawn(point_in_world);
    return {x(point.x()), y(point.y())};
  }
  [[nodiscard]] Eigen::Vector2d at(const Eigen::Vector3f& point_in_world) const {
    return at(Eigen::Vector3d(point_in_world.cast<double>()));
  }
  // The picture's units per metre.
  [[nodiscard]] double per_metre() const {
    return drawing == nullptr ? scale : scale * drawing->units_per_metre();
  }
};

// The trees that the report shows; null: none.
[[nodiscard]] const std::vector<Tree>* report_trees(const ReportInput& input);
// Foot of a tree, world frame.
[[nodiscard]] inline Eigen::Vector3d place_of(const Tree& tree) {
  return {tree.x, tree.y, tree.z};
}
// All that the map of a report shows, with a margin.
[[nodiscard]] MapView map_view(const ReportInput& input);

}  // namespace understory
