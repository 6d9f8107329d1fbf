#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "understory/preprocess/streams/event_orderer.h"

namespace understory {

class OnlinePath;

// What the event loop knows of a run beside what the front end has found.
struct RunFacts {
  bool stopped = false;    // before the end of the recording
  std::string unreadable;  // why the recording could not be read to its end; else the user stopped
  std::string goes_on_by;  // the command that goes on with the run
  std::function<double()> elapsed_s;  // seconds that the run has taken so far
  std::string format;                 // of the recording
  EventOrderer::Report time_repair;
  bool realtime = false;
  std::vector<double> latencies_ms;  // from a scan's end to its pose, --realtime only
  std::uint64_t dropped_scans = 0;
  std::vector<double> memory_mb;       // resident, at each checkpoint
  const OnlinePath* online = nullptr;  // the event loop's; null where it is switched off
};

}  // namespace understory
