#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/simulation/scanner.h"
#include "understory/simulation/total_station.h"
#include "understory/simulation/world.h"
#include "understory/util/time.h"

namespace understory {

// The truth about one scan.
struct ScanTruth {
  TimeNs stamp = 0;
  Pose world_from_body;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  // world
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();
  std::vector<StemReturns> stems;
};

// Writes the truth folder (docs/simulation.md); that of the total station only where it measured.
// Throws OutputError.
void write_truth_folder(const std::string& folder, const SimulatedWorld& world, TimeNs start,
                        const std::vector<ScanTruth>& scans, const std::vector<PrismSample>& prism);

}  // namespace understory
