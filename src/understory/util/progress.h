#pragma once

#include <functional>
#include <string>

namespace understory {

// One report of how far long work has come. `total` is 0 where the end is not known.
struct ProgressReport {
  std::string stage;   // "mapping", "writing map.laz"
  double done = 0.0;   // in `unit`
  double total = 0.0;  // in `unit`, 0 = unknown
  std::string unit;    // "s of recording", "scans"
  std::string remark;  // "3 loops", empty if nothing to say
};

// Passed into long work; called from the working thread, often. The receiver limits its own rate.
using ProgressSink = std::function<void(const ProgressReport&)>;

// Asked between units of work; true ends the work cleanly with what there is so far.
using StopRequested = std::function<bool()>;

}  // namespace understory
