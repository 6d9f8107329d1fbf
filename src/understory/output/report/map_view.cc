#include "understory/output/report/map_view.h"

#include <algorithm>
#include <limits>

namespace understory {

const std::vector<Tree>* report_trees(const ReportInput& input) {
  return input.inventory != nullptr ? &input.inventory->trees : input.trees;
}

MapView map_view(const ReportInput& input) {
  MapView view;
  view.drawing = input.drawing;
  constexpr double kFar = std::numeric_limits<double>::max();
  double x0 = kFar;
  double y0 = kFar;
  double x1 = -kFar;
  double y1 = -kFar;
  const auto include = [&](double x, double y) {
    x0 = std::min(x0, x);
    y0 = std::min(y0, y);
    x1 = std::max(x1, x);
    y1 = std::max(y1, y);
  };
  const auto include_point = [&](const Eigen::Vector3d& point_in_world) {
    const Eigen::Vector2d at = view.drawn(point_in_world);
    include(at.x(), at.y());
  };
  if (input.picture != nullptr && !input.picture->empty()) {
    const auto box = input.picture->content_box();
    include(box[0], box[1]);
    include(box[2], box[3]);
  }
  for (const ReportScan& scan : input.scans)
    include_point(scan.position.cast<double>());
  if (const std::vector<Tree>* trees = report_trees(input)) {
    for (const Tree& tree : *trees)
      include_point(place_of(tree));
  }
  if (x1 < x0) return view;
  const double metre = input.drawing == nullptr ? 1.0 : input.drawing->units_per_metre();
  const double margin = 0.02 * std::max({x1 - x0, y1 - y0, metre});
  view.x0 = x0 - margin;
  view.y0 = y0 - margin;
  view.width = x1 - x0 + 2.0 * margin;
  view.height = y1 - y0 + 2.0 * margin;
  // Tall maps are kept to a height that fits a screen.
  constexpr double kWidth = 1100.0;
  view.scale = std::min(kWidth / view.width, 1.1 * kWidth / view.height);
  return view;
}

}  // namespace understory
