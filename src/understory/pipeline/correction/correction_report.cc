#include "understory/pipeline/correction/correction_report.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <system_error>

#include "understory/map/stem_map.h"
#include "understory/output/report.h"
#include "understory/output/run_tables.h"
#include "understory/pipeline/correction/correction_figures.h"
#include "understory/pipeline/correction/spread_corrections.h"
#include "understory/pipeline/run_folder/run_folder.h"
#include "understory/pipeline/run_folder/run_truth.h"
#include "understory/pipeline/source.h"
#include "understory/util/error.h"
#include "understory/util/version.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

ReportCorrection correction_of(const SelfCorrectionResult& self) {
  ReportCorrection report;
  report.ended = self.stopped_because;
  const MapSharpness& a = self.before;
  const MapSharpness& b = self.after;
  report.figures = {
      {"distance of a tree's sights from their mean (e_C), cm", 100.0 * a.noise_m,
       100.0 * b.noise_m, 1},
      {"blurred area (beta), per mille of the map", 1e3 * a.beta, 1e3 * b.beta, 2},
      {"dimension of the map (d): 0 points, 1 lines, 2 areas", a.dimension, b.dimension, 2}};
  for (const TriedCorrection& tried : self.tried)
    (tried.kept ? report.kept : report.tried).emplace_back(tried.pair.i, tried.pair.j);
  return report;
}

// Of each view: what its scan took, or its step where stems were all there was. 0: unknown.
std::vector<float> scan_times_ms(const CorrectionRequest& request, const CorrectionRun& run) {
  std::vector<float> times_ms(run.views.size(), 0.0F);
  const bool of_scans = request.scans != nullptr;
  const StageTimes* times = of_scans ? request.scans->times : &run.times;
  const auto samples = times->samples("scan");
  // A stage that ran very often keeps a part of its samples: then they belong to no view.
  if (samples.size() != (of_scans ? request.scans->path.size() : run.views.size())) return times_ms;
  for (std::size_t i = 0; i < run.views.size(); ++i)
    times_ms[i] = samples[of_scans ? static_cast<std::size_t>(run.views[i].frame) : i].wall_ms;
  return times_ms;
}

}  // namespace

ReportInput correction_report(const CorrectionRequest& request, const CorrectionRun& run,
                              const RunSummary& summary, const std::vector<Tree>& trees) {
  ReportInput report;
  report.trees = &trees;
  if (!run.stopped) {
    report.correction = correction_of(run.correction.self);
    add_correction_figures(run, request.config.stems, trees, *report.correction);
  }
  report.title = request.stems.filename().string();
  report.made_from = fmt::format("stems of {} views", run.views.size());
  if (request.scans != nullptr) {
    report.title = fs::path(request.scans->recording).filename().string();
    report.made_from =
        fmt::format("{}, {} scans, stems of {} views", request.scans->source->format(),
                    request.scans->path.size(), run.views.size());
    report.truth = compare_with_truth(request.run_folder, request.results, *request.scans->source);
  }
  report.summary = summary;
  report.remarks.push_back(
      "Up is known from the stems alone: over a long way the map may tilt by degrees, and heights "
      "far apart not hold. Distances in the plane do.");
  const std::vector<float> times_ms = scan_times_ms(request, run);
  for (std::size_t i = 0; i < run.views.size(); ++i) {
    ReportScan scan;
    scan.stamp = run.views[i].stamp;
    scan.position = run.correction.world_from_body[i].translation().cast<float>();
    scan.wall_ms = times_ms[i];
    scan.inlier_ratio = static_cast<float>(i == 0 ? 1.0 : run.steps[i].overlap);
    scan.weak = run.steps[i].status == SparseStepStatus::kWeak ||
                run.steps[i].status == SparseStepStatus::kUnmatched;
    report.scans.push_back(scan);
  }
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
  report.loop_closure_enabled = request.config.stems.close_loops;
  return report;
}

}  // namespace understory
