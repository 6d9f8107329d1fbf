#include "understory/pipeline/correction/correction_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <system_error>

#include "understory/map/stem_map.h"
#include "understory/output/report.h"
#include "understory/output/run_tables.h"
#include "understory/pipeline/correction/correction_evidence.h"
#include "understory/pipeline/correction/correction_report.h"
#include "understory/pipeline/correction/correction_tables.h"
#include "understory/pipeline/georeferencing/gnss_fit.h"
#include "understory/pipeline/judgement/run_judgement.h"
#include "understory/pipeline/run_folder/run_truth.h"
#include "understory/pipeline/source.h"
#include "understory/util/error.h"
#include "understory/util/version.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

// The views that make the map: those that hurt it may be left out, P0 (33).
struct MapViews {
  std::vector<StemView> views;
  std::vector<Pose> world_from_body;
};
MapViews map_views(const CorrectionRun& run) {
  const std::vector<char>& use = run.correction.self.use;
  MapViews kept;
  for (std::size_t i = 0; i < run.views.size(); ++i) {
    if (!use.empty() && use[i] == 0) continue;
    kept.views.push_back(run.views[i]);
    kept.world_from_body.push_back(run.correction.world_from_body[i]);
  }
  return kept;
}

std::vector<Tree> trees_of(const std::vector<MappedStem>& stems) {
  std::vector<Tree> trees;
  for (const MappedStem& stem : stems) {
    Tree tree;
    tree.id = static_cast<int>(trees.size()) + 1;
    tree.x = stem.point_in_world.x();
    tree.y = stem.point_in_world.y();
    tree.z = stem.point_in_world.z();
    tree.dbh_m = stem.dbh_m;
    tree.dbh_sd_m = stem.dbh_sd_m;
    tree.lean_deg = std::acos(std::clamp(stem.axis_in_world.z(), -1.0, 1.0)) * 180.0 / M_PI;
    tree.observations = stem.sights;
    tree.x_sd_m = std::sqrt(stem.variance_m2.x() / stem.sights);
    tree.y_sd_m = std::sqrt(stem.variance_m2.y() / stem.sights);
    trees.push_back(tree);
  }
  return trees;
}

std::size_t count_of(const std::vector<SparseStep>& steps, SparseStepStatus status) {
  return static_cast<std::size_t>(std::count_if(
      steps.begin(), steps.end(), [&](const SparseStep& step) { return step.status == status; }));
}

double path_length(const std::vector<Pose>& poses) {
  double length = 0.0;
  for (std::size_t i = 1; i < poses.size(); ++i)
    length += (poses[i].translation() - poses[i - 1].translation()).norm();
  return length;
}

// By a motion in the plane; a height that is not known stays so, and alone.
Eigen::Vector3d moved(const Pose& motion, const Eigen::Vector3d& point) {
  Eigen::Vector3d result = motion * Eigen::Vector3d(point.x(), point.y(), 0.0);
  result.z() += point.z();
  return result;
}

// The recording's own GNSS path beside the path: how well they lie on each other, P1 (6), and
// gnss.csv in the run's frame. The fixes have no say in the path.
std::vector<ReportFix> compare_with_gnss(const CorrectionRequest& request, RunSummary& summary) {
  std::vector<ReportFix> drawn;
  if (request.scans == nullptr || request.scans->fixes.empty()) return drawn;
  const auto antenna = request.scans->source->rig().body_from_gnss;
  const GnssFit fit =
      fit_to_gnss(read_trajectory(request.results / "trajectory.tum"),
                  antenna ? antenna->translation() : Eigen::Vector3d(Eigen::Vector3d::Zero()),
                  request.scans->fixes, {});
  summary.quality.merge(figures_of(fit));
  GnssWriter writer(request.results / "gnss.csv");
  const Pose world_from_enu = fit.enu_from_world.inverse();
  for (GnssRow row : fit.rows) {
    row.position_in_world = moved(world_from_enu, row.position_in_world);
    row.residual = moved(Pose(world_from_enu.rotation(), Eigen::Vector3d::Zero()), row.residual);
    drawn.push_back({row.position_in_world.cast<float>(), row.used});
    row.used = false;
    row.reason = "compared with, not used";
    writer.add(row);
  }
  for (std::size_t k = 0; fit.rows.empty() && k < request.scans->fixes.size(); ++k) {
    GnssRow row;
    row.fix = request.scans->fixes[k];
    row.reason = fit.path.reason;
    writer.add(row);
  }
  writer.commit();
  return drawn;
}

// Root mean square distance of a tree's sights from their mean: the noise of the map, without
// truth.
double sight_noise_m(const std::vector<MappedStem>& stems) {
  double sum = 0.0;
  double sights = 0.0;
  for (const MappedStem& stem : stems) {
    sum += stem.variance_m2.sum() * (stem.sights - 1);
    sights += stem.sights;
  }
  return sights > 0.0 ? std::sqrt(sum / sights) : std::nan("");
}

// Root mean square angle between the axis of a sight and that of its tree: the vertical angular
// noise of P1 table 1.
double axis_noise_deg(const std::vector<MappedStem>& stems) {
  double sum = 0.0;
  double sights = 0.0;
  for (const MappedStem& stem : stems) {
    if (!std::isfinite(stem.axis_noise_rad)) continue;
    sum += stem.axis_noise_rad * stem.axis_noise_rad * (stem.axis_sights - 1);
    sights += stem.axis_sights - 1;
  }
  return sights > 0.0 ? std::sqrt(sum / sights) * 180.0 / M_PI : std::nan("");
}

void add_sharpness(const std::string& when, const MapSharpness& map, RunSummary& summary) {
  summary.quality["beta_" + when] = map.beta;
  summary.quality["beta_3d_" + when] = map.beta_3d;
  summary.quality["box_dimension_" + when] = map.dimension;
  summary.quality["box_dimension_3d_" + when] = map.dimension_3d;
  summary.quality["registration_noise_" + when + "_m"] = map.noise_m;
  summary.quality["registration_noise_mean_" + when + "_m"] = map.noise_mean_m;
}

// beta, d and e_C of P0 before and after, and how many corrections it took.
void add_self_correction(const CorrectionRun& run, RunSummary& summary) {
  if (run.stopped) return;
  const SelfCorrectionResult& self = run.correction.self;
  add_sharpness("before", self.before, summary);
  add_sharpness("after", self.after, summary);
  summary.counts["corrections"] = self.kept;
  summary.counts["corrections_tried"] = static_cast<std::int64_t>(self.tried.size());
  summary.counts["corrections_by_go_icp"] = self.go_icp_calls;
  summary.counts["promising_pairs"] = static_cast<std::int64_t>(self.promising);
  summary.counts["views_eliminated"] =
      static_cast<std::int64_t>(std::count(self.use.begin(), self.use.end(), 0));
  summary.quality["corrections_share"] =
      static_cast<double>(self.kept) / static_cast<double>(run.views.size());
  summary.quality["correction_ended"] = self.stopped_because;
}

// Means over the steps that found a match, P1 table 1's way of telling how well views fit.
void add_matching(const CorrectionRun& run, RunSummary& summary) {
  double error = 0.0;
  double overlap = 0.0;
  double steps = 0.0;
  for (const SparseStep& step : run.steps) {
    if (step.status == SparseStepStatus::kFirst || step.status == SparseStepStatus::kUnmatched)
      continue;
    error += step.error_m;
    overlap += step.overlap;
    ++steps;
  }
  if (steps == 0.0) return;
  summary.quality["match_error_mean_m"] = error / steps;
  summary.quality["match_outlier_ratio_mean"] = 1.0 - overlap / steps;
}

RunSummary summary_of(const CorrectionRequest& request, const CorrectionRun& run,
                      const std::vector<MappedStem>& stems, Log& log) {
  RunSummary summary;
  summary.command = "correct";
  summary.version = kVersion;
  summary.config_yaml = request.config_yaml;
  summary.config_origins = request.config_origins;
  summary.effective_yaml = request.effective_yaml;
  summary.adapted = request.adapted;
  summary.inputs = run.inputs;
  summary.scans = run.path.empty() ? run.views.size() : run.path.size();
  summary.poses = run.path.empty() ? run.correction.world_from_body.size() : run.path.size();
  summary.counts["trees"] = static_cast<std::int64_t>(stems.size());
  summary.counts["steps_searched"] =
      static_cast<std::int64_t>(count_of(run.steps, SparseStepStatus::kSearched));
  summary.counts["steps_weak"] =
      static_cast<std::int64_t>(count_of(run.steps, SparseStepStatus::kWeak));
  summary.counts["loops_found"] = static_cast<std::int64_t>(run.correction.loops.size());
  summary.counts["loops_verified"] =
      std::count_if(run.correction.loops.begin(), run.correction.loops.end(),
                    [](const StemLoop& loop) { return loop.verified; });
  summary.counts["loops_accepted"] = static_cast<std::int64_t>(
      std::count(run.correction.accepted.begin(), run.correction.accepted.end(), 1));
  summary.quality["path_length_m"] = path_length(run.correction.world_from_body);
  add_matching(run, summary);
  summary.quality["sight_noise_m"] = sight_noise_m(stems);
  summary.quality["axis_noise_deg"] = axis_noise_deg(stems);
  add_self_correction(run, summary);
  if (request.scans != nullptr) {
    const SparseScans& scans = *request.scans;
    summary.command = "map";
    summary.inputs = hash_inputs(scans.recording, log);
    const std::string& head_log = request.config.harvester.head_log;
    if (!head_log.empty()) summary.inputs.push_back(hash_input(head_log));
    summary.counts["views"] = static_cast<std::int64_t>(run.views.size());
    summary.counts["scans_positioned"] = static_cast<std::int64_t>(scans.positioned);
    if (!scans.path.empty())
      summary.recording_s = to_seconds(scans.path.back().stamp - scans.path.front().stamp);
    if (scans.realtime) {
      summary.counts["scans_dropped"] = static_cast<std::int64_t>(scans.realtime->dropped_scans);
      add_latency(scans.realtime->latency_ms, summary);
    }
  }
  summary.warnings = log.warnings();
  const RunEvidence evidence = evidence_of(request, run, stems.size(), log);
  const RunJudgement judgement = judge_run(evidence, request.config.judgement);
  summary.status = judgement.status;
  summary.reasons = judgement.reasons;
  summary.evidence = figures_of(evidence);
  inherit(run.trust, summary.status, summary.reasons);
  return summary;
}

}  // namespace

RunOutcome write_correction(const CorrectionRequest& request, CorrectionRun& run, Log& log) {
  const fs::path& folder = request.results;
  const MapViews map = map_views(run);
  std::vector<MappedStem> stems;
  {
    const ScopedTimer timer(run.times, "tree_map");
    stems = build_stem_map(map.views, map.world_from_body, request.config.tree_list);
  }
  const std::vector<Tree> trees = trees_of(stems);
  std::vector<HeadCut> cuts;
  {
    const ScopedTimer timer(run.times, "writing");
    write_correction_tables(request, run);
    write_trees_csv(folder / "trees.csv", trees);
    cuts = place_cuts(run.head_cuts, read_trajectory(folder / "trajectory.tum"), log);
  }
  RunSummary summary = summary_of(request, run, stems, log);
  std::vector<TreeFall> falls =
      write_felled_trees(folder, {map.views, map.world_from_body, stems, trees}, cuts,
                         request.config.harvester.cuts, summary);
  std::vector<ReportFix> fixes;
  {
    const ScopedTimer timer(run.times, "gnss_fit");
    fixes = compare_with_gnss(request, summary);
  }
  summary.stages = summarise(run.times);
  if (request.scans != nullptr) summary.stages.merge(summarise(*request.scans->times));
  const auto elapsed_s = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - run.start).count() +
           (request.scans != nullptr ? request.scans->wall_s : 0.0);
  };
  summary.wall_s = elapsed_s();
  summary.cpu_s = process_cpu_seconds();
  summary.peak_memory_mb = peak_memory_mb();
  ReportInput report = correction_report(request, run, summary, trees);
  report.fixes = std::move(fixes);
  report.falls = std::move(falls);
  write_report(folder / "report.html", report);
  summary.wall_s = elapsed_s();  // all of it, the report too
  write_run_json(folder / "run.json", summary);
  RunOutcome outcome;
  outcome.status = summary.status;
  outcome.reasons = summary.reasons;
  outcome.summary =
      fmt::format("{} views over {:.0f} m, {} trees, in {:.1f} s; see {}", run.views.size(),
                  path_length(run.correction.world_from_body), stems.size(), summary.wall_s,
                  (request.run_folder / "report.html").string());
  return outcome;
}

}  // namespace understory
