#include "understory/pipeline/run_folder/run_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "understory/forest/inventory.h"
#include "understory/output/geo_files.h"
#include "understory/output/las_writer.h"
#include "understory/output/map_picture.h"
#include "understory/output/report.h"
#include "understory/output/run_tables.h"
#include "understory/pipeline/judgement/evidence_gathering.h"
#include "understory/pipeline/judgement/match_course.h"
#include "understory/pipeline/judgement/path_evidence.h"
#include "understory/pipeline/judgement/run_judgement.h"
#include "understory/pipeline/mapping/dense_front_end.h"
#include "understory/pipeline/mapping/finished_trajectory.h"
#include "understory/pipeline/run_folder/run_truth.h"
#include "understory/pipeline/source.h"
#include "understory/util/median.h"
#include "understory/util/version.h"

namespace understory {
namespace {

// What walking through the finished trajectory yields for report and run.json.
struct TrajectoryFacts {
  Trajectory trajectory;  // as a reader of trajectory.tum gets it
  std::vector<ReportScan> scans;
  std::vector<float> cpu_ms;  // of each scan, see ScanRecord
  std::vector<float> wall_ms;
  double length_m = 0.0;
  double duration_s = 0.0;
  double period_ms = 0.0;  // median time between scans
  MotionEvidence motion;
  MatchEvidence match;  // what the path and the matches say of it
  std::uint64_t weak = 0;
};

ReportScan report_scan(const FinishedScan& scan) {
  const ScanRecord& record = *scan.record;
  ReportScan row;
  row.stamp = record.stamp;
  row.position = scan.world_from_body.translation().cast<float>();
  row.wall_ms = record.wall_ms;
  if (record.iterations > 0) {
    row.inlier_ratio = record.inlier_ratio;
    row.fitness_m2 = record.fitness_m2;
  }
  row.weak = record.outcome != ScanOutcome::kMatched || record.degenerate_directions > 0;
  return row;
}

double median_period_ms(const std::vector<ReportScan>& scans) {
  std::vector<TimeNs> steps;
  for (std::size_t i = 1; i < scans.size(); ++i) {
    steps.push_back(scans[i].stamp - scans[i - 1].stamp);
  }
  return 1e3 * to_seconds(upper_median(std::move(steps)));
}

// trajectory.tum and states.csv.gz.
TrajectoryFacts write_trajectory(const std::filesystem::path& folder, const DenseFrontEnd& session,
                                 const MappingConfig& config) {
  TumWriter trajectory(folder / "trajectory.tum");
  StatesWriter states(folder / "states.csv.gz");
  TrajectoryFacts facts;
  double inliers = 0.0;
  double squares = 0.0;
  std::vector<float> inlier_ratios;
  PathEvidence path(config.motion_limits);
  MatchCourse course(make_matcher(config.keyframe_map.local_map.matcher)->reach_m());
  Pose last;
  std::uint64_t empty_in_a_row = 0;
  for_each_finished_scan(
      session.journal(), session.map().keyframes(), [&](const FinishedScan& scan) {
        const ScanRecord& record = *scan.record;
        facts.trajectory.push_back(trajectory.add({record.stamp, scan.world_from_body}));
        states.add({record.stamp, scan.velocity_in_world,
                    Eigen::Vector3d::Map(record.gyro_bias.data()),
                    Eigen::Vector3d::Map(record.accel_bias.data()), record.pose_covariance()});
        facts.scans.push_back(report_scan(scan));
        path.add({record.stamp, scan.world_from_body});
        course.add(record.stamp, record.outcome == ScanOutcome::kMatched,
                   static_cast<double>(record.inlier_ratio),
                   static_cast<double>(record.fitness_m2));
        facts.cpu_ms.push_back(record.cpu_ms);
        facts.wall_ms.push_back(record.wall_ms);
        empty_in_a_row = record.matched_points < kFewPoints ? empty_in_a_row + 1 : 0;
        const Pose step = last.inverse() * scan.world_from_body;
        if (facts.scans.size() > 1) {
          facts.length_m += step.translation().norm();
          facts.match.smear_m += smear_of(step);
        }
        last = scan.world_from_body;
        if (record.iterations > 0) {
          inlier_ratios.push_back(record.inlier_ratio);
          inliers += static_cast<double>(record.inlier_ratio);
          squares += static_cast<double>(record.fitness_m2);
        }
        if (facts.scans.back().weak) ++facts.weak;
      });
  trajectory.commit();
  states.commit();
  if (!inlier_ratios.empty()) {
    const auto matched = static_cast<double>(inlier_ratios.size());
    facts.match.inliers_mean = inliers / matched;
    facts.match.fitness_rms_m = std::sqrt(squares / matched);
    const auto low = inlier_ratios.begin() + static_cast<std::ptrdiff_t>(inlier_ratios.size() / 10);
    std::nth_element(inlier_ratios.begin(), low, inlier_ratios.end());
    facts.match.inliers_low = static_cast<double>(*low);
  }
  facts.motion = path.evidence();
  course.put(facts.match);
  facts.match.cut = empty_in_a_row == 1 ? 1 : 0;
  if (facts.scans.size() > 1) facts.match.smear_m /= static_cast<double>(facts.scans.size() - 1);
  facts.period_ms = median_period_ms(facts.scans);
  facts.duration_s = to_seconds(facts.scans.back().stamp - facts.scans.front().stamp);
  return facts;
}

void write_graph(const std::filesystem::path& folder, const KeyframeMap& map) {
  TumWriter poses(folder / "keyframes.tum");
  std::vector<GraphVertex> vertices;
  std::vector<GraphEdge> edges;
  for (const Keyframe& keyframe : map.keyframes()) {
    const int id = static_cast<int>(vertices.size());
    poses.add({keyframe.stamp, keyframe.world_from_body});
    vertices.push_back({id, keyframe.world_from_body, id == 0});
    if (id > 0) {
      edges.push_back({id - 1, id, keyframe.previous_from_this, keyframe.covariance.inverse()});
    }
  }
  for (std::size_t i = 0; i < map.loops().size(); ++i) {
    if (!map.loops_used()[i]) continue;
    const PoseEdge& edge = map.loops()[i].edge;
    edges.push_back({edge.from, edge.to, edge.from_from_to, edge.covariance.inverse()});
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

void write_fixes(const std::filesystem::path& folder, const std::vector<GnssFix>& fixes) {
  if (fixes.empty()) return;
  GnssWriter writer(folder / "gnss.csv");
  for (const GnssFix& fix : fixes) {
    GnssRow row;
    row.fix = fix;
    row.reason =
        fix.quality == 0 ? "no fix" : "positions are not used: the map is in a local frame";
    writer.add(row);
  }
  writer.commit();
}

std::uint64_t write_cloud(const std::filesystem::path& file, MapTiles& tiles,
                          const GroundModel& ground, MapPicture& picture,
                          const ProgressSink& progress) {
  LasWriter writer(file, LasOptions{});
  double done = 0.0;
  tiles.for_each([&](MapTiles::TileIndex, const std::vector<MapPoint>& points) {
    for (const MapPoint& p : points) {
      const double height = ground.height_above({p.x, p.y, p.z});
      const std::uint8_t las_class = ground.las_class(height);
      writer.add({p.x, p.y, p.z, p.stamp, p.intensity, las_class});
      picture.add(p.x, p.y, p.z, height);
    }
    done += static_cast<double>(points.size());
    if (progress) progress({"writing map.laz", done / 1e3, 0.0, "thousand points", ""});
  });
  writer.commit();
  return writer.points();
}

// map.laz, trees.csv, dtm.tif and chm.tif. Returns the number of points.
std::uint64_t write_map(const std::filesystem::path& folder, DenseProducts& made,
                        MapPicture& picture, const ProgressSink& progress) {
  const InventoryResult& inventory = made.inventory;
  const std::uint64_t points =
      write_cloud(folder / "map.laz", *made.tiles, inventory.ground, picture, progress);
  write_trees_csv(folder / "trees.csv", inventory.trees);
  if (!inventory.ground.terrain.empty()) {
    write_geotiff(folder / "dtm.tif", inventory.ground.terrain, "");
    write_geotiff(folder / "chm.tif", inventory.canopy, "");
  }
  return points;
}

void fill_counts(RunSummary& summary, const DenseFrontEnd& session, const RunFacts& facts) {
  const MappingCounts& counts = session.counts();
  const auto count = [&](const char* name, std::uint64_t value) {
    summary.counts[name] = static_cast<std::int64_t>(value);
  };
  count("keyframes", session.map().keyframes().size());
  count("scans_unmatched", counts.unmatched);
  count("scans_velocity_gated", counts.gated);
  count("scans_with_few_points", counts.empty_scans);
  count("segments", counts.segments);
  const auto& used = session.map().loops_used();
  count("loops_tried", used.size());
  count("loops_closed", static_cast<std::uint64_t>(std::count(used.begin(), used.end(), 1)));
  count("imu_samples", counts.imu_samples);
  count("gnss_fixes", session.fixes().size());
  count("lidar_points", counts.points);
  static constexpr const char* kNames[] = {"lidar", "imu", "gnss", "mag"};
  for (std::size_t s = 0; s < EventOrderer::kStreams; ++s) {
    const EventOrderer::StreamReport& stream = facts.time_repair.streams[s];
    const std::string name = kNames[s];
    count((name + "_duplicates").c_str(), stream.duplicates);
    count((name + "_reordered").c_str(), stream.reordered);
    count((name + "_too_late").c_str(), stream.late);
    count((name + "_clock_jumps").c_str(), stream.clock_jumps);
    count((name + "_gaps").c_str(), stream.gaps);
    if (stream.received == 0) continue;
    count((name + "_received").c_str(), stream.received);
    count((name + "_released").c_str(), stream.released);
    summary.quality[name + "_unused_s"] = to_seconds(stream.unused);
    summary.quality[name + "_clock_offset_s"] = to_seconds(stream.offset);
  }
  summary.quality["imu_without_place_s"] = to_seconds(session.imu_hearing().without_place());
  count("scans_without_imu", facts.time_repair.scans_without_imu);
  if (facts.realtime) count("scans_dropped", facts.dropped_scans);
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

void fill_quality(RunSummary& summary, const TrajectoryFacts& trajectory, const RunFacts& facts) {
  fill_constancy(summary, trajectory);
  if (facts.memory_mb.size() > 1) {
    summary.quality["memory_mb_half"] = facts.memory_mb[facts.memory_mb.size() / 2];
    summary.quality["memory_mb_end"] = facts.memory_mb.back();
  }
  summary.quality["length_m"] = trajectory.length_m;
  summary.quality["inlier_ratio_mean"] = trajectory.match.inliers_mean;
  summary.quality["match_distance_rms_m"] = trajectory.match.fitness_rms_m;
  summary.quality["weak_scans_percent"] =
      100.0 * static_cast<double>(trajectory.weak) / static_cast<double>(trajectory.scans.size());
  if (!facts.realtime) return;
  add_latency(distribution_of(facts.latencies_ms), summary);
}

void check_ranges(DenseFrontEnd& session, MatchEvidence& evidence) {
  const ScopedTimer timer(session.times(), "finish_check_ranges");
  const RangeCheck check = session.map().check_ranges(session.rig().body_from_lidar.translation());
  evidence.range_offset_m = check.offset_m;
  evidence.range_offset_error_m = check.standard_error_m;
  evidence.range_pairs = check.pairs;
}

RunEvidence evidence_of(DenseFrontEnd& session, const RunFacts& facts, const Recording& source,
                        const TrajectoryFacts& trajectory, const Log& log) {
  RunEvidence evidence;
  evidence.motion = trajectory.motion;
  evidence.match = trajectory.match;
  check_ranges(session, evidence.match);
  gather_dense(session, facts, source, log, evidence);
  return evidence;
}

RunSummary summarise_run(const MappingRequest& request, DenseFrontEnd& session,
                         const RunFacts& facts, const TrajectoryFacts& trajectory,
                         const RunEvidence& evidence, Log& log) {
  RunSummary summary;
  summary.command = "map";
  summary.version = kVersion;
  summary.config_yaml = request.config_yaml;
  summary.config_origins = request.config_origins;
  summary.effective_yaml = request.effective_yaml;
  summary.adapted = request.adapted;
  summary.inputs = hash_inputs(request.recording, log);
  summary.scans = session.counts().scans;
  summary.poses = session.journal().size();
  summary.recording_s = trajectory.duration_s;
  const RunJudgement judgement = judge_run(evidence, session.config().judgement);
  summary.status = judgement.status;
  summary.reasons = judgement.reasons;
  summary.evidence = figures_of(evidence);
  fill_counts(summary, session, facts);
  fill_quality(summary, trajectory, facts);
  summary.quality["loop_search_cpu_s"] = session.map().search_cpu_seconds();
  return summary;
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
  text += fmt::format("\n{} trees\n", inventory.trees.size());
  for (const std::string& reason : summary.reasons) {
    text += to_string(summary.status) + ": " + reason + "\n";
  }
  return text + "report: " + (folder / "report.html").string();
}

ReportInput report_of(const ReadRecording& recording, const DenseFrontEnd& session,
                      const TrajectoryFacts& trajectory, const RunSummary& summary) {
  ReportInput report;
  report.title = std::filesystem::path(recording.request.recording).filename().string();
  const std::string& model = recording.source.rig().lidar_model;
  report.made_from = fmt::format("{}, {}{} scans", recording.facts.format,
                                 model.empty() ? "" : model + ", ", summary.scans);
  report.summary = summary;
  report.scans = trajectory.scans;
  report.sensor_period_ms = trajectory.period_ms;
  const auto matcher = make_matcher(session.config().keyframe_map.local_map.matcher);
  if (matcher->sums_up_points()) report.map_cell_m = matcher->reach_m();
  report.loops = report_loops(session.map());
  report.loop_closure_enabled = session.config().keyframe_map.loop_closure.enabled;
  return report;
}

}  // namespace

RunOutcome write_run(const ReadRecording& recording, DenseFrontEnd& session, DenseProducts& made) {
  const auto& [request, facts, source, work, folder, log, progress] = recording;
  StageTimes& times = session.times();
  const TrajectoryFacts trajectory = write_trajectory(folder, session, session.config());
  write_graph(folder, session.map());
  write_fixes(folder, session.fixes());
  MapPicture picture;
  RunSummary summary = summarise_run(request, session, facts, trajectory,
                                     evidence_of(session, facts, source, trajectory, log), log);
  std::optional<ReportTruth> truth;
  if (const auto known = write_truth(request.run_folder, source))
    truth = compare_with_truth(trajectory.trajectory, *known);
  if (truth) {
    summary.quality["ape_rmse_m"] = truth->ape_rmse_m;
    summary.quality["drift_percent"] = truth->drift_percent;
  }
  if (made.tiles) {
    const ScopedTimer timer(times, "finish_write_map");
    summary.counts["map_points"] =
        static_cast<std::int64_t>(write_map(folder, made, picture, progress));
  }
  summary.lidar_view = made.lidar_view;
  summary.counts["trees"] = static_cast<std::int64_t>(made.inventory.trees.size());
  summary.warnings = log.warnings();
  summary.stages = summarise(times);
  summary.wall_s = facts.elapsed_s();
  summary.cpu_s = process_cpu_seconds();
  summary.peak_memory_mb = peak_memory_mb();
  ReportInput report = report_of(recording, session, trajectory, summary);
  if (!picture.empty()) report.picture = &picture;
  if (made.tiles) report.inventory = &made.inventory;
  report.truth = truth;
  write_report(folder / "report.html", report);
  summary.wall_s = facts.elapsed_s();  // all of it, the report too
  write_run_json(folder / "run.json", summary);
  return {summary.status, summary.reasons,
          terminal_summary(summary, trajectory, made.inventory, request.run_folder)};
}

}  // namespace understory
