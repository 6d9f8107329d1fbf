#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "understory/output/png.h"
#include "understory/output/report_parts.h"
#include "understory/output/svg_plot.h"

namespace understory {
namespace {

const std::vector<Tree>* trees_of(const ReportInput& input) {
  return input.inventory != nullptr ? &input.inventory->trees : input.trees;
}

constexpr double kWidth = 1100.0;

// From metres of the world frame to the picture's units, y upwards.
struct View {
  double x0 = 0.0, y0 = 0.0, width_m = 1.0, height_m = 1.0, scale = 1.0;
  [[nodiscard]] double x(double value) const { return (value - x0) * scale; }
  [[nodiscard]] double y(double value) const { return (y0 + height_m - value) * scale; }
};

View view_of(const ReportInput& input) {
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
  if (input.picture != nullptr && !input.picture->empty()) {
    const auto box = input.picture->content_box();
    include(box[0], box[1]);
    include(box[2], box[3]);
  }
  for (const ReportScan& scan : input.scans)
    include(static_cast<double>(scan.position.x()), static_cast<double>(scan.position.y()));
  if (const std::vector<Tree>* trees = trees_of(input)) {
    for (const Tree& tree : *trees)
      include(tree.x, tree.y);
  }
  View view;
  if (x1 < x0) return view;
  const double margin = 0.02 * std::max({x1 - x0, y1 - y0, 1.0});
  view.x0 = x0 - margin;
  view.y0 = y0 - margin;
  view.width_m = x1 - x0 + 2.0 * margin;
  view.height_m = y1 - y0 + 2.0 * margin;
  // Tall maps are kept to a height that fits a screen.
  view.scale = std::min(kWidth / view.width_m, 1.1 * kWidth / view.height_m);
  return view;
}

// How a scan's match is drawn.
enum class Match { kGood, kWeak, kLost };

Match match_of(const ReportScan& scan) {
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

std::string path_svg(const std::vector<ReportScan>& scans, const View& view) {
  std::string svg;
  const auto out = std::back_inserter(svg);
  const float least = static_cast<float>(0.8 / view.scale);  // shorter steps are not seen
  std::size_t begin = 0;
  while (begin < scans.size()) {
    const Match match = match_of(scans[begin]);
    fmt::format_to(out, "<path fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" d=\"",
                   colour_of(match), match == Match::kGood ? 2.2 : 4.5);
    Eigen::Vector3f last = scans[begin].position;
    fmt::format_to(out, "M{:.1f} {:.1f}", view.x(static_cast<double>(last.x())),
                   view.y(static_cast<double>(last.y())));
    std::size_t end = begin + 1;
    for (; end < scans.size(); ++end) {
      const bool same = match_of(scans[end]) == match;
      const Eigen::Vector3f& here = scans[end].position;
      if (!same || end + 1 == scans.size() || (here - last).head<2>().norm() >= least) {
        fmt::format_to(out, "L{:.1f} {:.1f}", view.x(static_cast<double>(here.x())),
                       view.y(static_cast<double>(here.y())));
        last = here;
      }
      if (!same) break;
    }
    svg += "\"/>";
    begin = end;
  }
  return svg;
}

std::string marker(const Eigen::Vector3f& at, const View& view, const char* text) {
  const double x = view.x(static_cast<double>(at.x()));
  const double y = view.y(static_cast<double>(at.y()));
  return fmt::format(
      "<circle cx=\"{0:.1f}\" cy=\"{1:.1f}\" r=\"6\" fill=\"#fff\" stroke=\"#111\" "
      "stroke-width=\"2\"/><text x=\"{2:.1f}\" y=\"{3:.1f}\" font-size=\"15\" font-weight=\"600\" "
      "stroke=\"#fff\" stroke-width=\"4\" paint-order=\"stroke\">{4}</text>",
      x, y, x + 9, y + 5, text);
}

std::string loops_svg(const std::vector<ReportLoop>& loops, const View& view) {
  std::string svg;
  for (const ReportLoop& loop : loops) {
    svg += fmt::format(
        "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" "
        "stroke-width=\"{}\" {}/>",
        view.x(loop.from.x()), view.y(loop.from.y()), view.x(loop.to.x()), view.y(loop.to.y()),
        loop.accepted ? "var(--loop)" : "#888", loop.accepted ? 3 : 1.5,
        loop.accepted ? "" : "stroke-dasharray=\"4 4\"");
  }
  return svg;
}

std::string trees_svg(const std::vector<Tree>& trees, const View& view) {
  std::string svg;
  const auto out = std::back_inserter(svg);
  for (const Tree& tree : trees) {
    const double radius = std::isfinite(tree.dbh_m) ? 0.5 * tree.dbh_m : 0.1;
    fmt::format_to(
        out,
        "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\" fill=\"#fff2c2\" "
        "stroke=\"#c0392b\" stroke-width=\"1.6\"><title>tree {}: {:.0f} cm</title></circle>",
        view.x(tree.x), view.y(tree.y), std::max(2.6, radius * view.scale), tree.id,
        200.0 * radius);
  }
  return svg;
}

// Where trees stood that are gone.
std::string falls_svg(const std::vector<TreeFall>& falls, const View& view) {
  std::string svg = "<g class=\"falls\" stroke=\"#1b1b1b\" stroke-width=\"2\">";
  for (const TreeFall& fall : falls)
    svg += fmt::format(
        "<path d=\"M{:.1f} {:.1f}m-5-5l10 10m0-10l-10 10\"><title>tree {}: felled</title></path>",
        view.x(fall.x), view.y(fall.y), fall.tree_id);
  return svg + "</g>";
}

// The receiver's path, at most 2,000 fixes of it, those that were not used paler.
std::string fixes_svg(const std::vector<ReportFix>& fixes, const View& view) {
  const std::size_t step = fixes.size() / 2000 + 1;
  std::string svg = "<g class=\"fixes\" fill=\"#d98200\">";
  for (std::size_t i = 0; i < fixes.size(); i += step) {
    svg += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2\" opacity=\"{}\"/>",
                       view.x(static_cast<double>(fixes[i].position.x())),
                       view.y(static_cast<double>(fixes[i].position.y())),
                       fixes[i].used ? "0.9" : "0.35");
  }
  return svg + "</g>";
}

std::string scale_bar(const View& view) {
  const std::vector<double> ticks = round_ticks(0.0, view.width_m, 6);
  const double length = ticks.size() > 1 ? ticks[1] : 1.0;
  const double y = view.height_m * view.scale - 18.0;
  const double width = length * view.scale;
  return fmt::format(
      "<g><rect x=\"12\" y=\"{0:.1f}\" width=\"{1:.1f}\" height=\"34\" fill=\"#fff\" "
      "opacity=\"0.85\"/><path d=\"M20 {2:.1f}v8h{3:.1f}v-8\" fill=\"none\" stroke=\"#111\" "
      "stroke-width=\"2\"/><text x=\"{4:.1f}\" y=\"{5:.1f}\" font-size=\"15\" "
      "text-anchor=\"middle\" stroke=\"#fff\" stroke-width=\"4\" paint-order=\"stroke\">{6} "
      "m</text></g>",
      y - 22, width + 16, y - 4, width, 20 + 0.5 * width, y - 3, tick_text(length, length));
}

std::string north_arrow(const View& view) {
  const double x = view.width_m * view.scale - 30.0;
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
      view.width_m * view.scale, view.height_m * view.scale, view.width_m * view.scale);
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
  svg += path_svg(input.scans, view);
  if (!input.scans.empty()) {
    svg += marker(input.scans.back().position, view, "end");
    svg += marker(input.scans.front().position, view, "start");
  }
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
    line("--weak", "path where matching was weak");
    line("--lost", "path without a match (predicted)");
  }
  if (!input.fixes.empty())
    entry(" class=\"dot\"", "border-color:#d98200", "GNSS fix (pale: not used)");
  if (!input.loops.empty()) line("--loop", "loop closed");
  return "<section><h2>The map from above</h2>" + svg + legend + "</p></section>\n";
}

}  // namespace understory
