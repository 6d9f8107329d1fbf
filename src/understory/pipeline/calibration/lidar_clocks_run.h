#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "understory/calibration/lidar_imu/lidar_imu_calibration.h"
#include "understory/pipeline/run_folder/run_outcome.h"
#include "understory/recording/recording.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// One call of `understory calibrate lidars`.
struct LidarClocksRequest {
  std::string recording;
  OpenOptions open;              // names the lidars
  std::filesystem::path folder;  // of the results
  bool overwrite = false;
};

// The clock of one lidar.
struct LidarClock {
  std::string topic;
  double late_s = 0.0;  // its stamps less those of the IMU, for one moment
  double sd_s = 0.0;
  Rig rig;  // with this lidar
  LidarImuResult result;
};

// What it came to, in the order of the lidars. Partial where the motion does not tell a clock.
struct LidarClocksOutcome : RunOutcome {
  std::vector<LidarClock> clocks;
};

// Finds how late the clock of each lidar is. Each lidar maps the recording alone and without the
// IMU, and the IMU is fitted to its path (calibrate_lidar_imu). Places stay as they are given.
// Writes extrinsics.yaml with all lidars and their `late_s` (for --extrinsics) and
// calibration.json. Throws InputError where nothing can be found out, OutputError, ConfigError, and
// Stopped where the user stops it: nothing is written then.
[[nodiscard]] LidarClocksOutcome run_lidar_clocks(const LidarClocksRequest& request, Log& log,
                                                  const ProgressSink& progress);

}  // namespace understory
