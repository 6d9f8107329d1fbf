#include "understory/pipeline/georeferencing/georeferencing.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "understory/evaluation/tree_falls.h"
#include "understory/georeference/coordinate_system.h"
#include "understory/output/run_tables.h"
#include "understory/pipeline/georeferencing/movable_run.h"
#include "understory/pipeline/georeferencing/placement_figures.h"
#include "understory/pipeline/georeferencing/placement_methods.h"
#include "understory/pipeline/run_folder/run_documents.h"
#include "understory/pipeline/run_folder/run_folder.h"
#include "understory/pipeline/source.h"
#include "understory/util/config/config.h"
#include "understory/util/error.h"
#include "understory/util/files/output_guard.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

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
  std::vector<std::pair<std::string, GeoreferenceMethod>> methods;
  for (const PlacementMethod& method : placement_methods())
    methods.emplace_back(method.name, method.method);
  table.add_enum("method", request.method, methods, "");
  table.add("gnss", request.gnss, "");
  table.add("antenna_m", antenna_m, "m", "");
  std::string points = request.points.string();
  table.add("points", points, "");
  table.add("recording", request.recording, "");
  table.add("time_offset_s", request.time_offset_s, {}, "s", "");
  table.add("time_offset_sd_s", request.time_offset_sd_s, {}, "s", "");
  double tilt_sd_deg = request.tilt_sd_deg.value_or(-1.0);
  if (request.tilt_sd_deg) table.add("tilt_sd_deg", tilt_sd_deg, {}, "deg", "");
  table.add("plain", plain, "");
  table.add("dem", dem, "");
  table.add("start", start, "", "");
  table.add("place_sd_m", request.terrain.place_sd_m, {}, "m", "");
  table.add("yaw_sd_deg", request.terrain.yaw_sd_deg, {}, "deg", "");
  std::string tree_map = request.tree_map.string();
  std::vector<double> near;
  if (request.near) near = {request.near->x(), request.near->y()};
  table.add("tree_map", tree_map, "");
  table.add("tree_map_crs", request.tree_map_system, "");
  table.add("near", near, "", "");
  table.add("radius_m", request.near_radius_m, {}, "m", "");
  table.add("crs", request.coordinate_system, "");
  return table.to_yaml(false);
}

void describe(const GeoreferenceRequest& request, const MovableRun& run, const Placement& placement,
              const std::vector<Tree>& trees, RunDocuments& documents) {
  RunSummary& summary = documents.summary();
  summary.scans = summary.poses = run.trajectory.size();
  summary.recording_s = to_seconds(run.trajectory.back().stamp - run.trajectory.front().stamp);
  summary.quality = placement.figures;
  for (const std::string& doubt : placement.doubts)
    documents.lower(RunStatus::kUntrusted, doubt);
  documents.inherit(run.trust);
  ReportInput& report = documents.report();
  report.title = request.run.filename().string();
  report.made_from = fmt::format("a run of {} poses, moved by one motion", run.trajectory.size());
  report.north_is_up = placement.origin.has_value();
  if (run.has_trees) {
    documents.count("trees", trees.size());
    report.trees = &trees;
  }
  report.falls = placed(run.falls, trees);
  if (run.has_falls) documents.count("trees_felled", report.falls.size());
  for (const StampedPose& pose : run.trajectory) {
    ReportScan scan;
    scan.stamp = pose.stamp;
    scan.position =
        (placement.target_from_world * pose.world_from_body).translation().cast<float>();
    report.scans.push_back(scan);
  }
  report.fixes = fixes_of(placement.gnss);
}

Placement find_placement(const GeoreferenceRequest& request, const MovableRun& run, Log& log) {
  const std::vector<PlacementMethod>& methods = placement_methods();
  const auto method = std::find_if(
      methods.begin(), methods.end(),
      [&](const PlacementMethod& candidate) { return candidate.method == request.method; });
  Placement placement = method->place(request, run, log);
  if (placement.method.empty()) placement.method = method->name;
  tell_placement(run.trajectory, placement);
  if (placement.origin) {
    placement.figures["origin_latitude_deg"] = placement.origin->latitude_deg;
    placement.figures["origin_longitude_deg"] = placement.origin->longitude_deg;
    placement.figures["origin_height_m"] = placement.origin->height_m;
  }
  return placement;
}

}  // namespace

GeoreferenceOutcome run_georeferencing(const GeoreferenceRequest& given, Log& log) {
  std::vector<fs::path> inputs = files_of(given.gnss, {});
  inputs.insert(inputs.end(), {given.run, given.terrain_model, given.tree_map, given.points});
  refuse_input_as_output(given.result, inputs);
  const RunFolder place = RunFolder::claim(given.result, given.overwrite);
  GeoreferenceRequest request = given;
  request.result = place.begin_results();
  if (!request.coordinate_system.empty()) (void)CoordinateSystem(request.coordinate_system);
  StageTimes times;
  RunDocuments documents("georeference", {yaml_of(given), {}, "", {}}, times, log);
  std::optional<ScopedTimer> timer(std::in_place, times, "reading");
  const MovableRun run = read_movable_run(request.run);
  timer.emplace(times, "fit");
  const Placement placement = find_placement(request, run, log);
  documents.add_input(request.run / "trajectory.tum");
  if (run.has_trees) documents.add_input(request.run / "trees.csv");
  documents.add_inputs(placement.inputs);
  timer.emplace(times, "writing");
  const std::vector<Tree> trees = moved_trees(run.trees, placement.target_from_world);
  documents.summary().crs_wkt = write_moved_run(request.run, request.result, run, placement, trees,
                                                request.coordinate_system, log);
  timer.reset();
  describe(request, run, placement, trees, documents);
  documents.write(request.result);
  place.commit(log);
  place.forget_state();
  return {documents.outcome(placement.summary), placement.figures};
}

}  // namespace understory
