#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "understory/forest/trees/tree_doubt.h"
#include "understory/output/layers/crown_outlines.h"
#include "understory/output/report/map_view.h"
#include "understory/output/report/png.h"
#include "understory/output/report/report_parts.h"
#include "understory/output/report/svg_plot.h"
#include "understory/util/fixed_text.h"

namespace understory {
namespace {

// What the map of a run that was moved does not show.
constexpr const char* kOfMoved =
    "<p class=\"sub\">The map of the run before it was moved also shows thin coverage, places to "
    "walk to and dead wood. What it has of the last two is in layers of trees.gpkg here.</p>";

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
std::string path_svg(const std::vector<ReportScan>& scans, const MapView& view, bool moved) {
  std::string svg = "<g class=\"way\">";
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
  return svg + "</g>";
}

// `left`: the text stands left of the circle.
std::string marker(const Eigen::Vector2d& at, const char* text, bool left) {
  const double x = at.x();
  const double y = at.y();
  return fmt::format(
      "<g class=\"mark\" data-x=\"{0:.1f}\" data-y=\"{1:.1f}\"><circle cx=\"{0:.1f}\" "
      "cy=\"{1:.1f}\" "
      "r=\"6\" fill=\"#fff\" stroke=\"#111\" stroke-width=\"2\"/><text x=\"{2:.1f}\" y=\"{3:.1f}\" "
      "font-size=\"15\" font-weight=\"600\" text-anchor=\"{5}\" "
      "stroke=\"#fff\" stroke-width=\"4\" paint-order=\"stroke\">{4}</text></g>",
      x, y, left ? x - 9 : x + 9, y + 5, text, left ? "end" : "start");
}

// Start and end of the way. Where they are near each other, their texts stand apart.
std::string markers(const Eigen::Vector2d& start, const Eigen::Vector2d& end) {
  constexpr double kTextWidth = 60.0;
  constexpr double kTextHeight = 20.0;
  const Eigen::Vector2d apart = end - start;
  const bool near = std::abs(apart.x()) < kTextWidth && std::abs(apart.y()) < kTextHeight;
  const bool start_left = near && apart.x() >= 0.0;
  return marker(end, "end", near && !start_left) + marker(start, "start", start_left);
}

std::string loops_svg(const std::vector<ReportLoop>& loops, const MapView& view) {
  std::string svg = "<g class=\"loops\">";
  for (const ReportLoop& loop : loops) {
    const Eigen::Vector2d from = view.at(loop.from);
    const Eigen::Vector2d to = view.at(loop.to);
    svg += fmt::format(
        "<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" stroke=\"{}\" stroke-width=\"{}\" {}/>", from.x(),
        from.y(), to.x(), to.y(), loop.accepted ? "var(--loop)" : "#888", loop.accepted ? 3.0 : 1.5,
        loop.accepted ? "" : "stroke-dasharray=\"4 4\"");
  }
  return svg + "</g>";
}

// What is known of a tree, in one line.
std::string text_of(const Tree& tree) {
  std::string text = fmt::format("tree {}: ", tree.id);
  if (!std::isfinite(tree.dbh_m)) {
    text += "no diameter";
  } else if (std::isfinite(tree.dbh_sd_m)) {
    text += fmt::format("{:.1f} ± {:.1f} cm", 100.0 * tree.dbh_m, 100.0 * tree.dbh_sd_m);
  } else {
    text += fmt::format("{:.1f} cm", 100.0 * tree.dbh_m);
  }
  if (std::isfinite(tree.height_m)) text += fmt::format(", {:.1f} m high", tree.height_m);
  return text;
}

// How sure a tree is: a class of the page's style, which the moving map draws alike.
const char* kind_of(const Tree& tree) {
  if (!std::isfinite(tree.dbh_m)) return "crown";
  return has_weak_diameter(tree) ? "weak" : "sure";
}

std::string trees_svg(const std::vector<Tree>& trees, const MapView& view) {
  constexpr double kUnknownRadiusM = 0.1;
  constexpr double kLeastRadius = 2.6;
  std::string svg = "<g class=\"trees\">";
  const auto out = std::back_inserter(svg);
  for (const Tree& tree : trees) {
    const double radius =
        view.per_metre() * (std::isfinite(tree.dbh_m) ? 0.5 * tree.dbh_m : kUnknownRadiusM);
    const Eigen::Vector2d at = view.at(place_of(tree));
    fmt::format_to(out,
                   "<circle class=\"{}\" data-id=\"{}\" cx=\"{:.2f}\" cy=\"{:.2f}\" r=\"{:.1f}\" "
                   "data-r=\"{:.2f}\"><title>{}</title></circle>",
                   kind_of(tree), tree.id, at.x(), at.y(), std::max(kLeastRadius, radius), radius,
                   text_of(tree));
  }
  return svg + "</g>";
}

// Outlines of the crowns, for the moving map: the still picture does not show them.
std::string crowns_svg(const InventoryResult& inventory, const MapView& view) {
  std::string svg;
  const auto out = std::back_inserter(svg);
  for (const CrownOutline& crown : crown_outlines(inventory)) {
    const double ground = inventory.trees[static_cast<std::size_t>(crown.tree) - 1].z;
    fmt::format_to(out, "<path data-id=\"{}\" d=\"", crown.tree);
    for (const PlaneRing& ring : crown.rings) {
      for (std::size_t i = 0; i < ring.size(); ++i) {
        const Eigen::Vector2d at = view.at(Eigen::Vector3d(ring[i].x(), ring[i].y(), ground));
        fmt::format_to(out, "{}{:.1f} {:.1f}", i == 0 ? "M" : "L", at.x(), at.y());
      }
      svg += "z";
    }
    svg += "\"/>";
  }
  return svg.empty() ? "" : "<g class=\"crowns\" display=\"none\">" + svg + "</g>";
}

// Where trees stood that are gone.
std::string falls_svg(const std::vector<TreeFall>& falls, const MapView& view) {
  std::string svg =
      "<defs><path id=\"felled\" d=\"M-5-5l10 10m0-10l-10 10\"/></defs><g class=\"falls\" "
      "stroke=\"#1b1b1b\" stroke-width=\"2\">";
  for (const TreeFall& fall : falls) {
    const Eigen::Vector2d at = view.at(Eigen::Vector3d(fall.x, fall.y, 0.0));
    svg += fmt::format(
        "<use href=\"#felled\" x=\"{:.1f}\" y=\"{:.1f}\"><title>tree {}: felled</title></use>",
        at.x(), at.y(), fall.tree_id);
  }
  return svg + "</g>";
}

// The receiver's path, at most 2,000 fixes of it, those that were not used paler.
std::string fixes_svg(const std::vector<ReportFix>& fixes, const MapView& view) {
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

std::string scale_bar(const MapView& view) {
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
std::string grid_svg(const MapView& view) {
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
  constexpr double kTopStrip = 19.0;  // where the numbers to the east stand
  std::string lines;
  std::string numbers;
  for (const double east : ticks(view.x0, view.width, longer)) {
    const double x = view.x(east);
    lines += fmt::format("M{:.1f} 0V{:.1f}", x, height);
    numbers += fmt::format("<text x=\"{:.1f}\" y=\"15\" text-anchor=\"middle\">E {}</text>", x,
                           fixed_text(east, 0));
  }
  for (const double north : ticks(view.y0, view.height, longer)) {
    const double y = view.y(north);
    lines += fmt::format("M0 {:.1f}H{:.1f}", y, width);
    // Above its line, but below the numbers to the east.
    const double base = y < kTopStrip + 15.0 ? std::max(y, kTopStrip) + 15.0 : y - 4.0;
    numbers += fmt::format("<text x=\"4\" y=\"{:.1f}\">N {}</text>", base, fixed_text(north, 0));
  }
  return fmt::format(
      "<g class=\"grid\"><path d=\"{}\" fill=\"none\" stroke=\"#111\" stroke-width=\"0.7\" "
      "opacity=\"0.35\"/><g font-size=\"13\" fill=\"#111\" stroke=\"#fff\" stroke-width=\"4\" "
      "paint-order=\"stroke\">{}</g></g>",
      lines, numbers);
}

std::string north_arrow(const MapView& view) {
  const double x = view.width * view.scale - 30.0;
  return fmt::format(
      "<g class=\"north\"><path d=\"M{0:.1f} 14l9 26-9-6-9 6z\" fill=\"#111\" "
      "stroke=\"#fff\"/><text x=\"{0:.1f}\" "
      "y=\"56\" font-size=\"15\" font-weight=\"600\" text-anchor=\"middle\">N</text></g>",
      x);
}

std::string picture_svg(const MapPicture& picture, const MapView& view) {
  return fmt::format(
      "<image x=\"{:.2f}\" y=\"{:.2f}\" width=\"{:.2f}\" height=\"{:.2f}\" "
      "preserveAspectRatio=\"none\" href=\"data:image/png;base64,{}\"/>",
      view.x(picture.x0()), view.y(picture.y0() + picture.height_m()),
      picture.width_m() * view.scale, picture.height_m() * view.scale, base64(picture.png()));
}

// The whole map as one picture. The page's scripts read its parts and draw them anew where they are
// moved (report/page/map.js).
std::string map_svg(const ReportInput& input, const MapView& view) {
  const bool grid = input.drawing != nullptr && !input.drawing->wkt().empty();
  std::string svg = fmt::format(
      "<svg class=\"paper map\" viewBox=\"0 0 {0:.0f} {1:.0f}\" role=\"img\" aria-label=\"map from "
      "above\" style=\"max-width:{0:.0f}px;margin:0 auto\" data-x0=\"{2}\" data-y1=\"{3}\" "
      "data-scale=\"{4}\" data-metre=\"{5}\"{6}>",
      view.width * view.scale, view.height * view.scale, view.x0, view.y0 + view.height, view.scale,
      view.per_metre(), grid ? " data-grid=\"\"" : "");
  if (input.picture != nullptr && !input.picture->empty()) svg += picture_svg(*input.picture, view);
  if (input.inventory != nullptr) svg += thin_svg(*input.inventory, view);
  if (input.inventory != nullptr) svg += crowns_svg(*input.inventory, view);
  if (input.inventory != nullptr) svg += dead_wood_svg(*input.inventory, view);
  if (const std::vector<Tree>* trees = report_trees(input)) svg += trees_svg(*trees, view);
  if (!input.falls.empty()) svg += falls_svg(input.falls, view);
  svg += loops_svg(input.loops, view);
  if (!input.fixes.empty()) svg += fixes_svg(input.fixes, view);
  svg += path_svg(input.scans, view, input.moved);
  if (!input.scans.empty()) {
    svg += markers(view.at(input.scans.front().position), view.at(input.scans.back().position));
  }
  if (input.inventory != nullptr) svg += look_svg(*input.inventory, view);
  if (grid) svg += grid_svg(view);
  svg += scale_bar(view);
  if (input.north_is_up) svg += north_arrow(view);
  return svg + "</svg>";
}

std::string tree_legend(const ReportInput& input) {
  const std::vector<Tree>* trees = report_trees(input);
  if (trees == nullptr) return "";
  const StandDoubts doubts = doubts_of(*trees);
  std::string legend;
  const auto entry = [&](bool any, const char* kind, const char* text) {
    if (any) legend += fmt::format("<span><i class=\"dot {}\"></i>{}</span> ", kind, text);
  };
  entry(doubts.diameters > doubts.weak_diameters || trees->empty(), "sure", "tree");
  entry(doubts.weak_diameters > 0, "weak", "tree, diameter doubtful (± over 30 %)");
  entry(doubts.by_crown > 0, "crown", "tree without a diameter");
  return legend;
}

std::string map_legend(const ReportInput& input) {
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
  legend += tree_legend(input);
  if (input.inventory != nullptr && input.inventory->dead_wood &&
      !input.inventory->dead_wood->empty()) {
    entry(" class=\"box\"", "border:2px solid #8a5a2b", "stump");
    entry("", "border-color:#8a5a2b", "lying stem");
  }
  if (input.inventory != nullptr && !input.inventory->thin.corners.empty())
    legend += "<span><i class=\"box thin\"></i>thin coverage: stems may be missing</span> ";
  if (input.inventory != nullptr && !input.inventory->look_again.empty())
    legend += "<span><i class=\"box look\">1</i>walk here (below)</span> ";
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
  return legend + "</p>";
}

}  // namespace

std::string map_section(const ReportInput& input) {
  if (input.picture == nullptr && input.scans.empty() && report_trees(input) == nullptr) return "";
  const MapView view = map_view(input);
  return "<section><h2>The map from above</h2>" + map_svg(input, view) + map_legend(input) +
         (input.inventory == nullptr ? std::string() : look_list(*input.inventory, view)) +
         (input.moved && input.trees_of_cloud ? kOfMoved : "") + "</section>\n";
}

}  // namespace understory
