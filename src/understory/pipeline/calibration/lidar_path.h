#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "understory/geometry/stamped_pose.h"
#include "understory/odometry/imu/imu_buffer.h"
#include "understory/pipeline/mapping/adaptation.h"
#include "understory/recording/recording.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// The samples of the IMU of a recording, and the rig.
struct InertialRecording {
  ImuBuffer samples{ImuNoiseConfig(), nullptr};
  Rig rig;
};

// Reads all samples. Throws InputError where there is none.
[[nodiscard]] InertialRecording read_samples(const std::string& recording, const OpenOptions& open,
                                             Log& log, const ProgressSink& progress);

// The path of a lidar, and why it is not to be trusted, if it is not.
struct LidarPath {
  std::vector<StampedPose> world_from_lidar;
  std::vector<std::string> doubts;
};

// The path of the lidar that `open` names, by mapping the recording. A scan has one pose, at its
// middle and by its match alone: that hardly depends on how the scan was deskewed. `imu`: place and
// clock of the IMU, which deskews the scans and is refined on the way; else lidar alone.
// `folder`: of files that are removed in the end. With an IMU that the scans contradict it is
// doubted.
[[nodiscard]] LidarPath mapped_lidar_path(const std::string& recording, const OpenOptions& open,
                                          const std::filesystem::path& folder, const Rig& rig,
                                          const ProgressSink& progress,
                                          const std::optional<RefinedImu>& imu = std::nullopt);

// world_from_lidar of a TUM file.
[[nodiscard]] std::vector<StampedPose> lidar_path_of_file(const std::string& file);

// A pose as extrinsics files have it: {translation_m: [...], rotation_xyzw: [...]}.
[[nodiscard]] std::string pose_yaml(const Pose& pose);

}  // namespace understory
