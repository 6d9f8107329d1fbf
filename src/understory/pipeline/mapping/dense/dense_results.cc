#include "understory/pipeline/mapping/dense/dense_results.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <variant>

#include "understory/forest/inventory.h"
#include "understory/geometry/matrix_inverse.h"
#include "understory/output/plot_files.h"
#include "understory/output/report/map_picture.h"
#include "understory/output/run_tables.h"
#include "understory/pipeline/inventory/lidar_view.h"
#include "understory/pipeline/inventory/stand_documents.h"
#include "understory/pipeline/judgement/match_course.h"
#include "understory/pipeline/judgement/path_evidence.h"
#include "understory/pipeline/judgement/run_judgement.h"
#include "understory/pipeline/judgement/stand_notes.h"
#include "understory/pipeline/mapping/dense/dense_evidence.h"
#include "understory/pipeline/mapping/dense/map_files.h"
#include "understory/pipeline/mapping/dense/memory_plan.h"
#include "understory/pipeline/mapping/finished_trajectory.h"
#include "understory/pipeline/mapping/map_documents.h"
#include "understory/pipeline/run_folder/run_truth.h"
#include "understory/sensor/second_antenna_place.h"
#include "understory/util/error.h"
#include "understory/util/median.h"

namespace understory {
namespace {

constexpr std::size_t kScanBlocks = 200;  // of run.json: enough for a curve, little to read

void write_graph(const std::filesystem::path& folder, const KeyframeMap& map) {
  TumWriter poses(folder / "keyframes.tum");
  std::vector<GraphVertex> vertices;
  std::vector<GraphEdge> edges;
  for (const Keyframe& keyframe : map.keyframes()) {
    const int id = static_cast<int>(vertices.size());
    poses.add({keyframe.stamp, keyframe.world_from_body});
    vertices.push_back({id, keyframe.world_from_body, id == 0});
    if (id > 0) {
      edges.push_back(
          {id - 1, id, keyframe.previous_from_this, inverse_matrix(keyframe.covariance)});
    }
  }
  for (std::size_t i = 0; i < map.loops().size(); ++i) {
    if (!map.loops_used()[i]) continue;
    const PoseEdge& edge = map.loops()[i].edge;
    edges.push_back({edge.from, edge.to, edge.from_from_to, inverse_matrix(edge.covariance)});
  }
  poses.commit();
  write_g2o(folder / "graph.g2o", vertices, edges);
}

std::vector<ReportLoop> report_loops(const KeyframeMap& map) {
  std::vector<ReportLoop> rows;
  for (std::size_t i = 0; i < map.loops().size(); ++i) {
    const LoopAttempt& attempt = map.loops()[i];
    const Keyframe& from = map.keyframes()[static_cast<std::size_t>(attempt.from)];
    const Keyframe& to = map.keyframes()[static_cast<std::size_t>(attempt.to)];
    ReportLoop row;
    row.from = from.world_from_body.translation();
    row.to = to.world_from_body.translation();
    row.from_stamp = from.stamp;
    row.to_stamp = to.stamp;
    row.accepted = map.loops_used()[i] != 0;
    row.correction_m = attempt.correction_m;
    row.reason = row.accepted       ? ""
                 : attempt.verified ? "contradicts the odometry or the other loops"
                                    : attempt.reason;
    rows.push_back(std::move(row));
  }
  return rows;
}

void fill_streams(const EventOrderer::Report& time_repair, RunDocuments& documents) {
  static constexpr const char* kNames[] = {"lidar", "imu", "gnss", "mag"};
  for (std::size_t s = 0; s < EventOrderer::kStreams; ++s) {
    const EventOrderer::StreamReport& stream = time_repair.streams[s];
    const std::string name = kNames[s];
    documents.count(name + "_duplicates", stream.duplicates);
    documents.count(name + "_stamp_taken", stream.stamp_taken);
    documents.count(name + "_reordered", stream.reordered);
    documents.count(name + "_too_late", stream.late);
    documents.count(name + "_clock_jumps", stream.clock_jumps);
    documents.count(name + "_gaps", stream.gaps);
    if (stream.received == 0) continue;
    documents.count(name + "_received", stream.received);
    documents.count(name + "_released", stream.released);
    documents.summary().quality[name + "_unused_s"] = to_seconds(stream.unused);
    documents.summary().quality[name + "_clock_offset_s"] = to_seconds(stream.offset);
  }
  documents.count("scans_without_imu", time_repair.scans_without_imu);
}

// Pieces of the map that were found again in others.
std::uint64_t joined_segments(const DenseFrontEnd& front_end) {
  const MapPieces pieces = front_end.map().finished_pieces();
  return pieces.count() - pieces.groups();
}

void fill_counts(const DenseFrontEnd& front_end, RunDocuments& documents) {
  const DenseCounts& counts = front_end.counts();
  documents.summary().scans = counts.scans;
  documents.summary().poses = front_end.journal().size();
  documents.count("keyframes", front_end.map().keyframes().size());
  documents.count("scans_unmatched", counts.unmatched);
  documents.count("scans_velocity_gated", counts.gated);
  documents.count("scans_with_few_points", counts.empty_scans);
  if (counts.carried_points > 0) documents.count("carried_points", counts.carried_points);
  if (counts.weather_points > 0) documents.count("weather_points", counts.weather_points);
  const std::uint64_t apart = counts.segments - joined_segments(front_end);
  documents.count("segments", apart);
  documents.count("segments_joined", counts.segments - apart);
  const auto& used = front_end.map().loops_used();
  documents.count("loops_tried", used.size());
  documents.count("loops_closed",
                  static_cast<std::uint64_t>(std::count(used.begin(), used.end(), 1)));
  documents.count("imu_samples", counts.imu_samples);
  documents.count("gnss_fixes", front_end.fix_count());
  documents.count("lidar_points", counts.points);
  if (front_end.config().odometry.tops.points == ScanPoints::kTreeTops)
    documents.count("scans_by_tree_tops", counts.by_tree_tops);
  if (front_end.satellites() != nullptr)
    documents.count("scans_by_satellites", counts.by_satellites);
}

void tell_clock(const ReadRecording& recording, DenseFrontEnd& front_end, RunSummary& summary) {
  const ScopedTimer timer(front_end.times(), "finish_imu_clock");
  tell_imu_clock(front_end.clock_check(), recording.log, summary);
  if (const auto offset = front_end.odometry().lidar_offset())
    tell_lidar_offset(*offset, recording.log);
}

// Place and clock of the IMU as the recording itself tells them.
void tell_calibration(const ReadRecording& recording, DenseFrontEnd& front_end,
                      RunSummary& summary) {
  if (!front_end.config().refine_imu) return;
  const ScopedTimer timer(front_end.times(), "finish_imu_calibration");
  const std::optional<OnlineImuEstimate> found = front_end.imu_calibration();
  if (!found) {
    recording.log.warn("imu.not_refined",
                       "place and clock of the IMU were not refined: it needs an IMU that is "
                       "used, and 10 s of quick turns and tilting");
    return;
  }
  const Pose& pose = found->body_from_imu;
  const Eigen::Quaterniond& q = pose.rotation();
  ImuCalibrationFigures figures;
  figures.translation_m.assign(pose.translation().begin(), pose.translation().end());
  figures.rotation_xyzw = {q.x(), q.y(), q.z(), q.w()};
  figures.late_s = found->late_s;
  for (const auto& row : found->covariance.rowwise())
    figures.covariance.insert(figures.covariance.end(), row.begin(), row.end());
  figures.duration_s = found->duration_s;
  figures.windows = found->windows;
  figures.begun_anew = static_cast<std::uint64_t>(recording.request.conditions.imu_refinements);
  const std::optional<RefinedImu>& used = front_end.imu_used();
  if (used && recording.source.rig().body_from_imu) {
    const Pose change = recording.source.rig().body_from_imu->inverse() * used->body_from_imu;
    figures.moved_m = change.translation().norm();
    figures.turned_deg = so3_log(change.rotation()).norm() * 180.0 / M_PI;
    figures.used_late_s = used->late_s;
  }
  summary.imu_calibration = figures;
}

// trajectory_partial.tum. A pose is there when the last point of its part is, and the part is
// matched: latency counts from its first point.
void write_partial_path(const ReadRecording& recording, DenseFrontEnd& front_end,
                        const Trajectory& scans, RunDocuments& documents) {
  if (front_end.paths_between().parts() == nullptr) return;
  const DenseCounts& counts = front_end.counts();
  documents.count("scan_parts", write_relative_path(recording.results / "trajectory_partial.tum",
                                                    *front_end.paths_between().parts(), scans));
  documents.count("scan_parts_matched", counts.scan_parts_matched);
  if (counts.scan_parts == 0) return;
  const auto mean_ms = [&](const std::string& stage, TimeNs span, std::uint64_t number) {
    std::vector<double> wall;
    for (const StageTimes::Sample& sample : front_end.times().samples(stage))
      wall.push_back(static_cast<double>(sample.wall_ms));
    return 1e3 * to_seconds(span) / static_cast<double>(number) + distribution_of(wall).mean;
  };
  auto& quality = documents.summary().quality;
  quality["partial_latency_ms"] = mean_ms("scan_part", counts.parts_span, counts.scan_parts);
  quality["scan_latency_ms"] = mean_ms("scan", counts.cut_scans_span, counts.cut_scans);
}

// trajectory_imu.tum.
void write_imu_path(const ReadRecording& recording, DenseFrontEnd& front_end,
                    const Trajectory& scans, RunDocuments& documents) {
  if (front_end.paths_between().imu() == nullptr) return;
  const DenseCounts& counts = front_end.counts();
  documents.count("imu_predictions", write_relative_path(recording.results / "trajectory_imu.tum",
                                                         *front_end.paths_between().imu(), scans));
  documents.count("imu_predictions_coasted", counts.coasted);
  if (counts.coasted == 0) return;
  recording.log.warn("imu_rate.without_imu",
                     fmt::format("{} of {} poses in trajectory_imu.tum are by constant velocity, "
                                 "because the IMU was not used then",
                                 counts.coasted, counts.predictions));
}

// Whether the work on a scan grows with the length of the run.
void fill_constancy(RunSummary& summary, const TrajectoryFacts& trajectory) {
  const auto tenth = static_cast<std::ptrdiff_t>(trajectory.cpu_ms.size() / 10);
  if (tenth == 0) return;
  const auto fill = [&](const std::string& name, const std::vector<float>& ms) {
    const auto count = static_cast<double>(tenth);
    summary.quality[name + "_first_tenth"] =
        std::accumulate(ms.begin(), ms.begin() + tenth, 0.0) / count;
    summary.quality[name + "_last_tenth"] =
        std::accumulate(ms.end() - tenth, ms.end(), 0.0) / count;
  };
  fill("scan_cpu_ms", trajectory.cpu_ms);
  fill("scan_wall_ms", trajectory.wall_ms);
}

void fill_quality(const DenseFrontEnd& front_end, const TrajectoryFacts& trajectory,
                  RunSummary& summary) {
  fill_constancy(summary, trajectory);
  summary.scan_blocks = joined(trajectory.costs, kScanBlocks);
  summary.recording_s = trajectory.duration_s;
  summary.quality["length_m"] = trajectory.length_m;
  summary.quality["inlier_ratio_mean"] = trajectory.match.inliers_mean;
  summary.quality["match_distance_rms_m"] = trajectory.match.fitness_rms_m;
  summary.quality["weak_scans_percent"] =
      100.0 * static_cast<double>(trajectory.weak) / static_cast<double>(trajectory.scans.size());
  const SatelliteBelief* satellites = front_end.satellites();
  if (satellites != nullptr && satellites->aligned_at() != 0) {
    summary.quality["gnss_match_from_s"] =
        to_seconds(satellites->aligned_at() - front_end.first_scan());
    summary.quality["gnss_match_off_m"] = satellites->drift().farthest_m();
  }
  summary.quality["imu_without_place_s"] = to_seconds(front_end.imu_usage().without_place());
  summary.quality["loop_search_cpu_s"] = front_end.map().search_cpu_seconds();
}

void check_ranges(DenseFrontEnd& front_end, const ProgressSink& progress, MatchEvidence& evidence) {
  const ScopedTimer timer(front_end.times(), "finish_check_ranges");
  const RangeCheck check =
      front_end.map().check_ranges(front_end.rig().body_from_lidar.translation(), progress);
  evidence.range_offset_m = check.offset_m;
  evidence.range_offset_error_m = check.standard_error_m;
  evidence.range_pairs = check.pairs;
}

RunEvidence evidence_of(const ReadRecording& recording, DenseFrontEnd& front_end,
                        const TrajectoryFacts& trajectory, const DenseProducts& made) {
  RunEvidence evidence;
  evidence.stand = {made.inventory.trees.size(),
                    made.inventory.too_sparse && !made.inventory.open_land, made.not_upright,
                    made.inventory.two_images};
  evidence.motion = trajectory.motion;
  evidence.match = trajectory.match;
  check_ranges(front_end, recording.progress, evidence.match);
  gather_dense(front_end, recording.facts, recording.source, recording.log, evidence);
  return evidence;
}

// That points were taken for the carrier's own and left out; empty where none were.
std::string carrier_in_words(const RunSummary& summary) {
  const auto percent = summary.quality.find("carrier_points_percent");
  if (percent == summary.quality.end()) return {};
  return fmt::format(
      "what carries the lidar was found: {:.1f} % of the points, which are left out of the map\n",
      std::get<double>(percent->second));
}

std::string terminal_summary(const RunSummary& summary, const TrajectoryFacts& trajectory,
                             const InventoryResult& inventory,
                             const std::filesystem::path& folder) {
  std::string text = fmt::format("{} scans over {:.1f} m and {:.0f} s", summary.scans,
                                 trajectory.length_m, trajectory.duration_s);
  const auto scan = summary.stages.find("scan");
  if (scan != summary.stages.end()) {
    text += fmt::format(", {:.0f} ms a scan (99 %: {:.0f} ms)", scan->second.wall_ms.mean,
                        scan->second.wall_ms.p99);
  }
  text += "\n" + carrier_in_words(summary);
  text +=
      fmt::format("{} tree{}\n", inventory.trees.size(), inventory.trees.size() == 1 ? "" : "s") +
      terminal_notes(inventory);
  for (const std::string& reason : summary.reasons) {
    text += to_string(summary.status) + ": " + reason + "\n";
  }
  return text + "report: " + (folder / "report.html").string();
}

void fill_report(const ReadRecording& recording, const DenseFrontEnd& front_end,
                 const TrajectoryFacts& trajectory, std::uint64_t scans, ReportInput& report) {
  const std::string& model = recording.source.rig().lidar_model;
  report.made_from = fmt::format("{}, {}{} scans", recording.facts.format,
                                 model.empty() ? "" : model + ", ", scans);
  report.scans = trajectory.scans;
  report.sensor_period_ms = trajectory.period_ms;
  const auto matcher = make_matcher(front_end.config().keyframe_map.local_map.matcher);
  if (matcher->sums_up_points()) report.map_cell_m = matcher->reach_m();
  report.loops = report_loops(front_end.map());
  report.loop_closure_enabled = front_end.config().keyframe_map.loop_closure.enabled;
}

// Figures of the stand and of its plots. Hours of mapping are not thrown away because plots do not
// fit: then the run is partial and says why.
void take_figures(const StandTableConfig& config, const LayerFrame& layers, DenseProducts& made,
                  RunDocuments& documents) {
  std::vector<PlotOutline> plots;
  try {
    plots = plots_of(config, layers.wkt());
  } catch (const InputError& error) {
    documents.lower(RunStatus::kPartial, std::string("no figures by plots: ") + error.what());
  }
  made.figures = take_stand(made.inventory, config, plots, layers);
  describe_stand(made.figures, documents);
}

// The files of the map, if one was made.
void add_map(const ReadRecording& recording, const DenseMappingConfig& config, DenseProducts& made,
             MapPicture& picture, RunDocuments& documents) {
  const ResultFrames& frames = made.placed.frames;
  documents.count("trees", made.inventory.trees.size());
  documents.summary().lidar_view = made.lidar_view;
  documents.summary().lidar_model = single_lidar_model(recording.source.rig());
  if (!made.tiles) return;
  note_doubts(made.inventory, documents.summary());
  documents.summary().quality["area_m2"] = made.inventory.area_m2;
  take_figures(config.inventory.stand, frames.layers, made, documents);
  if (made.carrier.points > 0) {
    documents.count("carrier_points", made.carrier.points);
    documents.summary().quality["carrier_points_percent"] =
        100.0 * static_cast<double>(made.carrier.points) / static_cast<double>(made.carrier.of);
  }
  documents.count("map_points", write_map(recording, config, made, picture));
  if (!picture.empty()) documents.report().picture = &picture;
  documents.report().inventory = &made.inventory;
  for (const std::string& remark : made.inventory.remarks)
    documents.remark("inventory", remark);
}

// Where the run lies on the globe.
void tell_place(DenseProducts& made, RunDocuments& documents) {
  PlacedMap& placed = made.placed;
  documents.summary().quality.merge(placed.figures);
  documents.report().fixes = std::move(placed.fixes);
  documents.report().has_fixes = made.has_fixes;
  documents.place(placed.place, placed.frames);
}

}  // namespace

MappedPath mapped_path(const ReadRecording& recording, const DenseFrontEnd& front_end,
                       const Trajectory& trajectory, const std::vector<GnssFix>& fixes) {
  MappedPath path{recording.results, trajectory, fixes};
  if (front_end.counts().imu_samples > 0) path.levelled_by = LevelledBy::kGravity;
  if (const auto& antenna = front_end.rig().body_from_gnss)
    path.antenna_in_body = antenna->translation();
  path.second_antenna_in_body = second_antenna_of(front_end.rig());
  return path;
}

RunOutcome write_dense_results(const ReadRecording& recording, DenseFrontEnd& front_end,
                               DenseProducts& made) {
  const std::filesystem::path& folder = recording.results;
  const RunFacts& facts = recording.facts;
  const TrajectoryFacts& trajectory = made.trajectory;
  write_graph(folder, front_end.map());
  RunDocuments documents = map_documents(recording, front_end.times());
  documents.judge(evidence_of(recording, front_end, trajectory, made),
                  front_end.config().judgement);
  fill_streams(facts.time_repair, documents);
  fill_counts(front_end, documents);
  documents.judge_path();
  write_imu_path(recording, front_end, trajectory.trajectory, documents);
  write_partial_path(recording, front_end, trajectory.trajectory, documents);
  fill_quality(front_end, trajectory, documents.summary());
  tell_clock(recording, front_end, documents.summary());
  tell_calibration(recording, front_end, documents.summary());
  if (const auto truth = write_truth(recording.request.run_folder, recording.source))
    documents.compare_with_truth(compare_with_truth(trajectory.trajectory, *truth));
  tell_place(made, documents);
  MapPicture picture;
  {
    const ScopedTimer timer(front_end.times(), "finish_write_map");
    add_map(recording, front_end.config(), made, picture, documents);
  }
  tell_memory(front_end.config().max_memory_mb, recording.log);
  fill_report(recording, front_end, trajectory, documents.summary().scans, documents.report());
  documents.write(folder);
  return documents.outcome(terminal_summary(documents.summary(), trajectory, made.inventory,
                                            recording.request.run_folder));
}

}  // namespace understory
