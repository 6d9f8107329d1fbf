#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/georeference/geodetic.h"
#include "understory/output/run_summary.h"
#include "understory/output/run_tables.h"

namespace understory {

// How a run is to be moved, and what to say of it. Every method of `georeference` returns one.
struct Placement {
  Pose target_from_world;
  std::optional<GeodeticPlace> origin;    // of the target frame, where that is east, north, up
  std::vector<InputHash> inputs;          // files that it was computed from, beside the run's own
  std::vector<GnssRow> gnss;              // the fixes as used, for gnss.csv
  std::map<std::string, Figure> figures;  // for run.json
  std::string summary;                    // a few lines for the terminal
  std::vector<std::string> doubts;        // why the result is untrusted

  void doubt(const std::string& reason) { doubts.push_back(reason); }
};

}  // namespace understory
