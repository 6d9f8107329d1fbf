#include "understory/pipeline/correction/correction.h"

#include <fmt/format.h>

#include <algorithm>

#include "understory/evaluation/trajectory.h"
#include "understory/evaluation/world_frame.h"
#include "understory/pipeline/correction/correction_run.h"
#include "understory/pipeline/correction/stem_map_maker.h"
#include "understory/pipeline/judgement/inherited_trust.h"
#include "understory/pipeline/run_folder/run_documents.h"
#include "understory/pipeline/run_folder/run_folder.h"
#include "understory/pipeline/run_folder/run_json.h"
#include "understory/recording/clouds/stems_file.h"
#include "understory/util/error.h"
#include "understory/util/files/output_guard.h"

namespace understory {
namespace {

// The chained odometry, before any correction; of fewer views where the user stops it.
std::vector<SparseStep> position(const std::vector<StemView>& views,
                                 const SparseOdometryConfig& config, const ProgressSink& progress,
                                 const StopRequested& stop_requested, StageTimes& times) {
  SparseOdometry odometry(config);
  std::vector<SparseStep> steps;
  for (const StemView& view : views) {
    if (stop_requested && stop_requested()) break;
    const ScopedTimer timer(times, "scan");
    steps.push_back(odometry.add(view));
    progress({"odometry", static_cast<double>(steps.size()), static_cast<double>(views.size()),
              "views", ""});
  }
  return steps;
}

// A run's trajectory in place of the chained odometry: what matching tells of the steps stays.
void begin_from(const std::filesystem::path& trajectory, CorrectionInput& input,
                RunDocuments& documents) {
  constexpr TimeNs kSame = 1'000'000;
  input.path = read_trajectory(trajectory);
  documents.add_input(trajectory);
  for (std::size_t i = 0; i < input.steps.size(); ++i) {
    const TimeNs stamp = input.views[i].stamp;
    const auto at =
        std::lower_bound(input.path.begin(), input.path.end(), stamp - kSame,
                         [](const StampedPose& pose, TimeNs time) { return pose.stamp < time; });
    if (at == input.path.end() || at->stamp > stamp + kSame)
      throw InputError(trajectory.string(), "",
                       fmt::format("expected a pose at {}, when view {} of the stems was taken",
                                   format_seconds(stamp), input.views[i].frame));
    input.steps[i].world_from_body = at->world_from_body;
    if (i > 0)
      input.steps[i].previous_from_body =
          input.steps[i - 1].world_from_body.inverse() * at->world_from_body;
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

std::vector<std::filesystem::path> inputs_of(const CorrectionRequest& request) {
  return {request.stems, request.config.harvester.head_log};
}

// The file of stems, the log of the head, and what is known of both.
CorrectionInput read_stems(const CorrectionRequest& request, Log& log, StageTimes& times,
                           RunDocuments& documents) {
  CorrectionInput input;
  const ScopedTimer timer(times, "reading");
  const std::filesystem::path stems = stems_of(request);
  input.views = read_stem_views(stems, log);
  documents.add_input(stems);
  documents.inherit(trust_of_run(request.stems));
  // Beside a path in north, east, down its correction has the same axes.
  if (std::filesystem::is_directory(request.stems)) {
    documents.tell_world_in(world_frame_of_run(request.stems));
    input.lidar_model = RunJson(request.stems).find_text("/lidar_model");
  }
  documents.report().title = request.stems.filename().string();
  const std::string& head_log = request.config.harvester.head_log;
  input.head_cuts = read_head_log(head_log);
  if (!head_log.empty()) documents.add_input(head_log);
  return input;
}

// All views that were read, with their steps; fewer where the user stops it.
void position_views(const CorrectionRequest& request, const ProgressSink& progress,
                    const StopRequested& stop_requested, StageTimes& times, CorrectionInput& input,
                    RunDocuments& documents) {
  input.steps = position(input.views, request.odometry, progress, stop_requested, times);
  if (std::filesystem::is_directory(request.stems))
    begin_from(request.stems / "trajectory.tum", input, documents);
  input.stopped = input.steps.size() < input.views.size();
  input.evidence.stopped = input.stopped;
  input.views.resize(input.steps.size());
  documents.report().made_from = fmt::format("stems of {} views", input.views.size());
  input.scan_ms.assign(input.views.size(), 0.0F);
  const auto samples = times.samples("scan");
  // A stage that ran very often keeps a part of its samples: then they belong to no view.
  if (samples.size() != input.views.size()) return;
  for (std::size_t i = 0; i < samples.size(); ++i)
    input.scan_ms[i] = samples[i].wall_ms;
}

}  // namespace

RunOutcome run_correction(const CorrectionRequest& request, Log& log, const ProgressSink& progress,
                          const StopRequested& stop_requested) {
  refuse_input_as_output(request.run_folder, inputs_of(request));
  const RunFolder folder = RunFolder::claim(request.run_folder, request.overwrite);
  StageTimes times;
  RunDocuments documents("correct", request.config_record, times, log);
  CorrectionInput input = read_stems(request, log, times, documents);
  position_views(request, progress, stop_requested, times, input, documents);
  const std::filesystem::path results = folder.begin_results();
  // Who stops the positioning gets the map of what was positioned.
  const bool stopped = input.stopped;
  const ProgressSink sink = stopped ? progress : progress.stopped_by(stop_requested);
  StemMapMaker map(std::move(input), std::move(documents), request.config,
                   {request.run_folder, results, times, log, sink, {}});
  map.close_loops();
  map.finish_map();
  map.list_trees();
  RunOutcome outcome = map.write();
  folder.commit(log, stopped);
  folder.forget_state();  // of an unfinished run that this one replaces
  return outcome;
}

}  // namespace understory
