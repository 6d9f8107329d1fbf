#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <variant>

#include "understory/cli/command.h"
#include "understory/cli/outcome.h"
#include "understory/cli/suggestion.h"
#include "understory/pipeline/georeferencing/georeferencing.h"
#include "understory/pipeline/georeferencing/methods/placement_methods.h"
#include "understory/util/error.h"

namespace understory {
namespace {

struct GeoreferenceOptions {
  std::string run;
  std::string result;
  std::string method;
  std::string gnss;
  std::string terrain_model;
  std::string points;
  std::string recording;
  std::vector<double> antenna_m;
  std::vector<double> second_antenna_m;
  std::vector<double> start;
  double time_offset_s = 0.0;
  double time_offset_sd_s = 0.0;
  double tilt_sd_deg = -1.0;  // not given
  bool plain = false;
  bool json = false;
  bool overwrite = false;
  TerrainFitConfig terrain;
  std::string coordinate_system;
  std::string tree_map;
  std::string tree_map_system;
  std::vector<double> near;
  double radius_m = 200.0;
  bool geoid = false;
};

void check_trees(const GeoreferenceOptions& options, std::vector<std::string>& problems) {
  const bool trees = options.method == "trees";
  const bool all = options.method == "auto";
  if (trees && options.tree_map.empty())
    problems.emplace_back("--method trees needs --tree-map FILE");
  if (!trees && !all &&
      !(options.tree_map.empty() && options.near.empty() && options.tree_map_system.empty()))
    problems.emplace_back("--tree-map, --tree-map-crs and --near belong to auto, trees");
  if (options.tree_map.empty() && !(options.near.empty() && options.tree_map_system.empty()))
    problems.emplace_back("--near and --tree-map-crs need --tree-map FILE");
  if (trees && !(options.gnss.empty() && options.antenna_m.empty() && !options.plain))
    problems.emplace_back("--gnss, --antenna-m and --plain do not belong to trees");
}

// Options that belong to one method are errors with the other.
void check(const GeoreferenceOptions& options) {
  std::vector<std::string> problems;
  if (options.run.empty()) problems.emplace_back("RUN is needed: a run folder");
  if (options.result.empty()) problems.emplace_back("-o is needed: the folder to write");
  check_trees(options, problems);
  const bool terrain = options.method == "terrain";
  const bool points = options.method == "points";
  if (points && options.points.empty())
    problems.emplace_back("--method points needs --points FILE");
  if (points && options.coordinate_system.empty())
    problems.emplace_back("--points needs --crs: the coordinate system of its columns");
  if (options.method != "fit6" && !options.recording.empty())
    problems.emplace_back("--recording belongs to --method fit6");
  if (!points && !options.points.empty())
    problems.emplace_back("--points belongs to --method points");
  if (points && !options.gnss.empty()) problems.emplace_back("--gnss does not belong to points");
  const bool timed =
      !terrain && !points && options.method != "gnss-path" && options.method != "trees";
  if (!timed && (options.time_offset_s != 0.0 || options.time_offset_sd_s > 0.0))
    problems.emplace_back(
        "--time-offset-s and --time-offset-sd-s belong to auto, split, closed, fit3, fit6");
  const bool by_headings = options.method == "auto" || options.method == "split";
  if (!options.second_antenna_m.empty() && (!by_headings || options.antenna_m.empty()))
    problems.emplace_back("--second-antenna-m belongs to auto, split, and needs --antenna-m");
  if (!timed && !points && options.tilt_sd_deg >= 0.0)
    problems.emplace_back("--tilt-sd-deg belongs to auto, split, closed, fit3, fit6, points");
  if (terrain && options.terrain_model.empty())
    problems.emplace_back("--method terrain needs --dem FILE");
  if (terrain && !options.gnss.empty()) problems.emplace_back("--gnss does not belong to terrain");
  if (terrain && options.plain) problems.emplace_back("--plain does not belong to terrain");
  if (terrain && !options.antenna_m.empty())
    problems.emplace_back("--antenna-m does not belong to terrain");
  if (!terrain && options.method != "auto" && !options.terrain_model.empty())
    problems.emplace_back("--dem belongs to auto, terrain");
  if (!terrain && !options.start.empty()) problems.emplace_back("--start belongs to terrain");
  if (!terrain && (options.terrain.place_sd_m > 0.0 || options.terrain.yaw_sd_deg > 0.0))
    problems.emplace_back("--place-sd-m and --yaw-sd-deg belong to terrain");
  if (!problems.empty()) throw ConfigError(problems);
}

int run_georeference(const GeoreferenceOptions& options, CommandContext& context) {
  check(options);
  refuse_unmapped(options.run);
  GeoreferenceRequest request;
  request.run = options.run;
  request.result = options.result;
  request.overwrite = options.overwrite;
  request.gnss = options.gnss;
  request.terrain_model = options.terrain_model;
  request.terrain = options.terrain;
  request.points = options.points;
  request.recording = options.recording;
  request.path.robust = !options.plain;
  request.time_offset_s = options.time_offset_s;
  request.time_offset_sd_s = options.time_offset_sd_s;
  if (options.tilt_sd_deg >= 0.0) request.tilt_sd_deg = options.tilt_sd_deg;
  request.tree_map = options.tree_map;
  request.tree_map_system = options.tree_map_system;
  request.near_radius_m = options.radius_m;
  if (!options.near.empty()) request.near = Eigen::Vector2d(options.near[0], options.near[1]);
  request.layers.coordinate_system = options.coordinate_system;
  if (options.geoid) request.layers.heights = HeightWish::kGeoid;
  for (const PlacementMethod& method : placement_methods())
    if (options.method == method.name) request.method = method.method;
  if (!options.antenna_m.empty())
    request.antenna_in_body = {options.antenna_m[0], options.antenna_m[1], options.antenna_m[2]};
  if (const auto& at = options.second_antenna_m; !at.empty())
    request.second_antenna_in_body = {at[0], at[1], at[2]};
  if (!options.start.empty())
    request.start = {options.start[0], options.start[1], options.start[2]};
  const GeoreferenceOutcome outcome =
      run_georeferencing(request, context.log, context.until_stopped());
  if (!options.json) return report_outcome(outcome);
  nlohmann::ordered_json json{{"status", to_string(outcome.status)},
                              {"reasons", outcome.reasons},
                              {"method", options.method}};
  for (const auto& [name, figure] : outcome.figures)
    std::visit([&, &key = name](const auto& value) { json[key] = value; }, figure);
  return report_outcome(json.dump(2), outcome.status, outcome.reasons);
}

// Of the fits to satellite positions and control points. `options` must outlive the command.
void add_satellite_options(CLI::App& command, GeoreferenceOptions& options) {
  command.add_option(
      "--gnss", options.gnss,
      "Fixes: a recording, an NMEA log, an RTKLIB .pos file or a CSV table (gnss.csv "
      "of the run if not given)");
  command
      .add_option(
          "--antenna-m", options.antenna_m,
          "Position of the GNSS antenna, or of what stood on the control points, in the body "
          "frame: x y z. If not given: that of run.json for the run's own fixes, else 0 0 0")
      ->expected(3);
  command
      .add_option("--second-antenna-m", options.second_antenna_m,
                  "Position of the antenna that the headings of the fixes lead to, in the body "
                  "frame: x y z. If not given: that of run.json for the run's own fixes")
      ->expected(3);
  command
      .add_option("--time-offset-s", options.time_offset_s,
                  "Added to the times of the fixes (negative where the receiver's are late)")
      ->check(CLI::Range(-1e6, 1e6))
      ->capture_default_str();
  command
      .add_option("--time-offset-sd-s", options.time_offset_sd_s,
                  "Standard deviation of that offset, which the fit then estimates (0: it is kept)")
      ->check(CLI::Range(0.0, 60.0))
      ->capture_default_str();
  command
      .add_option("--tilt-sd-deg", options.tilt_sd_deg,
                  "Standard deviation of the run's vertical about each axis (0.05 to 0.25 for a "
                  "run with an IMU, 1 for one by stems, else 5)")
      ->check(CLI::Range(0.0, 45.0));
  command.add_flag("--plain", options.plain,
                   "Least squares without robust weights: fixes that are far off count fully");
  command.add_option("--recording", options.recording,
                     "With fit6: the recording whose IMU smooths the fixes (the one that run.json "
                     "names if not given)");
  command.add_option("--points", options.points,
                     "Control points: CSV with name, east_m, north_m, height_m (in --crs), and x, "
                     "y, z of the run or timestamp_s");
}

// Of the fit to a terrain model; the same of `options`.
void add_terrain_options(CLI::App& command, GeoreferenceOptions& options) {
  command.add_option("--dem", options.terrain_model,
                     "Terrain model: GeoTIFF, ESRI ASCII grid, XYZ grid");
  command
      .add_option(
          "--start", options.start,
          "Position of the run's origin on the terrain model, and the angle from east to its "
          "x axis: x_m y_m yaw_deg")
      ->expected(3);
  command
      .add_option(
          "--place-sd-m", options.terrain.place_sd_m,
          "Standard deviation of the position, which the relief then corrects (0: it is kept)")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  command
      .add_option(
          "--yaw-sd-deg", options.terrain.yaw_sd_deg,
          "Standard deviation of the heading, which the relief then corrects (0: it is kept)")
      ->check(CLI::Range(0.0, 45.0))
      ->capture_default_str();
}

// Of the search in a map of trees; the same of `options`.
void add_tree_options(CLI::App& command, GeoreferenceOptions& options) {
  command.add_option("--tree-map", options.tree_map,
                     "Map of trees: CSV table, GeoPackage or other points; or a cloud from the air "
                     "(.las, .laz)");
  command.add_option("--tree-map-crs", options.tree_map_system,
                     "Coordinate system of a tree map that states none, for instance EPSG:3067");
  command
      .add_option("--near", options.near,
                  "Roughly where the middle of the run's trees lies on the tree map: x y (if not "
                  "given, by GNSS or anywhere in the map)")
      ->expected(2);
  command
      .add_option("--radius-m", options.radius_m,
                  "How far the rough position may be off; trees are searched within it")
      ->check(CLI::Range(1.0, 3000.0))
      ->capture_default_str();
}

}  // namespace

void add_georeference_command(CLI::App& app, Command& chosen) {
  CLI::App* command = app.add_subcommand(
      "georeference",
      "Move a finished run onto GNSS fixes, control points, a terrain model or a map of trees");
  const auto options = std::make_shared<GeoreferenceOptions>();
  command->add_option("RUN", options->run, "Run folder");
  command->add_option("-o,--output", options->result, "Folder for the moved run");
  std::vector<std::string> names;
  std::vector<std::string> meanings;
  for (const PlacementMethod& method : placement_methods()) {
    names.emplace_back(method.name);
    meanings.push_back(std::string(method.name) + ": " + method.meaning);
  }
  command->add_option("--method", options->method, fmt::format("{}", fmt::join(meanings, "\n")))
      ->required()
      ->check(CLI::IsMember(names));
  add_satellite_options(*command, *options);
  add_terrain_options(*command, *options);
  add_tree_options(*command, *options);
  command->add_option("--crs", options->coordinate_system,
                      "Coordinate system of map.laz, rasters and trees.gpkg, EPSG:3067 or WKT "
                      "(if not given that of the run, else ETRS-TM35FIN in Finland, else the UTM "
                      "zone)");
  command->add_flag("--geoid", options->geoid,
                    "Heights of these layers above the geoid, where PROJ has its grid (above the "
                    "ellipsoid if not given)");
  command->add_flag("--overwrite", options->overwrite, kOverwriteMeaning);
  command->add_flag("--json", options->json, "One JSON object on stdout");
  command->footer(
      "Examples:\n  understory georeference forest --method auto --gnss walk.pos -o placed\n"
      "  understory georeference forest --method gnss-path --gnss drive.nmea -o placed\n"
      "  understory georeference forest --method auto --dem terrain.tif --tree-map stand.gpkg -o "
      "placed\n"
      "  understory georeference placed --method terrain --dem terrain.tif -o levelled\n"
      "  understory georeference forest --method trees --tree-map stand.gpkg --near 563200 7024500 "
      "-o found");
  command->callback([&chosen, options] {
    chosen = [options](CommandContext& context) { return run_georeference(*options, context); };
  });
}

}  // namespace understory
