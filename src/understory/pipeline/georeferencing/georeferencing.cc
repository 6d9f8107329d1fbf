#include "understory/pipeline/georeferencing/georeferencing.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "understory/evaluation/trees/tree_falls.h"
#include "understory/output/run_tables.h"
#include "understory/pipeline/georeferencing/methods/placement_figures.h"
#include "understory/pipeline/georeferencing/methods/placement_methods.h"
#include "understory/pipeline/georeferencing/movable_run.h"
#include "understory/pipeline/run_folder/run_documents.h"
#include "understory/pipeline/run_folder/run_folder.h"
#include "understory/pipeline/run_folder/run_json.h"
#include "understory/pipeline/run_folder/run_results.h"
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
  std::vector<double> antenna_m;
  if (const auto& at = request.antenna_in_body) antenna_m.assign(at->data(), at->data() + 3);
  std::vector<double> second_antenna_m;
  if (const auto& at = request.second_antenna_in_body)
    second_antenna_m.assign(at->data(), at->data() + 3);
  std::vector<double> start;
  if (request.start) start.assign(request.start->begin(), request.start->end());
  ConfigTable table;
  std::vector<std::pair<std::string, GeoreferenceMethod>> methods;
  for (const PlacementMethod& method : placement_methods())
    methods.emplace_back(method.name, method.method);
  table.add_enum("method", request.method, methods, "");
  table.add("gnss", request.gnss, "");
  table.add("antenna_m", antenna_m, "m", "");
  if (request.second_antenna_in_body) table.add("second_antenna_m", second_antenna_m, "m", "");
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
  table.add("crs", request.layers.coordinate_system, "");
  table.add_enum("heights", request.layers.heights,
                 {{"ellipsoid", HeightWish::kEllipsoid}, {"geoid", HeightWish::kGeoid}}, "");
  return table.to_yaml(false);
}

void describe(const GeoreferenceRequest& request, const MovedRun& moved, RunDocuments& documents) {
  const MovableRun& run = moved.run;
  const Placement& placement = moved.placement;
  RunSummary& summary = documents.summary();
  summary.scans = summary.poses = run.trajectory.size();
  summary.recording_s = to_seconds(run.trajectory.back().stamp - run.trajectory.front().stamp);
  summary.quality = placement.figures;
  for (const std::string& doubt : placement.doubts)
    documents.lower(RunStatus::kUntrusted, doubt);
  documents.inherit(run.trust);
  documents.tell_world_in(run.world_frame);
  ReportInput& report = documents.report();
  report.title = request.run.filename().string();
  report.made_from = fmt::format("a run of {} poses, moved by one motion", run.trajectory.size());
  report.moved = true;
  report.trees_of_cloud = run.of_cloud;
  report.has_fixes = !placement.gnss.empty();
  if (run.has_trees) {
    documents.count("trees", moved.trees.size());
    report.trees = &moved.trees;
  }
  report.falls = placed(run.falls, moved.trees);
  if (run.has_falls) documents.count("trees_felled", report.falls.size());
  for (const StampedPose& pose : moved.trajectory) {
    ReportScan scan;
    scan.stamp = pose.stamp;
    scan.position = pose.world_from_body.translation().cast<float>();
    report.scans.push_back(scan);
  }
  report.fixes = fixes_of(placement.gnss);
}

// What stays true of the stand wherever it lies. Results that cannot be moved are named.
void describe_carried(const GeoreferenceRequest& request, const CarriedStand& stand,
                      RunDocuments& documents) {
  RunSummary& summary = documents.summary();
  summary.counts.insert(stand.counts.begin(), stand.counts.end());
  summary.quality.insert(stand.quality.begin(), stand.quality.end());
  summary.notes = stand.notes;
  for (const Log::Warning& warning : stand.warnings)
    documents.remark(warning);
  ReportInput& report = documents.report();
  report.area_m2 = stand.area_m2;
  if (stand.table) report.stand = &*stand.table;
  for (const std::string& name : result_names())
    if (fs::exists(request.run / name) && !fs::exists(request.result / name) &&
        name != RunJson::kName && name != "report.html")
      report.not_moved.push_back(name);
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

// The place of the result: its world frame is east, north, up where the origin is known.
RunPlace place_of(const GeoreferenceRequest& request, const MovableRun& run,
                  const Placement& placement) {
  RunPlace place;
  if (request.gnss.empty()) {
    place.antenna_in_body = run.antenna_in_body;
    place.second_antenna_in_body = run.second_antenna_in_body;
  }
  place.method = placement.method;
  place.on_globe = placement.origin.has_value();
  if (place.on_globe) {
    place.origin = *placement.origin;
    place.heights = request.terrain_model.empty() ? other_heights(placement) : kHeightsOfModel;
  } else {
    place.reason =
        "the map that it was laid on has no coordinate system, or none that the run is known in";
  }
  place.heading_sd_deg = heading_sd_deg(placement);
  place.expected_error_m = placement.expected_error_m;
  return place;
}

MovedRun moved_run(const MovableRun& run, const Placement& placement) {
  MovedRun moved{run, placement, {}, moved_trees(run.trees, placement.target_from_world)};
  for (const StampedPose& pose : run.trajectory)
    moved.trajectory.push_back({pose.stamp, placement.target_from_world * pose.world_from_body});
  return moved;
}

}  // namespace

GeoreferenceOutcome run_georeferencing(const GeoreferenceRequest& given, Log& log,
                                       const ProgressSink& progress) {
  std::vector<fs::path> inputs = files_of(given.gnss, {});
  inputs.insert(inputs.end(), {given.run, given.terrain_model, given.tree_map, given.points});
  refuse_input_as_output(given.result, inputs);
  const RunFolder place = RunFolder::claim(given.result, given.overwrite);
  GeoreferenceRequest request = given;
  request.result = place.begin_results();
  request.progress = progress;
  check(request.layers);
  StageTimes times;
  RunDocuments documents("georeference", {yaml_of(given), {}, "", {}}, times, log);
  std::optional<ScopedTimer> timer(std::in_place, times, "reading");
  const MovableRun run = read_movable_run(request.run);
  // Layers that are in a system stay in it.
  if (request.layers.coordinate_system.empty() && run.layers->system() != nullptr)
    request.layers.coordinate_system = run.layers->wkt();
  timer.emplace(times, "fit");
  const Placement placement = find_placement(request, run, log);
  documents.add_input(request.run / "trajectory.tum", progress);
  if (run.has_trees) documents.add_input(request.run / "trees.csv");
  documents.add_inputs(placement.inputs);
  timer.emplace(times, "writing");
  const MovedRun moved = moved_run(run, placement);
  RunPlace on_globe = place_of(request, run, placement);
  ResultFrames frames;
  if (on_globe.on_globe) frames = frames_at(on_globe, request.layers, log);
  MapPicture picture;
  write_moved_run({request.run, request.result, progress}, moved, frames, picture, log);
  timer.reset();
  describe(request, moved, documents);
  describe_carried(request, run.stand, documents);
  documents.place(std::move(on_globe), frames);
  if (!picture.empty()) documents.report().picture = &picture;
  progress.poll();
  documents.write(request.result);
  place.commit(log);
  place.forget_state();
  return {documents.outcome(placement.summary), placement.figures};
}

}  // namespace understory
