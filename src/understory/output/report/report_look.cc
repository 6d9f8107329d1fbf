#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "understory/output/report/map_view.h"
#include "understory/output/report/report_parts.h"
#include "understory/util/fixed_text.h"

namespace understory {
namespace {

// The corners of a run of thin cells in one row, as a part of a path.
std::string cells_path(const InventoryResult& inventory, const MapView& view,
                       const Eigen::Vector2d& corner, double length_m) {
  std::string path;
  const double cell = inventory.thin.cell_m;
  for (const auto& [east, north] : {std::pair{0.0, 0.0}, std::pair{length_m, 0.0},
                                    std::pair{length_m, cell}, std::pair{0.0, cell}}) {
    const Eigen::Vector2d at = view.at(Eigen::Vector3d(
        inventory.origin + Eigen::Vector3d(corner.x() + east, corner.y() + north, 0.0)));
    path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", at.x(), at.y());
  }
  return path + "z";
}

const Tree* tree_of(const InventoryResult& inventory, int id) {
  // Ids count from 1 in the order of the list.
  const auto at = static_cast<std::size_t>(id) - 1;
  return at < inventory.trees.size() ? &inventory.trees[at] : nullptr;
}

std::string place_text(const MapView& view, const Eigen::Vector3d& place) {
  const Eigen::Vector2d at = view.drawn(place);
  const bool degrees = view.drawing != nullptr && view.per_metre() > 100.0 * view.scale;
  const std::string x = fixed_text(at.x(), degrees ? 6 : 1);
  const std::string y = fixed_text(at.y(), degrees ? 6 : 1);
  return degrees || view.drawing == nullptr ? "x " + x + ", y " + y : "E " + x + ", N " + y;
}

}  // namespace

std::string thin_svg(const InventoryResult& inventory, const MapView& view) {
  const std::vector<Eigen::Vector2d>& corners = inventory.thin.corners;
  if (corners.empty()) return "";
  const double cell = inventory.thin.cell_m;
  std::string path;
  std::size_t begin = 0;
  for (std::size_t i = 1; i <= corners.size(); ++i) {
    const auto length = cell * static_cast<double>(i - begin);
    if (i < corners.size() && corners[i].y() == corners[begin].y() &&
        corners[i].x() < corners[begin].x() + length + 0.5 * cell)
      continue;
    path += cells_path(inventory, view, corners[begin], length);
    begin = i;
  }
  return "<defs><pattern id=\"thin\" width=\"9\" height=\"9\" patternUnits=\"userSpaceOnUse\" "
         "patternTransform=\"rotate(45)\"><path d=\"M0 0V9\" stroke=\"#5b2a86\" "
         "stroke-width=\"2\" opacity=\"0.55\"/></pattern></defs><path class=\"thin-area\" "
         "fill=\"url(#thin)\" d=\"" +
         path + "\"/>";
}

std::string look_svg(const InventoryResult& inventory, const MapView& view) {
  if (inventory.look_again.empty()) return "";
  std::string svg = "<g class=\"look-sights\">";
  std::string stands;
  const auto out = std::back_inserter(stands);
  int number = 0;
  for (const LookAgain& look : inventory.look_again) {
    const Eigen::Vector2d from = view.at(look.place);
    svg += "<path stroke-width=\"1.4\" d=\"";
    for (const int id : look.trees) {
      const Tree* tree = tree_of(inventory, id);
      if (tree == nullptr) continue;
      const Eigen::Vector2d to = view.at(place_of(*tree));
      svg += fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}", from.x(), from.y(), to.x(), to.y());
    }
    svg += "\"/>";
    fmt::format_to(out,
                   "<g class=\"stand\" data-x=\"{0:.1f}\" data-y=\"{1:.1f}\"><rect x=\"{2:.1f}\" "
                   "y=\"{3:.1f}\" width=\"22\" height=\"18\" rx=\"3\"/><text x=\"{0:.1f}\" "
                   "y=\"{4:.1f}\" font-size=\"14\" font-weight=\"700\" "
                   "text-anchor=\"middle\">{5}</text></g>",
                   from.x(), from.y(), from.x() - 11.0, from.y() - 9.0, from.y() + 5.0, ++number);
  }
  return svg + "</g><g class=\"look-places\">" + stands + "</g>";
}

std::string look_list(const InventoryResult& inventory, const MapView& view) {
  if (inventory.look_again.empty()) return "";
  std::string html =
      "<h3>Walk here</h3><p>From these places the lidar sees doubtful stems from a side that it "
      "has "
      "not seen, or from near. Record again with a way through them. Places outside your plot do "
      "not matter.</p><ol class=\"walk\">";
  for (const LookAgain& look : inventory.look_again) {
    std::string trees;
    for (const int id : look.trees)
      trees += fmt::format("{}{}", trees.empty() ? "" : ", ", id);
    html += fmt::format("<li>{}: {} {} ({})</li>", place_text(view, look.place),
                        look.trees.size() == 1 ? "tree" : "trees", trees, reason_of(look));
  }
  return html + "</ol>";
}

}  // namespace understory
