#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "understory/output/report/png.h"
#include "understory/output/report/report_parts.h"
#include "understory/output/report/svg_plot.h"

namespace understory {
namespace {

const std::vector<Tree>* trees_of(const ReportInput& input) {
  return input.inventory != nullptr ? &input.inventory->trees : input.trees;
}

constexpr double kWidth = 1100.0;

// From the frame that the map is drawn in to the picture's units, y upwards.
struct View {
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

Eigen::Vector3d place_of(const Tree& tree) {
  return {tree.x, tree.y, tree.z};
}

View view_of(const ReportInput& input) {
  View view;
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
  if (const std::vector<Tree>* trees = trees_of(input)) {
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
  view.scale = std::min(kWidth / view.width, 1.1 * kWidth / view.height);
  return view;
}

// How a scan's match is drawn.
enum class Match { kGood, kWeak, kLost };

Match match_of(const ReportScan& scan, bool moved) {
  if (moved) return Match::kGood;
  if (std::isnan(scan.inlier_ratio)) return Match::kLost;
  return scan.weak ? Match::kWeak : Match::kGood;
}

const char* colour_of(Match match) {
  switch (match) {
    case Match::kGood:
      return "var(--path)";
    case Match::kWeak:
      return "var(--weak)";
    case Match::kLost:
      break;
  }
  return "var(--lost)";
}

// `moved`: of a run that was moved, whose own report tells how its scans were matched.
std::string path_svg(const std::vector<ReportScan>& scans, const View& view, bool moved) {
  std::string svg;
  const auto out = std::back_inserter(svg);
  const float least = static_cast<float>(0.8 / view.per_metre());  // shorter steps are not seen
  std::size_t begin = 0;
  while (begin < scans.size()) {
    const Match match = match_of(scans[begin], moved);
    fmt::format_to(out, "<path fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" d=\"",
                   colour_of(match), match == Match::kGood ? 2.2 : 4.5);
    Eigen::Vector3f last = scans[begin].position;
    const Eigen::Vector2d from = view.at(last);
    fmt::format_to(out, "M{:.1f} {:.1f}", from.x(), from.y());
    std::size_t end = begin + 1;
    for (; end < scans.size(); ++end) {
      const bool same = match_of(scans[end], moved) == match;
      const Eigen::Vector3f& here = scans[end].position;
      if (!same || end + 1 == scans.size() || (here - last).head<2>().norm() >= least) {
        const Eigen::Vector2d to = view.at(here);
        fmt::format_to(out, "L{:.1f} {:.1f}", to.x(), to.y());
        last = here;
      }
      if (!same) break;
    }
    svg += "\"/>";
    begin = end;
  }
  return svg;
}

std::string marker(const Eigen::Vector3f& point, const View& view, const char* text) {
  const Eigen::Vector2d at = view.at(point);
  const double x = at.x();
  const double y = at.y();
  return fmt::format(
      "<circle cx=\"{0:.1f}\" cy=\"{1:.1f}\" r=\"6\" fill=\"#fff\" stroke=\"#111\" "
      "stroke-width=\"2\"/><text x=\"{2:.1f}\" y=\"{3:.1f}\" font-size=\"15\" font-weight=\"600\" "
      "stroke=\"#fff\" stroke-width=\"4\" paint-order=\"stroke\">{4}</text>",
      x, y, x + 9, y + 5, text);
}

std::string loops_svg(const std::vector<ReportLoop>& loops, const View& view) {
  std::string svg;
  for (const ReportLoop& loop : loops) {
    const Eigen::Vector2d from = view.at(loop.from);
    const Eigen::Vector2d to = view.at(loop.to);
    svg += fmt::format(
        "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" "
        "stroke-width=\"{}\" {}/>",
        from.x(), from.y(), to.x(), to.y(), loop.accepted ? "var(--loop)" : "#888",
        loop.accepted ? 3 : 1.5, loop.accepted ? "" : "stroke-dasharray=\"4 4\"");
  }
  return svg;
}

std::string trees_svg(const std::vector<Tree>& trees, const View& view) {
  std::string svg;
  const auto out = std::back_inserter(svg);
  for (const Tree& tree : trees) {
    const double radius = std::isfinite(tree.dbh_m) ? 0.5 * tree.dbh_m : 0.1;
    const Eigen::Vector2d at = view.at(place_of(tree));
    fmt::format_to(
        out,
        "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\" fill=\"#fff2c2\" "
        "stroke=\"#c0392b\" stroke-width=\"1.6\"><title>tree {}: {:.0f} cm</title></circle>",
        at.x(), at.y(), std::max(2.6, radius * view.per_metre()), tree.id, 200.0 * radius);
  }
  return svg;
}

// Where trees stood that are gone.
std::string falls_svg(const std::vector<TreeFall>& falls, const View& view) {
  std::string svg = "<g class=\"falls\" stroke=\"#1b1b1b\" stroke-width=\"2\">";
  for (const TreeFall& fall : falls) {
    const Eigen::Vector2d at = view.at(Eigen::Vector3d(fall.x, fall.y, 0.0));
    svg += fmt::format(
        "<path d=\"M{:.1f} {:.1f}m-5-5l10 10m0-10l-10 10\"><title>tree {}: felled</title></path>",
        at.x(), at.y(), fall.tree_id);
  }
  return svg + "</g>";
}

// The receiver's path, at most 2,000 fixes of it, those that were not used paler.
std::string fixes_svg(const std::vector<ReportFix>& fixes, const View& view) {
  const std::size_t step = fixes.size() / 2000 + 1;
  std::string svg = "<g class=\"fixes\" fill=\"#8e3fb0\">";
  for (std::size_t i = 0; i < fixes.size(); i += step) {
    const Eigen::Vector2d at = view.at(fixes[i].position);
    if (!at.allFinite()) continue;
    svg += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2\" opacity=\"{}\"/>", at.x(),
                       at.y(), fixes[i].used ? "0.9" : "0.35");
  }
  return svg + "</g>";
}

std::string scale_bar(const View& view) {
  const double metres = view.width * view.scale / view.per_metre();
  const std::vector<double> ticks = round_ticks(0.0, metres, 6);
  const double length = ticks.size() > 1 ? ticks[1] : 1.0;
  const double y = view.height * view.scale - 18.0;
  const double width = length * view.per_metre();
  return fmt::format(
      "<g><rect x=\"12\" y=\"{0:.1f}\" width=\"{1:.1f}\" height=\"34\" fill=\"#fff\" "
      "opacity=\"0.85\"/><path d=\"M20 {2:.1f}v8h{3:.1f}v-8\" fill=\"none\" stroke=\"#111\" "
      "stroke-width=\"2\"/><text x=\"{4:.1f}\" y=\"{5:.1f}\" font-size=\"15\" "
      "text-anchor=\"middle\" stroke=\"#fff\" stroke-width=\"4\" paint-order=\"stroke\">{6} "
      "m</text></g>",
      y - 22, width + 16, y - 4, width, 20 + 0.5 * width, y - 3, tick_text(length, length));
}

// Lines of round coordinates with their numbers: east along the top, north along the left.
std::string grid_svg(const View& view) {
  const double width = view.width * view.scale;
  const double height = view.height * view.scale;
  const auto ticks = [](double low, double size, double longer) {
    std::vector<double> all = round_ticks(
        low, low + size, std::max(2, static_cast<int>(std::lround(5.0 * size / longer))));
    std::erase_if(
        all, [&](double tick) { return tick < low + 0.03 * size || tick > low + 0.97 * size; });
    return all;
  };
  const double longer = std::max(view.width, view.height);
  std::string lines;
  std::string numbers;
  for (const double east : ticks(view.x0, view.width, longer)) {
    const double x = view.x(east);
    lines += fmt::format("M{:.1f} 0V{:.1f}", x, height);
    numbers +=
        fmt::format("<text x=\"{:.1f}\" y=\"15\" text-anchor=\"middle\">E {:.0f}</text>", x, east);
  }
  for (const double north : ticks(view.y0, view.height, longer)) {
    const double y = view.y(north);
    lines += fmt::format("M0 {:.1f}H{:.1f}", y, width);
    numbers += fmt::format("<text x=\"4\" y=\"{:.1f}\">N {:.0f}</text>", y - 4.0, north);
  }
  return fmt::format(
      "<g class=\"grid\"><path d=\"{}\" fill=\"none\" stroke=\"#111\" stroke-width=\"0.7\" "
      "opacity=\"0.35\"/><g font-size=\"13\" fill=\"#111\" stroke=\"#fff\" stroke-width=\"4\" "
      "paint-order=\"stroke\">{}</g></g>",
      lines, numbers);
}

std::string north_arrow(const View& view) {
  const double x = view.width * view.scale - 30.0;
  return fmt::format(
      "<g><path d=\"M{0:.1f} 14l9 26-9-6-9 6z\" fill=\"#111\" stroke=\"#fff\"/><text x=\"{0:.1f}\" "
      "y=\"56\" font-size=\"15\" font-weight=\"600\" text-anchor=\"middle\">N</text></g>",
      x);
}

}  // namespace

std::string map_section(const ReportInput& input) {
  const View view = view_of(input);
  if (input.picture == nullptr && input.scans.empty() && trees_of(input) == nullptr) return "";
  std::string svg = fmt::format(
      "<svg class=\"paper map\" viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"map from "
      "above\" style=\"max-width:{:.0f}px;margin:0 auto\">",
      view.width * view.scale, view.height * view.scale, view.width * view.scale);
  if (input.picture != nullptr && !input.picture->empty()) {
    const MapPicture& p = *input.picture;
    svg += fmt::format(
        "<image x=\"{:.2f}\" y=\"{:.2f}\" width=\"{:.2f}\" height=\"{:.2f}\" "
        "preserveAspectRatio=\"none\" href=\"data:image/png;base64,{}\"/>",
        view.x(p.x0()), view.y(p.y0() + p.height_m()), p.width_m() * view.scale,
        p.height_m() * view.scale, base64(p.png()));
  }
  if (const std::vector<Tree>* trees = trees_of(input)) svg += trees_svg(*trees, view);
  if (!input.falls.empty()) svg += falls_svg(input.falls, view);
  svg += loops_svg(input.loops, view);
  if (!input.fixes.empty()) svg += fixes_svg(input.fixes, view);
  svg += path_svg(input.scans, view, input.moved);
  if (!input.scans.empty()) {
    svg += marker(input.scans.back().position, view, "end");
    svg += marker(input.scans.front().position, view, "start");
  }
  if (input.drawing != nullptr && !input.drawing->wkt().empty()) svg += grid_svg(view);
  svg += scale_bar(view);
  if (input.north_is_up) svg += north_arrow(view);
  svg += "</svg>";
  std::string legend = "<p class=\"legend\">";
  const auto entry = [&](const std::string& kind, const std::string& style, const char* text) {
    legend += fmt::format("<span><i{} style=\"{}\"></i>{}</span> ", kind, style, text);
  };
  const auto line = [&](const std::string& colour, const char* text) {
    entry("", "border-color:var(" + colour + ")", text);
  };
  if (input.picture != nullptr) {
    entry(" class=\"box\"", "background:#9a9a9a", "ground");
    entry(" class=\"box\"", "background:#4f9a4a", "vegetation, the lighter the higher");
  }
  if (trees_of(input) != nullptr) {
    entry(" class=\"dot\"", "border-color:#c0392b;background:#fff2c2", "tree");
  }
  if (!input.falls.empty()) legend += "<span><b>×</b> felled meanwhile</span> ";
  if (!input.scans.empty()) {
    line("--path", "path");
    if (!input.moved) {
      line("--weak", "path where matching was weak");
      line("--lost", "path without a match (predicted)");
    }
  }
  if (!input.fixes.empty())
    entry(" class=\"dot\"", "border-color:#8e3fb0", "GNSS fix (pale: not used)");
  if (!input.loops.empty()) line("--loop", "loop closed");
  return "<section><h2>The map from above</h2>" + svg + legend + "</p></section>\n";
}

}  // namespace understory
