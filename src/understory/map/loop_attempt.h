#pragma once

#include <string>

#include "understory/graph/pose_graph.h"

namespace understory {

// A loop that was tried, for graph, report and run.json.
struct LoopAttempt {
  int from = 0;  // the older keyframe
  int to = 0;
  bool verified = false;      // the scans fit; whether the graph accepts it is another question
  double correction_m = 0.0;  // by how much it disagreed with the poses at the time
  PoseEdge edge;              // if verified
  std::string reason;         // if not
};

}  // namespace understory
