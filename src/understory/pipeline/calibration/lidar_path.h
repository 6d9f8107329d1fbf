#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "understory/geometry/stamped_pose.h"
#include "understory/odometry/imu/imu_buffer.h"
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

// The path of the lidar that `open` names as that lidar alone tells it, world_from_lidar: the
// recording is mapped without the IMU. `folder`: of files that are removed in the end. `doubts`:
// why the path is not to be trusted, if it is not.
[[nodiscard]] std::vector<StampedPose> mapped_lidar_path(
    const std::string& recording, const OpenOptions& open, const std::filesystem::path& folder,
    const Rig& rig, const ProgressSink& progress, std::vector<std::string>& doubts);

// world_from_lidar of a TUM file.
[[nodiscard]] std::vector<StampedPose> lidar_path_of_file(const std::string& file);

// A pose as extrinsics files have it: {translation_m: [...], rotation_xyzw: [...]}.
[[nodiscard]] std::string pose_yaml(const Pose& pose);

}  // namespace understory
