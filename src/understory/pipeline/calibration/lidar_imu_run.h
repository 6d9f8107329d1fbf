#pragma once

#include <filesystem>
#include <string>

#include "understory/calibration/lidar_imu/lidar_imu_calibration.h"
#include "understory/pipeline/run_folder/run_outcome.h"
#include "understory/recording/recording.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// One call of `understory calibrate lidar-imu`.
struct LidarImuRequest {
  std::string recording;
  OpenOptions open;
  std::string path_file;         // TUM, world_from_lidar at stamps of the recording; empty: mapped
  std::filesystem::path folder;  // of the results
  bool overwrite = false;
};

// What it came to. Partial where the motion does not tell all.
struct LidarImuOutcome : RunOutcome {
  LidarImuResult result;
  Rig rig;  // with the IMU where it was found
};

// Calibrates the IMU by the path of the lidar. Unless one is given, the recording is mapped for it:
// without the IMU first, then with scans that the IMU deskews. Writes extrinsics.yaml (for
// --extrinsics), calibration.json and path.tum (of the lidar). Throws InputError where nothing can
// be found out, OutputError, ConfigError, and Stopped where the user stops it: nothing is written
// then.
[[nodiscard]] LidarImuOutcome run_lidar_imu_calibration(const LidarImuRequest& request, Log& log,
                                                        const ProgressSink& progress);

}  // namespace understory
