#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

#include "understory/features/stem_segments.h"
#include "understory/simulation/sensors/scanner.h"
#include "understory/simulation/world.h"

namespace understory {

// A simulated site whose frames and truth are at hand, for tests and benchmarks.
struct TestFrames : SimulatedWorld {
  explicit TestFrames(const SiteConfig& config)
      : SimulatedWorld(config), scanner(site, scene, plan.path, machine, 0) {}

  // World from the lidar, seconds after the frame's stamp.
  [[nodiscard]] Pose world_from_lidar(const Scan& scan, double after_s) const;
  [[nodiscard]] double duration_s() const { return plan.path.duration_s() - 0.5; }

  Scanner scanner;
};

// What was found of the stems in one band of range, over many frames.
struct StemBand {
  int seen = 0;  // stems with returns from two rings or more
  int seen_found = 0;
  int clear = 0;  // ... with three returns from each of two rings or more
  int clear_found = 0;
  int segments = 0;
  int right = 0;              // within 0.4 m of a stem
  double squares = 0.0;       // of the centre's error in the middle of what was seen, in the plane
  double along = 0.0;         // sum of that error along the line of sight
  int feet = 0;               // segments whose foot is on the ground
  double foot_squares = 0.0;  // of its error in the plane
  double foot_height_squares = 0.0;
  double foot_height = 0.0;
  double radius_squares = 0.0;
  double radius = 0.0;

  StemBand& operator+=(const StemBand& other);
  [[nodiscard]] double recall() const { return clear > 0 ? double(clear_found) / clear : 0.0; }
  [[nodiscard]] double precision() const { return segments > 0 ? double(right) / segments : 0.0; }
  [[nodiscard]] double centre_rmse_m() const;
};

// Holds the segments of a frame against the truth, at the moment when each was seen. Bands are of
// 5 m. Writes the traits of each segment and whether it is right to `traits`, if given.
void compare_stems(const TestFrames& site, const SimulatedScan& frame, const StemSegments& found,
                   std::vector<StemBand>& bands, std::FILE* traits = nullptr);

}  // namespace understory
