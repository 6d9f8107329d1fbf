#include "understory/pipeline/correction.h"

#include <fmt/format.h>

#include <chrono>

#include "understory/pipeline/correction_files.h"
#include "understory/pipeline/run_folder.h"
#include "understory/recording/stems_file.h"

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
  table.add("close_loops", config.close_loops, "find places seen before and correct the path");
  table.section("loops", [&] { describe(table, config.loops); });
  table.section("pose_graph", [&] { describe(table, config.graph); });
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
  run.steps = position(run.views, request.config.odometry, progress, stop_requested, run.times);
  run.stopped = run.steps.size() < run.views.size();
  run.views.resize(run.steps.size());
  for (const SparseStep& step : run.steps)
    run.correction.world_from_body.push_back(step.world_from_body);
  if (request.config.close_loops && !run.stopped) {
    if (progress) progress({"loops", 0.0, 0.0, "", ""});
    const ScopedTimer timer(run.times, "loops");
    run.correction =
        close_stem_loops(run.views, run.steps, request.config.loops, request.config.graph);
  }
  return write_correction(request, run, log);
}

}  // namespace understory
