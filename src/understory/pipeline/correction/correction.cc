#include "understory/pipeline/correction/correction.h"

#include <fmt/format.h>

#include <algorithm>

#include "understory/evaluation/trajectory.h"
#include "understory/pipeline/correction/correction_files.h"
#include "understory/pipeline/run_folder/run_folder.h"
#include "understory/recording/clouds/stems_file.h"
#include "understory/util/error.h"
#include "understory/util/output_guard.h"

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

// A run's trajectory in place of the chained odometry: what matching tells of the steps stays.
void begin_from(const std::filesystem::path& trajectory, CorrectionRun& run) {
  constexpr TimeNs kSame = 1'000'000;
  run.path = read_trajectory(trajectory);
  run.inputs.push_back(hash_input(trajectory));
  for (std::size_t i = 0; i < run.steps.size(); ++i) {
    const TimeNs stamp = run.views[i].stamp;
    const auto at =
        std::lower_bound(run.path.begin(), run.path.end(), stamp - kSame,
                         [](const StampedPose& pose, TimeNs time) { return pose.stamp < time; });
    if (at == run.path.end() || at->stamp > stamp + kSame)
      throw InputError(trajectory.string(), "",
                       fmt::format("expected a pose at {}, when view {} of the stems was taken",
                                   format_seconds(stamp), run.views[i].frame));
    run.steps[i].world_from_body = at->world_from_body;
    if (i > 0)
      run.steps[i].previous_from_body =
          run.steps[i - 1].world_from_body.inverse() * at->world_from_body;
  }
}

// A run folder stands for the stems that it holds.
std::filesystem::path stems_of(const CorrectionRequest& request) {
  if (!std::filesystem::is_directory(request.stems)) return request.stems;
  std::filesystem::path stems = request.stems / "stems.csv.gz";
  if (std::filesystem::exists(stems)) return stems;
  throw InputError(request.stems.string(), "",
                   "expected a run folder that holds stems.csv.gz: a run of `understory map "
                   "--front-end sparse`");
}

// All that is read, where the stems are not those that a mapping run has just found.
std::vector<std::filesystem::path> inputs_of(const CorrectionRequest& request) {
  return {request.stems, request.config.harvester.head_log};
}

RunOutcome correct_into_results(const CorrectionRequest& request, Log& log,
                                const ProgressSink& progress, const StopRequested& stop_requested) {
  CorrectionRun run;
  {
    const ScopedTimer timer(run.times, "reading");
    const std::filesystem::path stems = stems_of(request);
    run.views = read_stem_views(stems, log);
    run.inputs.push_back(hash_input(stems));
    if (request.scans == nullptr) run.trust = trust_of_run(request.stems);
    const std::string& head_log = request.config.harvester.head_log;
    run.head_cuts = read_head_log(head_log);
    if (!head_log.empty()) run.inputs.push_back(hash_input(head_log));
  }
  // The front end has positioned the views already, with the scans between them.
  run.steps = request.scans != nullptr ? request.scans->steps
                                       : position(run.views, request.config.odometry, progress,
                                                  stop_requested, run.times);
  UNDERSTORY_CHECK(run.steps.size() <= run.views.size());
  if (request.scans != nullptr) run.path = request.scans->path;
  if (std::filesystem::is_directory(request.stems))
    begin_from(request.stems / "trajectory.tum", run);
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

}  // namespace

void describe(ConfigTable& table, CorrectionConfig& config) {
  table.section("odometry", [&] { describe(table, config.odometry); });
  describe(table, config.stems);
  table.section("tree_list", [&] { describe(table, config.tree_list); });
  table.section("harvester", [&] { describe(table, config.harvester); });
  table.section("judgement", [&] {
    describe(table, config.judgement);
    table.section("motion", [&] { describe(table, config.motion_limits); });
  });
}

RunOutcome run_correction(const CorrectionRequest& request, Log& log, const ProgressSink& progress,
                          const StopRequested& stop_requested) {
  if (!request.results.empty()) return correct_into_results(request, log, progress, stop_requested);
  refuse_input_as_output(request.run_folder, inputs_of(request));
  const RunFolder place = RunFolder::claim(request.run_folder, request.overwrite);
  CorrectionRequest placed = request;
  placed.results = place.begin_results();
  RunOutcome outcome = correct_into_results(placed, log, progress, stop_requested);
  place.commit(log, stop_requested && stop_requested());
  place.forget_state();  // of an unfinished run that this one replaces
  return outcome;
}

}  // namespace understory
