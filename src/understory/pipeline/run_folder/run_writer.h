#pragma once

#include <functional>
#include <string>
#include <vector>

#include "understory/pipeline/mapping/mapping.h"
#include "understory/pipeline/mapping/mapping_session.h"
#include "understory/pipeline/run_folder/run_folder.h"
#include "understory/preprocess/event_orderer.h"
#include "understory/recording/recording.h"

namespace understory {

// What the driving loop knows of a run beside the session.
struct RunFacts {
  bool stopped = false;    // before the end of the recording
  std::string unreadable;  // why the recording could not be read to its end; else the user stopped
  std::function<double()> elapsed_s;  // seconds that the run has taken so far
  std::string format;                 // of the recording
  EventOrderer::Report time_repair;
  bool realtime = false;
  std::vector<double> latencies_ms;  // one per scan, --realtime only
  std::uint64_t dropped_scans = 0;
  std::vector<double> memory_mb;  // resident, at each checkpoint
};

// Writes the results (design: formats) to where the run folder keeps them until they are put in
// place: trajectory, states, keyframes, graph, fixes, map, trees, terrain, run.json, report.
[[nodiscard]] MappingOutcome write_run(const MappingRequest& request, const RunFolder& place,
                                       MappingSession& session, const RunFacts& facts,
                                       const Recording& source, Log& log,
                                       const ProgressSink& progress);

}  // namespace understory
