#include "understory/pipeline/georeferencing/run_place.h"

#include <cmath>

#include "understory/georeference/systems/coordinate_system.h"
#include "understory/pipeline/run_folder/run_json.h"

namespace understory {
namespace {

namespace fs = std::filesystem;
// Of a run that an earlier version placed: its world frame is east, north, up.
std::optional<RunPlace> place_by_figures(const RunJson& json) {
  RunPlace place;
  place.origin = {json.find_number("/quality/origin_latitude_deg"),
                  json.find_number("/quality/origin_longitude_deg"),
                  json.find_number("/quality/origin_height_m")};
  place.on_globe =
      std::isfinite(place.origin.latitude_deg + place.origin.longitude_deg + place.origin.height_m);
  if (!place.on_globe) return std::nullopt;
  return place;
}

// Of a run.json whose block "georeference" says that it has a place.
std::optional<RunPlace> place_of(const RunJson& json) {
  if (!json.has("/georeference")) return place_by_figures(json);
  if (!json.get_flag("/georeference/on_globe")) return std::nullopt;
  RunPlace place;
  place.on_globe = true;
  place.method = json.find_text("/georeference/method");
  place.coordinate_system = json.find_text("/georeference/coordinate_system");
  place.heights = json.find_text("/georeference/heights");
  place.origin = {json.get_number("/georeference/origin/latitude_deg"),
                  json.get_number("/georeference/origin/longitude_deg"),
                  json.get_number("/georeference/origin/height_m")};
  place.enu_from_world = json.get_pose("/georeference/enu_from_world");
  place.expected_error_m = json.find_number("/georeference/expected_error_m");
  place.heading_sd_deg = json.find_number("/georeference/heading_sd_deg");
  return place;
}

std::optional<Eigen::Vector3d> place_on_body(const fs::path& run, const char* key) {
  const RunJson json(run);
  if (!json.has(key)) return std::nullopt;
  const std::vector<double> at = json.get_numbers(key, 3);
  if (std::isnan(at[0] + at[1] + at[2])) return std::nullopt;
  return Eigen::Vector3d(at[0], at[1], at[2]);
}

}  // namespace

void describe(ConfigTable& table, GeoreferenceConfig& config) {
  table.add("enabled", config.enabled,
            "lay map.laz, rasters and trees.gpkg on the globe by the recording's satellite "
            "positions");
  table.add("online", config.online,
            "global coordinates at every scan by the fixes until then, in global.csv.gz");
  table.add("crs", config.coordinate_system,
            "coordinate system of these layers, EPSG:3067 or WKT; empty: ETRS-TM35FIN in Finland, "
            "else the UTM zone");
  table.add_enum("heights", config.heights,
                 {{"ellipsoid", HeightWish::kEllipsoid}, {"geoid", HeightWish::kGeoid}},
                 "what heights of the layers are above; geoid: where PROJ has its grid");
}

void check(const GeoreferenceConfig& config) {
  if (!config.coordinate_system.empty()) (void)CoordinateSystem(config.coordinate_system);
}

ResultFrames frames_at(RunPlace& place, const GeoreferenceConfig& config, Log& log) {
  const HeightWish heights = place.heights.empty() ? config.heights : HeightWish::kEllipsoid;
  const std::string wish = config.coordinate_system.empty()
                               ? default_system(place.origin, heights)
                               : with_heights(config.coordinate_system, place.origin, heights);
  ResultFrames frames{LayerFrame(place.enu_from_world, place.origin, wish), nullptr};
  LayerFrame& layers = frames.layers;
  if (!place.heights.empty()) layers.name_heights(place.heights);
  if (!layers.system()->is_made_for(place.origin))
    log.warn("georeference.far_from_area",
             "coordinate system " + layers.code() + " is not made for the place of the run");
  if (layers.lacks_geoid() ||
      (heights == HeightWish::kGeoid && layers.system()->vertical_name().empty()))
    log.warn("georeference.no_geoid",
             "PROJ has no grid of the geoid here: heights are above the ellipsoid");
  if (layers.system()->is_geographic())
    frames.local = std::make_unique<LayerFrame>(place.enu_from_world);
  place.coordinate_system = layers.code();
  place.heights = layers.heights();
  place.north_deg = layers.north_deg();
  place.grid_scale = layers.scale();
  return frames;
}

std::optional<RunPlace> read_run_place(const fs::path& run) {
  return place_of(RunJson(run));
}

std::optional<Eigen::Vector3d> read_antenna(const fs::path& run) {
  return place_on_body(run, "/georeference/antenna_in_body_m");
}

std::optional<Eigen::Vector3d> read_second_antenna(const fs::path& run) {
  return place_on_body(run, "/georeference/second_antenna_in_body_m");
}

LayerFrame read_layer_frame(const fs::path& run) {
  const RunJson json(run);
  if (!json.has("/georeference")) return {};
  const std::optional<RunPlace> place = place_of(json);
  const std::string wkt = json.find_text("/coordinate_system");
  if (!place || wkt.empty()) return {};
  return {place->enu_from_world, place->origin, wkt};
}

}  // namespace understory
