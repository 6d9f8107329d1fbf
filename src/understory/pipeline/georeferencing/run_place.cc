#include "understory/pipeline/georeferencing/run_place.h"

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "understory/georeference/systems/coordinate_system.h"
#include "understory/util/error.h"
#include "understory/util/files/text_file.h"

namespace understory {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

// An object; null where the file is missing or no JSON.
Json read_run_json(const fs::path& run) {
  if (!fs::exists(run / "run.json")) return nullptr;
  Json json = Json::parse(read_text_file(run / "run.json"), nullptr, false);
  return json.is_object() ? json : Json(nullptr);
}

std::string text_at(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

Pose pose_of(const Json& json) {
  const auto t = json.at("translation_m").get<std::array<double, 3>>();
  const auto q = json.at("rotation_xyzw").get<std::array<double, 4>>();
  return Pose::from_unit(Eigen::Quaterniond(q[3], q[0], q[1], q[2]), {t[0], t[1], t[2]});
}

// Of a run that an earlier version placed: its world frame is east, north, up.
std::optional<RunPlace> place_by_figures(const Json& run) {
  const auto quality = run.find("quality");
  if (quality == run.end() || !quality->is_object()) return std::nullopt;
  const auto number = [&](const char* key) {
    const auto found = quality->find(key);
    return found != quality->end() && found->is_number() ? found->get<double>() : std::nan("");
  };
  RunPlace place;
  place.origin = {number("origin_latitude_deg"), number("origin_longitude_deg"),
                  number("origin_height_m")};
  place.on_globe =
      std::isfinite(place.origin.latitude_deg + place.origin.longitude_deg + place.origin.height_m);
  if (!place.on_globe) return std::nullopt;
  return place;
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
  const Json json = read_run_json(run);
  if (json.is_null()) return std::nullopt;
  const auto block = json.find("georeference");
  if (block == json.end()) return place_by_figures(json);
  try {
    if (!block->at("on_globe").get<bool>()) return std::nullopt;
    RunPlace place;
    place.on_globe = true;
    place.method = text_at(*block, "method");
    place.coordinate_system = text_at(*block, "coordinate_system");
    place.heights = text_at(*block, "heights");
    const Json& origin = block->at("origin");
    place.origin = {origin.at("latitude_deg").get<double>(),
                    origin.at("longitude_deg").get<double>(), origin.at("height_m").get<double>()};
    place.enu_from_world = pose_of(block->at("enu_from_world"));
    return place;
  } catch (const Json::exception& error) {
    throw InputError((run / "run.json").string(), "georeference", error.what());
  }
}

std::optional<Eigen::Vector3d> read_antenna(const fs::path& run) {
  const Json json = read_run_json(run);
  if (json.is_null() || !json.contains("georeference")) return std::nullopt;
  const Json& block = json.at("georeference");
  if (!block.is_object() || !block.contains("antenna_in_body_m")) return std::nullopt;
  try {
    const auto at = block.at("antenna_in_body_m").get<std::array<double, 3>>();
    return Eigen::Vector3d(at[0], at[1], at[2]);
  } catch (const Json::exception& error) {
    throw InputError((run / "run.json").string(), "georeference", error.what());
  }
}

LayerFrame read_layer_frame(const fs::path& run) {
  const Json json = read_run_json(run);
  if (json.is_null() || !json.contains("georeference")) return {};
  const std::optional<RunPlace> place = read_run_place(run);
  const std::string wkt = text_at(json, "coordinate_system");
  if (!place || wkt.empty()) return {};
  return {place->enu_from_world, place->origin, wkt};
}

}  // namespace understory
