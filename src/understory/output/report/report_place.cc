#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>
#include <variant>

#include "understory/georeference/systems/coordinate_system.h"
#include "understory/output/report/report_parts.h"
#include "understory/output/report/svg_plot.h"
#include "understory/util/fixed_text.h"

namespace understory {
namespace {

// A figure of a fit that tells how well it holds.
struct Residual {
  const char* key;  // under "quality" in run.json
  const char* name;
  const char* unit;
  double factor;
  int digits;
};
constexpr std::array<Residual, 12> kResiduals = {{
    {"gnss_fixes_used_share", "share of the fixes that were used", "%", 100.0, 0},
    {"gnss_fixes_median_m", "distance of the fixes from the path, median", "m", 1.0, 2},
    {"gnss_fit_rms_m", "distance of path and fixes, root mean square", "m", 1.0, 2},
    {"gnss_plane_rms_m", "fixes off the path in the plane, root mean square", "m", 1.0, 2},
    {"gnss_height_rms_m", "fixes off the path in height, root mean square", "m", 1.0, 2},
    {"gnss_independent_fixes", "fixes with independent errors that would tell the place as well",
     "", 1.0, 0},
    {"trees_apart_rms_m", "trees from their partners, root mean square", "m", 1.0, 2},
    {"gnss_along_rms_m", "fixes along the path at their time, root mean square", "m", 1.0, 2},
    {"gnss_across_rms_m", "fixes across the path at their time, root mean square", "m", 1.0, 2},
    {"terrain_rms_m", "ground above the terrain model, root mean square", "m", 1.0, 2},
    {"terrain_median_m", "ground above the terrain model, median", "m", 1.0, 2},
    {"terrain_tilt_deg", "tilt that the terrain model took out", "°", 1.0, 2},
}};

// What placed the map, in words of the forest.
struct MethodWords {
  std::string_view name;  // as `georeference --method` names it
  const char* words;
};
constexpr std::array<MethodWords, 9> kMethodWords = {{
    {"split", "satellite positions: heading and place in the plane, height and tilt apart"},
    {"fit3", "satellite positions, each as exact as it states"},
    {"fit6", "satellite positions, smoothed with the IMU"},
    {"closed", "satellite positions, all with equal weight"},
    {"gnss-path", "the shape of the receiver's path"},
    {"fuse", "satellite positions, which also correct the path"},
    {"points", "surveyed points"},
    {"terrain", "a terrain model: height and tilt"},
    {"trees", "the trees of a map or of a cloud from the air"},
}};

// Several methods are joined by "+".
std::string words_of_method(std::string_view names) {
  std::string text;
  while (!names.empty()) {
    const std::string_view name = names.substr(0, names.find('+'));
    names.remove_prefix(std::min(names.size(), name.size() + 1));
    const auto* known =
        std::find_if(kMethodWords.begin(), kMethodWords.end(),
                     [&](const MethodWords& method) { return method.name == name; });
    text += text.empty() ? "" : "; ";
    text += known == kMethodWords.end() ? fmt::format("method {}", name)
                                        : fmt::format("{} (method {})", known->words, name);
  }
  return text;
}

class Rows {
 public:
  void add(const std::string& name, const std::string& value) {
    rows_ += "<tr><td>" + escape_html(name) + "</td><td>" + escape_html(value) + "</td></tr>";
  }
  [[nodiscard]] std::string html() const {
    return "<div class=\"wide\"><table>" + rows_ + "</table></div>";
  }

 private:
  std::string rows_;
};

void add_coordinates(const ReportInput& input, const RunPlace& place, Rows& rows) {
  const CoordinateSystem* system = input.drawing == nullptr ? nullptr : input.drawing->system();
  if (system == nullptr) return rows.add("coordinate system", place.coordinate_system);
  rows.add("coordinate system", place.coordinate_system == system->name()
                                    ? system->name()
                                    : system->name() + " (" + place.coordinate_system + ")");
  if (input.scans.empty()) return;
  const Eigen::Vector3d at = input.drawing->from_world(input.scans.front().position.cast<double>());
  rows.add("start of the path", fmt::format("E {}, N {}, height {} m", fixed_text(at.x(), 1),
                                            fixed_text(at.y(), 1), fixed_text(at.z(), 1)));
}

void add_origin(const RunPlace& place, Rows& rows) {
  rows.add("latitude, longitude of the place",
           fmt::format("{}°, {}°", fixed_text(place.origin.latitude_deg, 6),
                       fixed_text(place.origin.longitude_deg, 6)));
  rows.add("heights are", place.heights);
  if (std::abs(place.north_deg) < 0.005) return;
  rows.add("north",
           fmt::format("Grid north is up. True north lies {:.2f}° to the {} of it.",
                       std::abs(place.north_deg), place.north_deg > 0.0 ? "right" : "left"));
}

void add_errors(const ReportInput& input, const RunPlace& place, Rows& rows) {
  if (std::isfinite(place.expected_error_m))
    rows.add("expected error of the place, over the path",
             fmt::format("{:.2f} m (root mean square)", place.expected_error_m));
  if (std::isfinite(place.heading_sd_deg))
    rows.add("uncertainty of the heading",
             fmt::format("{:.2f}° (one standard deviation)", place.heading_sd_deg));
  for (const Residual& residual : kResiduals) {
    const auto found = input.summary.quality.find(residual.key);
    if (found == input.summary.quality.end()) continue;
    const double* value = std::get_if<double>(&found->second);
    if (value == nullptr || !std::isfinite(*value)) continue;
    rows.add(
        residual.name,
        fmt::format("{} {}", fixed_text(residual.factor * *value, residual.digits), residual.unit));
  }
}

// "map.laz, the rasters and trees.gpkg", of those that lie beside the page; `none`: no name is
// known.
std::string names_of(const std::vector<std::string>& files,
                     const std::vector<std::pair<const char*, const char*>>& names,
                     const char* none) {
  std::vector<std::string> there;
  for (const auto& [file, name] : names)
    if (std::find(files.begin(), files.end(), file) != files.end()) there.emplace_back(name);
  std::string text;
  for (std::size_t i = 0; i < there.size(); ++i)
    text += (i == 0 ? "" : i + 1 == there.size() ? " and " : ", ") + there[i];
  return text.empty() ? none : text;
}

}  // namespace

std::string place_section(const ReportInput& input, const std::vector<std::string>& files) {
  if (!input.summary.place) return "";
  const RunPlace& place = *input.summary.place;
  std::string html = "<section><h2>Where it is</h2>";
  if (!place.on_globe)
    return html +
           "<p>The map has no place on the globe. Its layers are in a local frame in metres: " +
           escape_html(place.reason) + ".</p></section>\n";
  Rows rows;
  add_coordinates(input, place, rows);
  add_origin(place, rows);
  if (!place.method.empty()) rows.add("found by", words_of_method(place.method));
  add_errors(input, place, rows);
  const bool fused = place.enu_from_world.log().norm() == 0.0;
  return html + "<p>In the coordinate system: " +
         names_of(
             files,
             {{"map.laz", "map.laz"}, {"dtm.tif", "the rasters"}, {"trees.gpkg", "trees.gpkg"}},
             "the layers") +
         ". In the frame of the run: " +
         names_of(files, {{"trajectory.tum", "trajectory.tum"}, {"trees.csv", "trees.csv"}},
                  "the tables") +
         (fused ? fmt::format(", in metres {} of the place below",
                              input.world_frame == WorldFrame::kNed ? "north, east and down"
                                                                    : "east, north and up")
                : std::string()) +
         ".</p>" + rows.html() + "</section>\n";
}

}  // namespace understory
