#include "understory/pipeline/correction/correction_report.h"

#include <vector>

#include "understory/pipeline/correction/correction_figures.h"
#include "understory/pipeline/run_folder/run_truth.h"

namespace understory {
namespace {

ReportCorrection correction_of(const SelfCorrectionResult& self) {
  ReportCorrection report;
  report.ended = self.stopped_because;
  const MapSharpness& a = self.before;
  const MapSharpness& b = self.after;
  report.figures = {
      {"distance of the sights of a cluster from their mean, cm (e_C; small is sharp)",
       100.0 * a.cluster_noise_m, 100.0 * b.cluster_noise_m, 1},
      {"the same of single trees, cm (without clusters of several trees)", 100.0 * a.noise_m,
       100.0 * b.noise_m, 1},
      {"blurred area of the map, per mille (beta; small is sharp)", 1e3 * a.beta, 1e3 * b.beta, 2},
      {"dimension of the map, 0 points to 2 areas (d; small is sharp)", a.dimension, b.dimension,
       2}};
  for (const TriedCorrection& tried : self.tried)
    (tried.kept ? report.kept : report.tried).emplace_back(tried.pair.i, tried.pair.j);
  return report;
}

std::vector<ReportScan> scans_of(const CorrectionRun& run) {
  std::vector<ReportScan> scans;
  for (std::size_t i = 0; i < run.views.size(); ++i) {
    ReportScan scan;
    scan.stamp = run.views[i].stamp;
    scan.position = run.correction.world_from_body[i].translation().cast<float>();
    scan.wall_ms = run.scan_ms[i];
    scan.inlier_ratio = static_cast<float>(i == 0 ? 1.0 : run.steps[i].overlap);
    scan.weak = run.steps[i].status == SparseStepStatus::kWeak ||
                run.steps[i].status == SparseStepStatus::kUnmatched;
    scans.push_back(scan);
  }
  return scans;
}

void add_loops(const CorrectionRun& run, ReportInput& report) {
  for (std::size_t k = 0; k < run.correction.loops.size(); ++k) {
    const StemLoop& found = run.correction.loops[k];
    if (!found.verified) {
      ++report.loops_not_listed;
      continue;
    }
    const auto query = static_cast<std::size_t>(found.query);
    const auto match = static_cast<std::size_t>(found.match);
    ReportLoop loop;
    loop.from = run.correction.world_from_body[match].translation();
    loop.to = run.correction.world_from_body[query].translation();
    loop.from_stamp = run.views[match].stamp;
    loop.to_stamp = run.views[query].stamp;
    loop.accepted = run.correction.accepted[k] != 0;
    loop.correction_m = run.correction.loop_shift_m[k];
    if (!loop.accepted) loop.reason = "contradicts the other loops";
    report.loops.push_back(loop);
  }
}

}  // namespace

void report_correction(const StemCorrectionConfig& config, const CorrectionRun& run,
                       const Trajectory& trajectory, RunDocuments& documents) {
  ReportInput& report = documents.report();
  report.trees = &run.trees;
  if (!run.stopped) {
    report.correction = correction_of(run.correction.self);
    add_correction_figures(run, config, run.trees, *report.correction);
  }
  if (run.truth) documents.compare_with_truth(compare_with_truth(trajectory, *run.truth));
  report.remarks.push_back(
      run.evidence.imu_used
          ? "The vertical is known from gravity, by the IMU, and from the stems."
          : "The vertical is known from the stems alone. Over a long path the map may tilt by "
            "degrees. Distances in the plane are right, heights far apart may not be.");
  report.scans = scans_of(run);
  add_loops(run, report);
  report.loop_closure_enabled = config.close_loops;
}

}  // namespace understory
