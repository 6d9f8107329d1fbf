#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <string>

#include "understory/output/report/map_view.h"
#include "understory/output/report/report_parts.h"
#include "understory/util/fixed_text.h"

namespace understory {
namespace {

constexpr std::size_t kMostRows = 1'000;
constexpr double kThinnestLine = 2.0;  // units of the picture
constexpr double kStumpSide = 3.0;

std::string row_of(std::size_t id, const DeadWood& piece, bool ned) {
  const double x = ned ? piece.from.y() : piece.from.x();
  const double y = ned ? piece.from.x() : piece.from.y();
  std::string row = fmt::format("<td class=\"n\">{}</td><td>{}</td>", id,
                                piece.kind == DeadWoodKind::kStump ? "stump" : "lying stem");
  for (const std::string& cell :
       {fixed_text(x, 2), fixed_text(y, 2), fmt::format("{:.0f}", 100.0 * piece.diameter_m),
        fmt::format("{:.0f}", 100.0 * piece.diameter_to_m),
        fmt::format("{:.1f}", 100.0 * piece.diameter_sd_m), fmt::format("{:.1f}", piece.length_m()),
        fmt::format("{:.3f}", piece.volume_m3()), std::to_string(piece.observations)})
    row += fmt::format("<td class=\"n\">{}</td>", cell);
  return "<tr>" + row + "</tr>";
}

}  // namespace

std::string dead_wood_svg(const InventoryResult& inventory, const MapView& view) {
  if (!inventory.dead_wood || inventory.dead_wood->empty()) return "";
  std::string svg = "<g class=\"wood\" fill=\"none\" stroke=\"#8a5a2b\" stroke-linecap=\"round\">";
  const auto out = std::back_inserter(svg);
  for (const DeadWood& piece : *inventory.dead_wood) {
    const Eigen::Vector2d from = view.at(piece.from);
    if (piece.kind == DeadWoodKind::kStump) {
      fmt::format_to(out, "<path stroke-width=\"1.5\" d=\"M{0:.1f} {1:.1f}h{2}v{2}h-{2}z\"/>",
                     from.x() - kStumpSide, from.y() - kStumpSide, 2.0 * kStumpSide);
    } else {
      const Eigen::Vector2d to = view.at(piece.to);
      const double width = 0.5 * (piece.diameter_m + piece.diameter_to_m) * view.per_metre();
      fmt::format_to(out, "<path stroke-width=\"{:.1f}\" d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\"/>",
                     std::max(kThinnestLine, width), from.x(), from.y(), to.x(), to.y());
    }
  }
  return svg + "</g>";
}

std::string dead_wood_part(const InventoryResult& inventory, WorldFrame world_frame) {
  if (!inventory.dead_wood || inventory.dead_wood->empty()) return "";
  const std::vector<DeadWood>& pieces = *inventory.dead_wood;
  std::size_t stumps = 0;
  double volume_m3 = 0.0;
  for (const DeadWood& piece : pieces) {
    const bool stump = piece.kind == DeadWoodKind::kStump;
    stumps += stump ? 1 : 0;
    volume_m3 += stump ? 0.0 : piece.volume_m3();
  }
  std::string html = fmt::format(
      "<h3>Dead wood</h3><p>{} {} and {} lying {} ({:.2f} m³) show. Others may be missing: wood "
      "within plants or moss, and wood that hardly stands out from the ground, is not found. x and "
      "y are those of the foot or of the thick end. The length of a stump is its height. ± is one "
      "standard deviation of the diameter.</p><div class=\"scroll\"><table class=\"sort\"><thead>"
      "<tr><th class=\"n\">no.</th><th>kind</th>",
      stumps, stumps == 1 ? "stump" : "stumps", pieces.size() - stumps,
      pieces.size() - stumps == 1 ? "stem" : "stems", volume_m3);
  for (const char* title : {"x, m", "y, m", "diameter, cm", "at the other end, cm", "± cm",
                            "length, m", "volume, m³", "returns"})
    html += fmt::format("<th class=\"n\">{}</th>", title);
  html += "</tr></thead><tbody>";
  for (std::size_t i = 0; i < std::min(pieces.size(), kMostRows); ++i)
    html += row_of(i + 1, pieces[i], world_frame == WorldFrame::kNed);
  html += "</tbody></table></div>";
  if (pieces.size() > kMostRows)
    html += fmt::format("<p class=\"sub\">The first {} of {}; all are in dead_wood.csv.</p>",
                        kMostRows, pieces.size());
  return html;
}

}  // namespace understory
