#include "understory/pipeline/georeferencing/movable_run.h"

#include <cmath>
#include <system_error>

#include "understory/evaluation/trees/tree_errors.h"
#include "understory/output/layers/layer_files.h"
#include "understory/output/layers/moved_vectors.h"
#include "understory/output/run_tables.h"
#include "understory/pipeline/correction/head_cut_log.h"
#include "understory/pipeline/georeferencing/moved_layers.h"
#include "understory/pipeline/georeferencing/moved_tables.h"
#include "understory/util/error.h"

namespace understory {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

void write_moved_path(const fs::path& from, const fs::path& to, const Pose& motion) {
  if (!fs::exists(from)) return;
  TumWriter writer(to);
  for (const StampedPose& pose : read_trajectory(from))
    writer.add({pose.stamp, motion * pose.world_from_body});
  writer.commit();
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
    throw InputError(folder.string(), "",
                     std::string("expected a run folder that holds trajectory.tum") +
                         (fs::exists(folder / "trees.csv")
                              ? ": this one has trees and no path. Move the run that it was made "
                                "of, then take its inventory"
                              : ""));
  MovableRun run;
  run.world_frame = world_frame_of_run(folder);
  run.trajectory = read_trajectory(folder / "trajectory.tum");
  run.has_trees = fs::exists(folder / "trees.csv");
  if (run.has_trees) run.trees = read_trees(folder / "trees.csv");
  run.has_falls = run.has_trees && fs::exists(folder / "felled.csv");
  if (run.has_falls) run.falls = read_tree_falls(folder / "felled.csv");
  if (const std::optional<RunPlace> place = read_run_place(folder)) {
    run.origin = place->origin;
    run.enu_from_world = place->enu_from_world;
    run.heights = place->heights;
    run.expected_error_m = place->expected_error_m;
    run.heading_sd_deg = place->heading_sd_deg;
  }
  run.antenna_in_body = read_antenna(folder);
  run.second_antenna_in_body = read_second_antenna(folder);
  run.layers = std::make_shared<LayerFrame>(read_layer_frame(folder));
  run.of_cloud = fs::exists(folder / "map.laz") || fs::exists(folder / "dtm.tif");
  run.stand = read_carried_stand(folder);
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

void write_moved_run(const MovingFolders& folders, const MovedRun& moved,
                     const ResultFrames& frames, MapPicture& picture, Log& log) {
  const auto& [from, to, progress] = folders;
  const MovableRun& run = moved.run;
  const Pose& motion = moved.placement.target_from_world;
  write_moved_layers({from, *run.layers, progress}, motion, {to, frames.layers}, frames.drawing(),
                     picture, log);
  for (const char* name : {"trajectory.tum", "odometry.tum", "keyframes.tum", "trajectory_imu.tum",
                           "trajectory_partial.tum"})
    write_moved_path(from / name, to / name, motion);
  write_moved_cuts(from / "cuts.csv", to / "cuts.csv", motion);
  write_moved_tables(from, to, run.trees, motion);
  copy_unmoved(from, to);
  if (run.has_trees) write_trees_csv(to / "trees.csv", moved.trees);
  if (run.has_falls) write_tree_falls(to / "felled.csv", placed(run.falls, moved.trees));
  write_tree_layers(to, moved.trees, moved.trajectory, frames.layers);
  add_moved_vectors(from / "trees.gpkg", to / "trees.gpkg", {*run.layers, motion, frames.layers});
  write_layer_project(to, from.filename().string(), moved.trajectory, frames.layers);
  if (moved.placement.gnss.empty()) return;
  GnssWriter writer(to / "gnss.csv");
  for (const GnssRow& row : moved.placement.gnss)
    writer.add(row);
  writer.commit();
}

}  // namespace understory
