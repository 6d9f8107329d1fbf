#pragma once

#include <cstdint>
#include <map>

#include "understory/pipeline/judgement/run_evidence.h"
#include "understory/util/time.h"

namespace understory {

// Follows how well scans fit the map, in windows of two seconds. It notes where few points of a
// scan find the map. It also notes where those that find it lie no nearer than chance would put
// them. The first ten seconds do not count: the map is a few scans then. Memory: 40 bytes a window.
// Not thread-safe.
class MatchCourse {
 public:
  // Reach of the matcher, see Matcher::reach_m: of cells it is the edge of the finest ones. A point
  // anywhere in such a cell is half an edge (RMS) from its middle.
  explicit MatchCourse(double reach_m) : reach_m_(reach_m) {}

  // One scan, in order of time. Without a match it found none of its points.
  //   inlier_ratio: share of its points near the map; fitness_m2: their mean squared distance
  void add(TimeNs stamp, bool matched, double inlier_ratio, double fitness_m2);
  // Writes the shares and the growth; see MatchEvidence.
  void put(MatchEvidence& evidence) const;

 private:
  struct Window {
    double inliers = 0.0;  // sums
    double squares_m2 = 0.0;
    std::uint64_t scans = 0;
    std::uint64_t matched = 0;
  };
  double reach_m_;
  TimeNs first_ = 0;
  std::map<TimeNs, Window> windows_;  // by number
};

}  // namespace understory
