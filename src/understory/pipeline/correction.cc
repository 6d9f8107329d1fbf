#include "understory/pipeline/correction.h"

#include <fmt/format.h>

#include <chrono>

#include "understory/pipeline/correction_files.h"
#include "understory/pipeline/run_folder.h"
#include "understory/recording/stems_file.h"
#include "understory/util/error.h"

namespace understory {
namespace {

// The chained odometry, before any correction.
std::vector<SparseStep> position(const std::vector<StemView>& views,
                                 const SparseOdometryConfig& config, const ProgressSink& progress,
                                 const StopRequested& stop_requested, StageTimes& times) {
  SparseOdometry odometry(config);
  std::vector<SparseStep> steps;
  for (const StemView& view : views) {
    if (stop_requested && stop_requested()) break;
    const ScopedTimer timer(times, "scan");
    steps.push_back(odometry.add(view));
    if (progress)
      progress({"odometry", static_cast<double>(steps.size()), static_cast<double>(views.size()),
                "views", ""});
  }
  return steps;
}

}  // namespace

void describe(ConfigTable& table, CorrectionConfig& config) {
  table.section("odometry", [&] { describe(table, config.odometry); });
  describe(table, config.stems);
}

CorrectionOutcome run_correction(const CorrectionRequest& request, Log& log,
                                 const ProgressSink& progress,
                                 const StopRequested& stop_requested) {
  if (!request.overwrite) refuse_unfinished_run(request.run_folder);
  CorrectionRun run;
  {
    const ScopedTimer timer(run.times, "reading");
    run.views = read_stem_views(request.stems, log);
  }
  // The front end has positioned the views already, with the scans between them.
  run.steps = request.scans != nullptr ? request.scans->steps
                                       : position(run.views, request.config.odometry, progress,
                                                  stop_requested, run.times);
  UNDERSTORY_CHECK(run.steps.size() <= run.views.size());
  run.stopped = run.steps.size() < run.views.size();
  run.views.resize(run.steps.size());
  if (run.stopped) {
    for (const SparseStep& step : run.steps)
      run.correction.world_from_body.push_back(step.world_from_body);
  } else {
    if (progress) progress({"correction", 0.0, 0.0, "", ""});
    run.correction = correct_stems(run.views, run.steps, request.config.stems, run.times);
  }
  return write_correction(request, run, log);
}

}  // namespace understory
