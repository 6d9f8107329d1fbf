#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "understory/forest/stems/stem_axis.h"
#include "understory/forest/trees/tree_doubt.h"
#include "understory/forest/trees/tree_heights.h"
#include "understory/output/report/png.h"
#include "understory/output/report/report_parts.h"
#include "understory/util/fixed_text.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

// A number of centimetres, as short as it goes; empty if unknown.
std::string whole_cm(double metres) {
  return std::isfinite(metres) ? std::to_string(std::lround(100.0 * metres)) : std::string();
}

std::string shortest(double value, int decimals) {
  return std::isfinite(value) ? fixed_text(value, decimals) : std::string();
}

char byte_of(double value) {
  return static_cast<char>(std::clamp(std::lround(value) + 128L, 0L, 255L));
}

// Three bytes a point: east in cubes, and height in cubes with what it is in the highest bits.
std::string front_bytes(const TreeSheet& sheet) {
  constexpr float kPerMetre = 25.0F;  // cubes of 4 cm
  constexpr std::uint32_t kOfStem = 0x8000;
  constexpr std::uint32_t kStranger = 0x4000;
  std::string bytes;
  for (const TreeSheet::FrontPoint& point : sheet.front) {
    auto word = static_cast<std::uint32_t>(std::max(0.0F, point.place.z() * kPerMetre)) & 0x3fffU;
    if (point.stem) word |= kOfStem;
    if (!point.own) word |= kStranger;
    bytes += byte_of(std::floor(static_cast<double>(point.place.x() * kPerMetre)));
    bytes += static_cast<char>(word & 0xffU);
    bytes += static_cast<char>(word >> 8U);
  }
  return base64(bytes);
}

// Two bytes a point: 127 is the reach of the section.
std::string section_bytes(const TreeSheet& sheet) {
  std::string bytes;
  for (const Eigen::Vector2f& point : sheet.section) {
    bytes += byte_of(127.0 * static_cast<double>(point.x()) / sheet.section_reach_m);
    bytes += byte_of(127.0 * static_cast<double>(point.y()) / sheet.section_reach_m);
  }
  return base64(bytes);
}

// The outline of a stem, every metre: height, east of the foot, diameter, centimetres.
std::string outline_of(const InventoryResult& inventory, std::size_t tree) {
  const StemFit& stem = inventory.stems[tree];
  const double foot = stem_place_at(stem, 0.0).x();
  std::string outline;
  const auto add = [&](double height_m, double east_m, double diameter_m) {
    outline += fmt::format("{}{} {} {}", outline.empty() ? "" : "|", whole_cm(height_m),
                           whole_cm(east_m - foot), whole_cm(diameter_m));
  };
  constexpr std::size_t kEach = 10;  // sections of a curve are a decimetre apart
  if (tree < inventory.curves.size() && !inventory.curves[tree].sections.empty()) {
    const std::vector<CurveSection>& sections = inventory.curves[tree].sections;
    for (std::size_t i = 0; i < sections.size(); i += kEach)
      add(sections[i].height_m, sections[i].centre.x(), sections[i].diameter_m);
    return outline;
  }
  for (const double height : {stem.lowest_m, kBreastHeight, stem.highest_m})
    add(height, stem_place_at(stem, height).x(),
        2.0 * (stem.radius_m + (height - kBreastHeight) * stem.taper));
  return outline;
}

std::string line_of(const InventoryResult& inventory, const TreeSheet& sheet) {
  const Tree& tree = inventory.trees[sheet.tree];
  const StemFit& stem = inventory.stems[sheet.tree];
  const double measured_to_m = sheet.tree < inventory.curves.size()
                                   ? inventory.curves[sheet.tree].measured_to_m
                                   : stem.highest_m;
  return fmt::format(
      "{},{},{},{},{},{},{},{:x},{},{},{}\n", tree.id, shortest(100.0 * tree.dbh_m, 1),
      shortest(100.0 * tree.dbh_sd_m, 1), shortest(tree.height_m, 1), shortest(stem.arc_deg, 0),
      shortest(sheet.section_reach_m, 4), shortest(measured_to_m, 1), sheet.seen.to_ullong(),
      outline_of(inventory, sheet.tree), front_bytes(sheet), section_bytes(sheet));
}

}  // namespace

std::string sheets_part(const InventoryResult& inventory) {
  if (inventory.sheets.empty()) return "";
  std::vector<const TreeSheet*> sheets;
  for (const TreeSheet& sheet : inventory.sheets)
    sheets.push_back(&sheet);
  const auto doubt = [&](const TreeSheet* sheet) {
    return doubt_of(inventory.trees[sheet->tree], inventory.stems[sheet->tree].arc_deg);
  };
  sort_stably(sheets, [&](const TreeSheet* a, const TreeSheet* b) { return doubt(a) > doubt(b); });
  std::string html =
      "<h3>Tree by tree, the most doubtful first</h3><p>Front view, and the cross section 0.9–1.9 "
      "m "
      "above the ground. Doubtful are trees whose diameter has a large standard deviation (±), "
      "whose stem was seen from few sides, or whose height is not known.</p>";
  if (sheets.size() < inventory.stems.size())
    html += fmt::format("<p class=\"sub\">The {} most doubtful of {}.</p>", sheets.size(),
                        inventory.stems.size());
  html +=
      "<div class=\"sheets\"><noscript>The sheets are drawn by a script of this page, and scripts "
      "are switched off.</noscript></div><script type=\"text/plain\" class=\"sheet-data\">";
  for (const TreeSheet* sheet : sheets)
    html += line_of(inventory, *sheet);
  return html + "</script>";
}

}  // namespace understory
