#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <map>

#include "understory/output/report/png.h"
#include "understory/output/report/report_parts.h"
#include "understory/output/report/svg_plot.h"
#include "understory/util/fixed_text.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

// P4-9: the layer of the cross sections, above the ground.
constexpr float kCrossLow = 0.9F;
constexpr float kCrossHigh = 1.9F;
constexpr double kPanel = 30.0;  // metres of a cross section's side: stems are still to be seen
constexpr std::size_t kMostPanels = 8;
constexpr std::size_t kFewestPoints = 20;
constexpr std::size_t kFewestPointsWithoutTree = 1'000;  // a stem that was missed may be there
constexpr std::size_t kLongestTable = 3'000;

std::string centimetres(double metres) {
  return std::isfinite(metres) ? fixed_text(100.0 * metres, 1) : "";
}

std::string metres(double value, int decimals) {
  return std::isfinite(value) ? fixed_text(value, decimals) : "";
}

// A square (or smaller) part of the stand, relative to the inventory's origin.
struct Panel {
  double x0 = 0.0, y0 = 0.0, width = 0.0, height = 0.0;
  std::size_t trees = 0;
  std::size_t points = 0;
};

std::vector<Panel> panels_of(const InventoryResult& inventory) {
  float x0 = 1e9F;
  float y0 = 1e9F;
  float x1 = -1e9F;
  float y1 = -1e9F;
  for (const SlicePoint& p : inventory.slices) {
    x0 = std::min(x0, p.x);
    y0 = std::min(y0, p.y);
    x1 = std::max(x1, p.x);
    y1 = std::max(y1, p.y);
  }
  if (x1 < x0) return {};
  const auto parts = [](double length) {
    return std::max(1, static_cast<int>(std::ceil(length / (1.2 * kPanel))));
  };
  const double width = static_cast<double>(x1 - x0) + 0.4;
  const double height = static_cast<double>(y1 - y0) + 0.4;
  const int columns = parts(width);
  const int rows = parts(height);
  std::vector<Panel> panels;
  for (int row = rows - 1; row >= 0; --row) {
    for (int column = 0; column < columns; ++column) {
      panels.push_back({static_cast<double>(x0) - 0.2 + column * width / columns,
                        static_cast<double>(y0) - 0.2 + row * height / rows, width / columns,
                        height / rows});
    }
  }
  const auto at = [&](double x, double y) -> Panel& {
    const int column =
        std::clamp(static_cast<int>((x - panels[0].x0) / (width / columns)), 0, columns - 1);
    const int row = std::clamp(
        static_cast<int>((y - (static_cast<double>(y0) - 0.2)) / (height / rows)), 0, rows - 1);
    return panels[static_cast<std::size_t>((rows - 1 - row) * columns + column)];
  };
  for (const StemFit& stem : inventory.stems)
    ++at(stem.centre.x(), stem.centre.y()).trees;
  for (const SlicePoint& p : inventory.slices)
    ++at(static_cast<double>(p.x), static_cast<double>(p.y)).points;
  return panels;
}

std::string cross_section(const InventoryResult& inventory, const Panel& panel) {
  const int width = 1100;
  const double scale = width / panel.width;
  const int height = std::max(1, static_cast<int>(panel.height * scale));
  PalettePicture picture{width, height, {{255, 255, 255}, {45, 52, 48}}, {}};
  picture.pixels.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
  for (const SlicePoint& p : inventory.slices) {
    if (p.height_m < kCrossLow || p.height_m > kCrossHigh) continue;
    const double x = (static_cast<double>(p.x) - panel.x0) * scale;
    const double y = (panel.y0 + panel.height - static_cast<double>(p.y)) * scale;
    if (x < 0 || y < 0 || x + 1 >= width || y + 1 >= height) continue;
    for (int k = 0; k < 4; ++k)
      picture.at(static_cast<int>(x) + k % 2, static_cast<int>(y) + k / 2) = 1;
  }
  std::string svg = fmt::format(
      "<svg class=\"paper\" viewBox=\"0 0 {0} {1}\" role=\"img\" aria-label=\"cross "
      "section\"><image width=\"{0}\" height=\"{1}\" href=\"data:image/png;base64,{2}\"/>",
      width, height, base64(encode_png(picture)));
  const auto out = std::back_inserter(svg);
  for (std::size_t i = 0; i < inventory.stems.size(); ++i) {
    const StemFit& stem = inventory.stems[i];
    const double x = (stem.centre.x() - panel.x0) * scale;
    const double y = (panel.y0 + panel.height - stem.centre.y()) * scale;
    if (x < 0 || y < 0 || x > width || y > height) continue;
    const double r = stem.radius_m * scale;
    fmt::format_to(out,
                   "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\" fill=\"none\" "
                   "stroke=\"#d0342c\" stroke-width=\"2\"/><text x=\"{:.1f}\" y=\"{:.1f}\" "
                   "font-size=\"20\" fill=\"#1552a8\">{}</text>",
                   x, y, r, x + r + 3, y - r, inventory.trees[i].id);
  }
  const double bar = panel.width > 12.0 ? 5.0 : 1.0;
  fmt::format_to(
      out,
      "<path d=\"M14 {0}v8h{1:.1f}v-8\" fill=\"none\" stroke=\"#111\" stroke-width=\"2.5\"/>"
      "<text x=\"{2:.1f}\" y=\"{3}\" font-size=\"22\">{4:.0f} m</text></svg>",
      height - 20, bar * scale, 22 + bar * scale, height - 10, bar);
  return svg;
}

std::string cross_sections(const InventoryResult& inventory) {
  std::vector<Panel> panels = panels_of(inventory);
  // At the edge of the view a part may hold hardly more than noise.
  std::erase_if(panels, [](const Panel& p) {
    return p.points < (p.trees > 0 ? kFewestPoints : kFewestPointsWithoutTree);
  });
  if (panels.empty()) return "";
  const std::size_t all = panels.size();
  if (all > kMostPanels) {
    sort_stably(panels, [](const Panel& a, const Panel& b) { return a.trees > b.trees; });
    panels.resize(kMostPanels);
  }
  std::string html =
      "<h3>Cross section 0.9–1.9 m above the ground</h3><p>Every dot is a point of the cloud. Red "
      "circles are the measured stems at 1.3 m with their number. A ring of dots without a circle "
      "is a stem that was missed.</p><div class=\"panels";
  html += panels.size() == 1 ? " one\">" : "\">";
  for (const Panel& panel : panels) {
    html += "<figure>" + cross_section(inventory, panel) +
            fmt::format("<figcaption>x {} to {} m, y {} to {} m</figcaption></figure>",
                        fixed_text(inventory.origin.x() + panel.x0, 0),
                        fixed_text(inventory.origin.x() + panel.x0 + panel.width, 0),
                        fixed_text(inventory.origin.y() + panel.y0, 0),
                        fixed_text(inventory.origin.y() + panel.y0 + panel.height, 0));
  }
  html += "</div>";
  if (all > panels.size()) {
    html += fmt::format("<p class=\"sub\">The {} parts with most trees of {} are shown.</p>",
                        panels.size(), all);
  }
  return html;
}

// With a sign where the top was hardly seen.
std::string height_text(const Tree& tree) {
  if (!std::isfinite(tree.height_m)) return {};
  return fmt::format("{}{:.1f}", tree.height_is_lower_bound > 0.0 ? "≥ " : "", tree.height_m);
}

// A tree from the side: ground grey, vegetation green, as far up as it was seen.
std::string front_view(const TreeSegment& segment, double top_m) {
  constexpr double kReach = 1.5;
  constexpr int kPerMetre = 40;
  const int width = static_cast<int>(2.0 * kReach * kPerMetre);
  const int height = std::max(1, static_cast<int>((top_m + 0.6) * kPerMetre));
  PalettePicture picture{width, height, {{255, 255, 255}, {150, 150, 150}, {47, 122, 60}}, {}};
  picture.pixels.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
  for (const Eigen::Vector3f& p : segment.points) {
    const auto x = static_cast<int>((static_cast<double>(p.x()) + kReach) * kPerMetre);
    const auto y = static_cast<int>((top_m + 0.3 - static_cast<double>(p.z())) * kPerMetre);
    if (x < 0 || y < 0 || x + 1 >= width || y + 1 >= height) continue;
    for (int k = 0; k < 4; ++k)
      picture.at(x + k % 2, y + k / 2) = p.z() < 0.2F ? 1 : 2;
  }
  std::string svg = fmt::format(
      "<svg class=\"paper\" viewBox=\"-90 0 {3} {1}\" preserveAspectRatio=\"xMidYMax meet\" "
      "style=\"height:420px\" role=\"img\" aria-label=\"front view\"><image width=\"{0}\" "
      "height=\"{1}\" href=\"data:image/png;base64,{2}\"/>",
      width, height, base64(encode_png(picture)), width + 90);
  const double step = top_m > 12.0 ? 5.0 : 1.0;
  const double size = 0.032 * height;
  for (double h = 0.0; h <= top_m; h += step) {
    const double y = (top_m + 0.3 - h) * kPerMetre;
    svg += fmt::format(
        "<line x1=\"-30\" x2=\"-5\" y1=\"{0:.1f}\" y2=\"{0:.1f}\" stroke=\"#555\" "
        "stroke-width=\"{1:.1f}\"/><text x=\"-36\" y=\"{2:.1f}\" text-anchor=\"end\" "
        "font-size=\"{3:.1f}\">{4:.0f}</text>",
        y, 0.08 * size, y + 0.35 * size, size, h);
  }
  return svg + "</svg>";
}

std::string section_of(const TreeSegment& segment, const Tree& tree, const StemFit& stem) {
  constexpr double kReach = 0.6;
  constexpr int kSide = 300;
  constexpr double kScale = kSide / (2.0 * kReach);
  PalettePicture picture{kSide, kSide, {{255, 255, 255}, {45, 52, 48}}, {}};
  picture.pixels.assign(static_cast<std::size_t>(kSide) * kSide, 0);
  for (const Eigen::Vector3f& p : segment.points) {
    if (p.z() < kCrossLow || p.z() > kCrossHigh) continue;
    const double rise = static_cast<double>(p.z());
    // Along the lean, so that a leaning stem gives a circle and not a smear.
    const double dx = static_cast<double>(p.x()) - rise * stem.slope.x();
    const double dy = static_cast<double>(p.y()) - rise * stem.slope.y();
    const auto x = static_cast<int>((dx + kReach) * kScale);
    const auto y = static_cast<int>((kReach - dy) * kScale);
    if (x < 0 || y < 0 || x + 1 >= kSide || y + 1 >= kSide) continue;
    for (int k = 0; k < 4; ++k)
      picture.at(x + k % 2, y + k / 2) = 1;
  }
  return fmt::format(
      "<svg class=\"paper\" viewBox=\"0 0 {0} {0}\" role=\"img\" aria-label=\"cross "
      "section\"><image width=\"{0}\" height=\"{0}\" href=\"data:image/png;base64,{1}\"/><circle "
      "cx=\"{2}\" cy=\"{2}\" r=\"{3:.1f}\" fill=\"none\" stroke=\"#d0342c\" "
      "stroke-width=\"2\"/><path d=\"M10 282v8h{4:.1f}v-8\" fill=\"none\" stroke=\"#111\" "
      "stroke-width=\"2\"/><text x=\"{5:.1f}\" y=\"292\" font-size=\"20\">20 cm</text></svg>",
      kSide, base64(encode_png(picture)), kSide / 2, 0.5 * tree.dbh_m * kScale, 0.2 * kScale,
      16 + 0.2 * kScale);
}

std::string single_trees(const InventoryResult& inventory) {
  if (inventory.segments.empty()) return "";
  float top = 3.0F;
  for (const TreeSegment& segment : inventory.segments) {
    for (const Eigen::Vector3f& p : segment.points)
      top = std::max(top, p.z());
  }
  std::string html =
      "<h3>Some trees one by one</h3><p>Front view (height in metres), and the cross section of "
      "its stem 0.9–1.9 m above the ground. A sharp map shows one thin ring. A double or thick "
      "ring means that the scans do not lie on each other.</p><div class=\"trees\">";
  for (const TreeSegment& segment : inventory.segments) {
    const auto i = static_cast<std::size_t>(segment.tree_id - 1);
    const Tree& tree = inventory.trees[i];
    html +=
        "<figure>" + front_view(segment, static_cast<double>(top)) +
        section_of(segment, tree, inventory.stems[i]) +
        fmt::format("<figcaption>tree {}: {} ± {} cm{}</figcaption></figure>", tree.id,
                    centimetres(tree.dbh_m), centimetres(tree.dbh_sd_m),
                    std::isfinite(tree.height_m) ? ", " + height_text(tree) + " m" : std::string());
  }
  return html + "</div>";
}

// How many trees have which value, `scale` times the member.
std::string distribution(const char* title, Histogram histogram, const std::vector<Tree>& trees,
                         double Tree::*member, double scale) {
  histogram.y_label = "trees";
  for (const Tree& tree : trees) {
    if (!std::isfinite(tree.*member)) continue;
    const auto bin = static_cast<std::size_t>(scale * (tree.*member) / histogram.step);
    if (histogram.counts.size() <= bin) histogram.counts.resize(bin + 1, 0);
    ++histogram.counts[bin];
  }
  if (histogram.counts.empty()) return "";
  histogram.counts.push_back(0);
  return fmt::format("<figure><h3>{}</h3>{}</figure>", title, svg_histogram(histogram));
}

std::string diameters(const std::vector<Tree>& trees) {
  Histogram histogram;
  histogram.x_label = "diameter at 1.3 m, cm";
  histogram.step = 4.0;
  return distribution("Diameters", histogram, trees, &Tree::dbh_m, 100.0);
}

std::string heights(const std::vector<Tree>& trees) {
  Histogram histogram;
  histogram.x_label = "height above the ground, m";
  histogram.step = 2.0;
  return distribution("Heights", histogram, trees, &Tree::height_m, 1.0);
}

// How trees are found and what their figures mean, in a forester's words.
std::string about_trees(const InventoryResult& inventory) {
  std::string html;
  if (!inventory.stems.empty())
    html +=
        "<p>A stem is listed where points show its surface at several heights around 1.3 m. "
        "± is one standard deviation of the diameter, without the widening by the laser's beam. A "
        "height is given only where points were seen above the stem and the lidar looked higher "
        "still. Where foliage hid the top, the tree is higher.</p>";
  if (inventory.trees.size() > inventory.stems.size())
    html +=
        "<p>Trees without a diameter were found by their crowns. Their x and y are those of the "
        "top. The area is that of the crown seen from above. Trees below other crowns are not "
        "listed.</p>";
  return html;
}

// A column of the table of trees: its title, and the cell of the i-th tree.
struct TableColumn {
  const char* title;
  std::function<std::string(std::size_t)> cell;
};

// What times and places in the tables count from.
struct ReportTimeAndAxes {
  TimeNs start = 0;  // of the recording
  WorldFrame world_frame = WorldFrame::kEnu;
  [[nodiscard]] bool ned() const { return world_frame == WorldFrame::kNed; }
};

// The columns that hold anything: trees by their crowns alone have no figures of a stem.
std::vector<TableColumn> columns_of(const std::vector<Tree>& trees,
                                    const std::vector<StemFit>* stems, bool of_cloud,
                                    const ReportTimeAndAxes& told) {
  const auto number = [&](double Tree::*member, int decimals) {
    return [&trees, member, decimals](std::size_t i) { return metres(trees[i].*member, decimals); };
  };
  const auto in_cm = [&](double Tree::*member) {
    return [&trees, member](std::size_t i) { return centimetres(trees[i].*member); };
  };
  const auto any = [&](double Tree::*member) {
    return std::any_of(trees.begin(), trees.end(),
                       [&](const Tree& tree) { return std::isfinite(tree.*member); });
  };
  const auto observations = [&trees](std::size_t i) {
    return std::to_string(trees[i].observations);
  };
  std::vector<TableColumn> columns = {
      {"no.", [&trees](std::size_t i) { return std::to_string(trees[i].id); }},
      {"x, m", number(told.ned() ? &Tree::y : &Tree::x, 2)},
      {"y, m", number(told.ned() ? &Tree::x : &Tree::y, 2)},
      {told.ned() ? "ground (z, down), m" : "ground, m",
       [&trees, told](std::size_t i) { return metres(told.ned() ? -trees[i].z : trees[i].z, 2); }}};
  const bool measured = any(&Tree::dbh_m) || trees.empty();
  if (measured) {
    columns.push_back({"diameter, cm", in_cm(&Tree::dbh_m)});
    columns.push_back({"± cm", in_cm(&Tree::dbh_sd_m)});
    columns.push_back({"lean, °", number(&Tree::lean_deg, 1)});
  }
  if (of_cloud)
    columns.push_back({"height, m", [&trees](std::size_t i) { return height_text(trees[i]); }});
  if (of_cloud && any(&Tree::height_sd_m))
    columns.push_back({"± m", number(&Tree::height_sd_m, 1)});
  if (measured) columns.push_back({of_cloud ? "returns" : "views", observations});
  if (measured && stems != nullptr)
    columns.push_back({"seen around, °", [stems](std::size_t i) {
                         return i < stems->size() ? metres((*stems)[i].arc_deg, 0) : std::string();
                       }});
  if (any(&Tree::stem_volume_m3)) columns.push_back({"stem, m³", number(&Tree::stem_volume_m3, 3)});
  if (any(&Tree::sweep_m)) columns.push_back({"sweep, cm", in_cm(&Tree::sweep_m)});
  if (any(&Tree::fork_m)) columns.push_back({"forks at, m", number(&Tree::fork_m, 1)});
  if (std::any_of(trees.begin(), trees.end(), [](const Tree& tree) { return tree.snag == 1.0; }))
    columns.push_back({"snag", [&trees](std::size_t i) {
                         return trees[i].snag == 1.0 ? std::string("yes") : std::string();
                       }});
  if (any(&Tree::crown_base_m))
    columns.push_back({"crown from, m", number(&Tree::crown_base_m, 1)});
  if (any(&Tree::crown_area_m2)) columns.push_back({"crown, m²", number(&Tree::crown_area_m2, 1)});
  if (any(&Tree::missing_since_s))
    columns.push_back({"missing since, s", [&trees, told](std::size_t i) {
                         return metres(trees[i].missing_since_s - to_seconds(told.start), 0);
                       }});
  return columns;
}

std::string about_columns(const std::vector<StemFit>* stems, bool of_cloud, bool ned) {
  std::string html = "<p class=\"so\">x, y and the height of the ground are as in trees.csv";
  html += ned ? ": north, east and down. " : ". ";
  const bool with_stems = stems == nullptr || !stems->empty();
  if (with_stems) html += "They are those of the stem's foot. ";
  if (!of_cloud) html += "Views are the scans that show the stem.";
  if (of_cloud && with_stems)
    html +=
        "The error of a height (± m) is large where the ground at the foot was not seen. Returns "
        "are "
        "laser points on the stem. ";
  if (stems != nullptr && with_stems)
    html += "Seen around is the part of its circumference that the laser saw.";
  return html + "</p>";
}

// `stems`: their fits in the same order, or null. `of_cloud`: else trees come from sights of single
// views, which have no heights.
std::string tree_table(const std::vector<Tree>& trees, const std::vector<StemFit>* stems,
                       bool of_cloud, const ReportTimeAndAxes& told) {
  std::string html =
      "<div class=\"all-trees\"><h3>All trees</h3><div class=\"scroll\"><table "
      "class=\"sort\"><thead><tr>";
  const std::vector<TableColumn> columns = columns_of(trees, stems, of_cloud, told);
  for (const TableColumn& column : columns)
    html += fmt::format("<th class=\"n\">{}</th>", column.title);
  html += "</tr></thead><tbody>";
  for (std::size_t i = 0; i < std::min(trees.size(), kLongestTable); ++i) {
    html += "<tr>";
    for (const TableColumn& column : columns)
      html += fmt::format("<td class=\"n\">{}</td>", column.cell(i));
    html += "</tr>";
  }
  html += "</tbody></table></div>";
  if (trees.size() > kLongestTable) {
    html += fmt::format("<p class=\"sub\">The first {} of {}; all are in trees.csv.</p>",
                        kLongestTable, trees.size());
  }
  return html + about_columns(stems, of_cloud, told.ned()) + "</div>";
}

std::string fall_table(const std::vector<TreeFall>& falls, const ReportTimeAndAxes& told) {
  if (falls.empty()) return "";
  std::string html =
      "<h3>Felled trees</h3><p>Trees that stood at first and were gone later, though they would "
      "have been in view: crosses on the map.</p><div class=\"scroll\"><table "
      "class=\"sort\"><thead><tr><th class=\"n\">no.</th><th class=\"n\">x, m</th><th "
      "class=\"n\">y, m</th><th class=\"n\">seen until, s</th><th class=\"n\">gone since, "
      "s</th><th class=\"n\">views without it</th></tr></thead><tbody>";
  for (const TreeFall& fall : falls) {
    html += "<tr>";
    for (const std::string& cell :
         {std::to_string(fall.tree_id), metres(told.ned() ? fall.y : fall.x, 2),
          metres(told.ned() ? fall.x : fall.y, 2),
          metres(to_seconds(fall.seen_until - told.start), 0),
          metres(to_seconds(fall.gone_since - told.start), 0), std::to_string(fall.missed)})
      html += fmt::format("<td class=\"n\">{}</td>", cell);
    html += "</tr>";
  }
  return html + "</tbody></table></div>";
}

// Trees of a cloud that is not at hand: of a run that was moved.
std::string section_of_moved(const ReportInput& input) {
  const std::vector<Tree>& trees = *input.trees;
  const ReportTimeAndAxes told{input.scans.empty() ? 0 : input.scans.front().stamp,
                               input.world_frame};
  return "<section><h2>Trees</h2><p>These are the trees of the run that was moved. Its own report "
         "shows their cross sections. ± is one standard deviation of the diameter. ≥ marks a "
         "height that is a lower bound.</p><div class=\"two\">" +
         diameters(trees) + "</div>" + fall_table(input.falls, told) +
         tree_table(trees, nullptr, true, told) + "</section>\n";
}

std::string section_of_views(const ReportInput& input) {
  const std::vector<Tree>& trees = *input.trees;
  const ReportTimeAndAxes told{input.scans.empty() ? 0 : input.scans.front().stamp,
                               input.world_frame};
  return "<section><h2>Trees</h2><p>A tree is listed where many of the views that could see it saw "
         "a stem. Its place is the mean of these sights. ± is one standard deviation of the "
         "diameter. Heights are not measured.</p><div class=\"two\">" +
         diameters(trees) + "</div>" + fall_table(input.falls, told) +
         tree_table(trees, nullptr, false, told) + "</section>\n";
}

}  // namespace

std::string stand_section(const ReportInput& input) {
  if (input.inventory == nullptr)
    return input.trees == nullptr || input.trees->empty() ? ""
           : input.trees_of_cloud                         ? section_of_moved(input)
                                                          : section_of_views(input);
  const InventoryResult& inventory = *input.inventory;
  std::string html = "<section><h2>Trees</h2>";
  if (inventory.trees.empty()) {
    html += "<p>No stem could be measured in this cloud.</p>";
  } else {
    html += about_trees(inventory) + "<div class=\"two\">";
    if (!inventory.stems.empty()) html += diameters(inventory.trees);
    html += heights(inventory.trees) + "</div>";
  }
  html += cross_sections(inventory);
  if (!inventory.trees.empty())
    html += single_trees(inventory) + sheets_part(inventory) +
            tree_table(inventory.trees, &inventory.stems, true, {0, input.world_frame});
  html += dead_wood_part(inventory, input.world_frame);
  return html + "</section>\n";
}

}  // namespace understory
