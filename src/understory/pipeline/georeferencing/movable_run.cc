#include "understory/pipeline/georeferencing/movable_run.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <system_error>

#include "understory/evaluation/tree_errors.h"
#include "understory/georeference/coordinate_system.h"
#include "understory/output/geo_files.h"
#include "understory/output/run_tables.h"
#include "understory/pipeline/correction/head_cut_log.h"
#include "understory/pipeline/correction/moved_map.h"
#include "understory/util/error.h"
#include "understory/util/files/text_file.h"

namespace understory {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

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

void write_moved_path(const fs::path& from, const fs::path& to, const Pose& motion) {
  if (!fs::exists(from)) return;
  TumWriter writer(to);
  for (const StampedPose& pose : read_trajectory(from))
    writer.add({pose.stamp, motion * pose.world_from_body});
  writer.commit();
}

// The trees in a coordinate system that maps know; returns its name.
std::string write_trees_map(const fs::path& folder, const std::string& wish,
                            const std::vector<Tree>& trees, const GeodeticPlace& origin) {
  std::string name = wish.empty() ? utm_zone(origin) : wish;
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
  write_trees_gpkg(folder / "trees.gpkg", placed, name);
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

}  // namespace

MovableRun read_movable_run(const fs::path& folder) {
  if (!fs::is_directory(folder) || !fs::exists(folder / "trajectory.tum"))
    throw InputError(folder.string(), "", "expected a run folder that holds trajectory.tum");
  MovableRun run;
  run.trajectory = read_trajectory(folder / "trajectory.tum");
  run.has_trees = fs::exists(folder / "trees.csv");
  if (run.has_trees) run.trees = read_trees(folder / "trees.csv");
  run.has_falls = run.has_trees && fs::exists(folder / "felled.csv");
  if (run.has_falls) run.falls = read_tree_falls(folder / "felled.csv");
  run.origin = origin_of(folder);
  run.trust = trust_of_run(folder);
  return run;
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

std::string write_moved_run(const fs::path& from, const fs::path& to, const MovableRun& run,
                            const Placement& placement, const std::vector<Tree>& trees,
                            const std::string& crs, Log& log) {
  write_moved_map(from, to, placement.target_from_world, log);
  for (const char* name : {"trajectory.tum", "odometry.tum", "keyframes.tum"})
    write_moved_path(from / name, to / name, placement.target_from_world);
  write_moved_cuts(from / "cuts.csv", to / "cuts.csv", placement.target_from_world);
  copy_unmoved(from, to);
  std::string system;
  if (run.has_trees) {
    write_trees_csv(to / "trees.csv", trees);
    if (run.has_falls) write_tree_falls(to / "felled.csv", placed(run.falls, trees));
    if (placement.origin) system = write_trees_map(to, crs, trees, *placement.origin);
  }
  if (placement.gnss.empty()) return system;
  GnssWriter writer(to / "gnss.csv");
  for (const GnssRow& row : placement.gnss)
    writer.add(row);
  writer.commit();
  return system;
}

}  // namespace understory
