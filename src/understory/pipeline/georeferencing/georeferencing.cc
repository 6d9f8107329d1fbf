#include "understory/pipeline/georeferencing/georeferencing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "understory/evaluation/tree_errors.h"
#include "understory/evaluation/tree_falls.h"
#include "understory/georeference/coordinate_system.h"
#include "understory/georeference/terrain_file.h"
#include "understory/output/geo_files.h"
#include "understory/output/run_tables.h"
#include "understory/pipeline/correction/head_cut_log.h"
#include "understory/pipeline/correction/moved_map.h"
#include "understory/pipeline/georeferencing/gnss_fixes.h"
#include "understory/pipeline/judgement/inherited_trust.h"
#include "understory/pipeline/pipeline_constants.h"
#include "understory/pipeline/run_folder/run_documents.h"
#include "understory/pipeline/run_folder/run_folder.h"
#include "understory/pipeline/source.h"
#include "understory/util/config/config.h"
#include "understory/util/error.h"
#include "understory/util/files/output_guard.h"
#include "understory/util/files/text_file.h"

namespace understory {
namespace {

using namespace pipeline_constants::georeferencing;

namespace fs = std::filesystem;
using Eigen::Vector3d;

// What a run folder holds that a motion can move.
struct Run {
  Trajectory trajectory;
  std::vector<Tree> trees;
  bool has_trees = false;
  std::vector<TreeFall> falls;
  bool has_falls = false;
  std::optional<GeodeticPlace> origin;  // of its frame east, north, up
  InheritedTrust trust;
};

// The place that an earlier fit to a GNSS path has left in run.json.
std::optional<GeodeticPlace> origin_of(const fs::path& run) {
  if (!fs::exists(run / "run.json")) return std::nullopt;
  const auto json = nlohmann::json::parse(read_text_file(run / "run.json"), nullptr, false);
  if (json.is_discarded() || !json.is_object()) return std::nullopt;
  const auto quality = json.find("quality");
  if (quality == json.end() || !quality->is_object()) return std::nullopt;
  const auto number = [&](const char* key) {
    const auto found = quality->find(key);
    return found != quality->end() && found->is_number() ? found->get<double>() : std::nan("");
  };
  const GeodeticPlace place{number("origin_latitude_deg"), number("origin_longitude_deg"),
                            number("origin_height_m")};
  if (!std::isfinite(place.latitude_deg + place.longitude_deg + place.height_m))
    return std::nullopt;
  return place;
}

Run read_run(const fs::path& folder) {
  if (!fs::is_directory(folder) || !fs::exists(folder / "trajectory.tum"))
    throw InputError(folder.string(), "", "expected a run folder that holds trajectory.tum");
  Run run;
  run.trajectory = read_trajectory(folder / "trajectory.tum");
  run.has_trees = fs::exists(folder / "trees.csv");
  if (run.has_trees) run.trees = read_trees(folder / "trees.csv");
  run.has_falls = run.has_trees && fs::exists(folder / "felled.csv");
  if (run.has_falls) run.falls = read_tree_falls(folder / "felled.csv");
  run.origin = origin_of(folder);
  run.trust = trust_of_run(folder);
  return run;
}

// How a run is to be moved, and what to say of it.
struct Motion {
  Pose target_from_world;
  std::optional<GeodeticPlace> origin;  // of the target frame
  std::vector<GnssRow> gnss;
  std::map<std::string, Figure> figures;
  std::string summary;              // a few lines for the terminal
  std::vector<std::string> doubts;  // why the result is untrusted

  void doubt(const std::string& reason) { doubts.push_back(reason); }
};

Motion by_gnss_path(const GeoreferenceRequest& request, const Run& run, Log& log) {
  const fs::path file = request.gnss.empty() ? request.run / "gnss.csv" : fs::path(request.gnss);
  if (request.gnss.empty() && !fs::exists(file))
    throw InputError(request.run.string(), "",
                     "expected gnss.csv in the run, or --gnss with a recording, an NMEA log or a "
                     "table of fixes");
  if (request.antenna_in_body.norm() > kLongestArmM)
    log.warn("recording.lever_arm",
             fmt::format("the antenna is said to be {:.1f} m from the body's origin (--antenna-m): "
                         "check that these are metres and not a place on the earth",
                         request.antenna_in_body.norm()));
  const GnssFit fit = fit_to_gnss(run.trajectory, request.antenna_in_body,
                                  read_fixes(file.string(), log), request.path);
  if (!fit.path.found) throw InputError(file.string(), "", fit.path.reason);
  Motion motion;
  motion.target_from_world = fit.enu_from_world;
  motion.origin = fit.origin;
  motion.figures = figures_of(fit);
  motion.summary = fmt::format(
      "{} fixes; fit {:.2f} m (symmetric, root mean square); fixes off the path by {:.2f} m in the "
      "median, {:.2f} m in the mean",
      fit.fixes.size(), fit.path.symmetric_rms_m, fit.path.fixes_median_m, fit.path.fixes_mean_m);
  if (fit.fixes_in_time > 0 && std::isfinite(fit.along_rms_m))
    motion.summary += fmt::format("; {:.2f} m along and {:.2f} m across the path by time",
                                  fit.along_rms_m, fit.across_rms_m);
  if (fit.ambiguous)
    motion.doubt(
        fmt::format("the path fits as well the other way round ({:.2f} m against {:.2f} m), and "
                    "the times do not show which is right",
                    fit.path.turned_rms_m, fit.path.symmetric_rms_m));
  if (fit.path.heading_sd_deg > kMostHeadingSdDeg)
    motion.doubt(fmt::format(
        "the heading is uncertain by {:.1f} degrees (one standard deviation; {:.0f} at most). The "
        "path is too short, too straight or too round for fixes that are {:.1f} m off it. Take a "
        "longer path with bends, or a better receiver",
        fit.path.heading_sd_deg, kMostHeadingSdDeg, fit.path.fixes_rms_m));
  motion.gnss = rows_of(fit);
  return motion;
}

// Points on the ground, before the fit: cells of the run's own terrain model where it has one, else
// the feet of its trees.
std::vector<GroundPoint> ground_of(const GeoreferenceRequest& request, const Run& run) {
  std::vector<GroundPoint> points;
  if (fs::exists(request.run / "dtm.tif")) {
    PlaneArea area{run.trajectory.front().world_from_body.translation().head<2>(),
                   run.trajectory.front().world_from_body.translation().head<2>()};
    for (const StampedPose& pose : run.trajectory) {
      area.low = area.low.cwiseMin(pose.world_from_body.translation().head<2>());
      area.high = area.high.cwiseMax(pose.world_from_body.translation().head<2>());
    }
    area.low.array() -= kReachM;
    area.high.array() += kReachM;
    const Raster own = read_terrain(request.run / "dtm.tif", area, std::nullopt);
    const int step = std::max(1, static_cast<int>(std::lround(1.0 / own.cell_m)));
    for (int row = 0; row < own.rows; row += step) {
      for (int column = 0; column < own.columns; column += step) {
        const double x = own.x0 + (column + 0.5) * own.cell_m;
        const double y = own.y0 + (row + 0.5) * own.cell_m;
        const double z = own.cell_value(x, y);
        if (std::isfinite(z)) points.push_back({{x, y, z}, 0.1});
      }
    }
    return points;
  }
  if (!run.has_trees)
    throw InputError(request.run.string(), "",
                     "expected dtm.tif or trees.csv: points on the ground");
  for (const Tree& tree : run.trees)
    points.push_back({{tree.x, tree.y, tree.z}, 0.1});
  return points;
}

PlaneArea area_of(const std::vector<GroundPoint>& points, double margin_m) {
  PlaneArea area;
  if (points.empty()) return area;
  area.low = area.high = points.front().point_in_world.head<2>();
  for (const GroundPoint& point : points) {
    area.low = area.low.cwiseMin(point.point_in_world.head<2>());
    area.high = area.high.cwiseMax(point.point_in_world.head<2>());
  }
  area.low.array() -= margin_m;
  area.high.array() += margin_m;
  return area;
}

Motion by_terrain(const GeoreferenceRequest& request, const Run& run) {
  if (!request.start && !run.origin)
    throw InputError(request.run.string(), "",
                     "expected a run that was laid on a GNSS path, or --start: where it lies on "
                     "the terrain model is not known (0 0 0 if its frame is that of the model)");
  Pose placed;
  if (request.start) {
    placed = Pose(Eigen::Quaterniond(
                      Eigen::AngleAxisd((*request.start)[2] * M_PI / 180.0, Vector3d::UnitZ())),
                  Vector3d((*request.start)[0], (*request.start)[1], 0.0));
  }
  std::vector<GroundPoint> points = ground_of(request, run);
  for (GroundPoint& point : points)
    point.point_in_world = placed * point.point_in_world;
  Motion motion;
  if (!request.start) motion.origin = run.origin;
  const Raster terrain =
      read_terrain(request.terrain_model, area_of(points, 10.0 + 3.0 * request.terrain.place_sd_m),
                   motion.origin);
  const TerrainFit fit = fit_to_terrain(points, terrain, request.terrain);
  if (!fit.found) throw InputError(request.terrain_model.string(), "", fit.reason);
  motion.target_from_world = fit.terrain_from_world * placed;
  const Vector3d shift = fit.terrain_from_world * area_of(points, 0.0).low.homogeneous() -
                         area_of(points, 0.0).low.homogeneous();
  motion.figures = {{"terrain_points", static_cast<std::int64_t>(fit.points)},
                    {"terrain_points_used", static_cast<std::int64_t>(fit.used)},
                    {"terrain_mean_before_m", fit.mean_before_m},
                    {"terrain_rms_before_m", fit.rms_before_m},
                    {"terrain_rms_m", fit.rms_m},
                    {"terrain_median_m", fit.median_m},
                    {"terrain_tilt_deg", fit.tilt_deg},
                    {"terrain_moved_plane_m", shift.head<2>().norm()},
                    {"terrain_place_sd_m", fit.place_sd_m},
                    {"terrain_yaw_sd_deg", fit.yaw_sd_deg}};
  motion.summary = fmt::format(
      "{} of {} points on the ground used; heights above the terrain {:.2f} m before (mean off), "
      "{:.2f} m after, {:.2f} m in the median; up turned by {:.2f} degrees",
      fit.used, points.size(), fit.rms_before_m, fit.rms_m, fit.median_m, fit.tilt_deg);
  if (2 * fit.used < points.size())
    motion.doubt(fmt::format("only {} of {} points on the ground agree with the terrain model",
                             fit.used, points.size()));
  return motion;
}

void write_moved_path(const fs::path& from, const fs::path& to, const Pose& motion) {
  if (!fs::exists(from)) return;
  TumWriter writer(to);
  for (const StampedPose& pose : read_trajectory(from))
    writer.add({pose.stamp, motion * pose.world_from_body});
  writer.commit();
}

std::vector<Tree> moved_trees(const std::vector<Tree>& trees, const Pose& motion) {
  std::vector<Tree> result = moved(trees, motion);
  const Vector3d east = motion.rotation() * Vector3d::UnitX();
  const double c = std::abs(east.x()) / east.head<2>().norm();
  const double s = std::abs(east.y()) / east.head<2>().norm();
  for (Tree& tree : result) {
    const double x = tree.x_sd_m;
    const double y = tree.y_sd_m;
    tree.x_sd_m = std::hypot(c * x, s * y);
    tree.y_sd_m = std::hypot(s * x, c * y);
  }
  return result;
}

// The trees in a coordinate system that maps know; returns its name.
std::string write_trees_map(const GeoreferenceRequest& request, const std::vector<Tree>& trees,
                            const GeodeticPlace& origin) {
  std::string name =
      request.coordinate_system.empty() ? utm_zone(origin) : request.coordinate_system;
  const CoordinateSystem system(name);
  const EastNorthUp frame(origin);
  std::vector<Tree> placed;
  for (Tree tree : trees) {
    const auto at = system.from_place(frame.to_place({tree.x, tree.y, tree.z}));
    if (!at)
      throw ConfigError({"coordinate system " + name + " does not reach the place of the run"});
    tree.x = at->x();
    tree.y = at->y();
    tree.z = at->z();
    placed.push_back(tree);
  }
  write_trees_gpkg(request.result / "trees.gpkg", placed, name);
  return name;
}

void copy_unmoved(const fs::path& from, const fs::path& to) {
  for (const char* name : {"stems.csv.gz", "steps.csv", "loops.csv", "corrections.csv"}) {
    if (!fs::exists(from / name)) continue;
    std::error_code error;
    fs::copy_file(from / name, to / name, fs::copy_options::overwrite_existing, error);
    if (error) throw OutputError((to / name).string(), "cannot be written: " + error.message());
  }
}

std::vector<ReportFix> fixes_of(const std::vector<GnssRow>& rows) {
  std::vector<ReportFix> fixes;
  for (const GnssRow& row : rows)
    fixes.push_back({row.position_in_world.cast<float>(), row.used});
  return fixes;
}

// The options of the command, by their names.
std::string yaml_of(GeoreferenceRequest request) {
  bool plain = !request.path.robust;
  std::string dem = request.terrain_model.string();
  std::vector<double> antenna_m(request.antenna_in_body.data(), request.antenna_in_body.data() + 3);
  std::vector<double> start;
  if (request.start) start.assign(request.start->begin(), request.start->end());
  ConfigTable table;
  table.add_enum(
      "method", request.method,
      {{"gnss-path", GeoreferenceMethod::kGnssPath}, {"terrain", GeoreferenceMethod::kTerrain}},
      "");
  table.add("gnss", request.gnss, "");
  table.add("antenna_m", antenna_m, "m", "");
  table.add("plain", plain, "");
  table.add("dem", dem, "");
  table.add("start", start, "", "");
  table.add("place_sd_m", request.terrain.place_sd_m, {}, "m", "");
  table.add("yaw_sd_deg", request.terrain.yaw_sd_deg, {}, "deg", "");
  table.add("crs", request.coordinate_system, "");
  return table.to_yaml(false);
}

// The files that the motion was computed from, and the trees.
void add_inputs(const GeoreferenceRequest& request, const Run& run, Log& log,
                RunDocuments& documents) {
  documents.add_input(request.run / "trajectory.tum");
  if (run.has_trees) documents.add_input(request.run / "trees.csv");
  if (request.method == GeoreferenceMethod::kTerrain) {
    documents.add_input(request.terrain_model);
    if (fs::exists(request.run / "dtm.tif")) documents.add_input(request.run / "dtm.tif");
  } else if (request.gnss.empty()) {
    documents.add_input(request.run / "gnss.csv");
  } else {
    documents.add_inputs(hash_inputs(request.gnss, log));
  }
}

void describe(const GeoreferenceRequest& request, const Run& run, const Motion& motion,
              const std::vector<Tree>& trees, RunDocuments& documents) {
  RunSummary& summary = documents.summary();
  summary.scans = summary.poses = run.trajectory.size();
  summary.recording_s = to_seconds(run.trajectory.back().stamp - run.trajectory.front().stamp);
  summary.quality = motion.figures;
  for (const std::string& doubt : motion.doubts)
    documents.lower(RunStatus::kUntrusted, doubt);
  documents.inherit(run.trust);
  ReportInput& report = documents.report();
  report.title = request.run.filename().string();
  report.made_from = fmt::format("a run of {} poses, moved by one motion", run.trajectory.size());
  report.north_is_up = motion.origin.has_value();
  if (run.has_trees) {
    documents.count("trees", trees.size());
    report.trees = &trees;
  }
  report.falls = placed(run.falls, trees);
  if (run.has_falls) documents.count("trees_felled", report.falls.size());
  for (const StampedPose& pose : run.trajectory) {
    ReportScan scan;
    scan.stamp = pose.stamp;
    scan.position = (motion.target_from_world * pose.world_from_body).translation().cast<float>();
    report.scans.push_back(scan);
  }
  report.fixes = fixes_of(motion.gnss);
}

// The motion that the fixes or the terrain model ask for.
Motion find_motion(const GeoreferenceRequest& request, const Run& run, Log& log) {
  Motion motion = request.method == GeoreferenceMethod::kTerrain ? by_terrain(request, run)
                                                                 : by_gnss_path(request, run, log);
  if (motion.origin) {
    motion.figures["origin_latitude_deg"] = motion.origin->latitude_deg;
    motion.figures["origin_longitude_deg"] = motion.origin->longitude_deg;
    motion.figures["origin_height_m"] = motion.origin->height_m;
  }
  return motion;
}

// All files of the run, moved. Returns the coordinate system of the trees, empty where unknown.
std::string write_moved(const GeoreferenceRequest& request, const Run& run, const Motion& motion,
                        const std::vector<Tree>& trees, Log& log) {
  write_moved_map(request.run, request.result, motion.target_from_world, log);
  for (const char* name : {"trajectory.tum", "odometry.tum", "keyframes.tum"})
    write_moved_path(request.run / name, request.result / name, motion.target_from_world);
  write_moved_cuts(request.run / "cuts.csv", request.result / "cuts.csv", motion.target_from_world);
  copy_unmoved(request.run, request.result);
  std::string system;
  if (run.has_trees) {
    write_trees_csv(request.result / "trees.csv", trees);
    if (run.has_falls) write_tree_falls(request.result / "felled.csv", placed(run.falls, trees));
    if (motion.origin) system = write_trees_map(request, trees, *motion.origin);
  }
  if (motion.gnss.empty()) return system;
  GnssWriter writer(request.result / "gnss.csv");
  for (const GnssRow& row : motion.gnss)
    writer.add(row);
  writer.commit();
  return system;
}

}  // namespace

GeoreferenceOutcome run_georeferencing(const GeoreferenceRequest& given, Log& log) {
  std::vector<fs::path> inputs = files_of(given.gnss, {});
  inputs.insert(inputs.end(), {given.run, given.terrain_model});
  refuse_input_as_output(given.result, inputs);
  const RunFolder place = RunFolder::claim(given.result, given.overwrite);
  GeoreferenceRequest request = given;
  request.result = place.begin_results();
  if (!request.coordinate_system.empty()) (void)CoordinateSystem(request.coordinate_system);
  StageTimes times;
  RunDocuments documents("georeference", {yaml_of(given), {}, "", {}}, times, log);
  std::optional<ScopedTimer> timer(std::in_place, times, "reading");
  const Run run = read_run(request.run);
  timer.emplace(times, "fit");
  const Motion motion = find_motion(request, run, log);
  add_inputs(request, run, log, documents);
  timer.emplace(times, "writing");
  const std::vector<Tree> trees = moved_trees(run.trees, motion.target_from_world);
  documents.summary().crs_wkt = write_moved(request, run, motion, trees, log);
  timer.reset();
  describe(request, run, motion, trees, documents);
  documents.write(request.result);
  place.commit(log);
  place.forget_state();
  return {documents.outcome(motion.summary), motion.figures};
}

}  // namespace understory
