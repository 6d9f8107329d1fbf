#include "understory/pipeline/mapping/mapping.h"

#include <utility>

#include "understory/pipeline/mapping/event_loop.h"
#include "understory/pipeline/mapping/front_end.h"
#include "understory/util/error.h"

namespace understory {
namespace {

RunOutcome nothing_to_map(const FrontEnd& front_end, const Recording& recording,
                          const std::string& name, bool stopped) {
  if (!stopped) throw InputError(name, "", front_end.why_no_map(recording));
  const std::string reason = "stopped by the user before the first scan; nothing was written";
  return {RunStatus::kPartial, {reason}, reason};
}

// Who stops the reading gets the map of what was read. Who stops the making of the map gets none:
// the state on the disk is what the run goes on from.
ProgressSink until_stopped(const RunFacts& facts, const ProgressSink& progress,
                           const StopRequested& stop_requested) {
  const bool stopped_reading = facts.stopped && facts.unreadable.empty();
  return stopped_reading ? progress : progress.stopped_by(stop_requested);
}

}  // namespace

RunOutcome run_mapping(MappingRun run, Log& log, const ProgressSink& progress,
                       const StopRequested& stop_requested) {
  // Open the recording, or find the place in it where the run was cut off.
  EventLoop loop(run.request, run.state, log, progress, stop_requested);

  // Position the scans, one after another.
  const RunFacts facts = loop.run();
  FrontEnd& front_end = loop.front_end();
  if (!front_end.has_map()) {
    run.state.remove();
    return nothing_to_map(front_end, loop.recording(), run.request.recording, facts.stopped);
  }

  // Make the map of them.
  const RunFolder& folder = run.state.folder();
  const std::filesystem::path results = folder.begin_results();
  const ProgressSink sink = until_stopped(facts, progress, stop_requested);
  const auto map = front_end.map_maker(
      {loop.request(), facts, loop.recording(), folder.work(), results, log, sink});
  map->close_loops();
  map->finish_map();
  map->list_trees();
  RunOutcome outcome = map->write();

  // Put the results in place. What a stopped run has so far is no successor of a former run.
  folder.commit(log, facts.stopped && !run.state.resumed());
  if (!facts.stopped) run.state.remove();
  return outcome;
}

MappingRun begin_mapping(MappingRequest request) {
  check_files_named_in(request.config);
  RunState state = RunState::create(request);
  return {std::move(request), std::move(state)};
}

MappingRun reopen_mapping(const std::filesystem::path& run_folder) {
  UnfinishedRun unfinished = RunState::reopen(run_folder);
  MappingRequest& request = unfinished.request;
  request.config = reread_front_end_config(
      unfinished.state.front_end(), request.config_record.asked_yaml, run_folder.string(),
      [&](const std::string& file) { return request.found(file); });
  return {std::move(request), std::move(unfinished.state)};
}

}  // namespace understory
