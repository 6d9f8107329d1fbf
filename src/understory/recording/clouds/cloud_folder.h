#pragma once

#include <memory>
#include <string>

#include "understory/recording/recording.h"

namespace understory {

// A folder of clouds (.pcd, .ply, .las, .laz, KITTI .bin) in the order of their names. One such
// file is a recording of one scan. In a folder imu.csv, gnss.csv and *.nmea are merged by time.
// Throws InputError if there is no cloud in it or the times are unusable.
[[nodiscard]] bool is_cloud_folder(const std::string& path);
[[nodiscard]] bool is_cloud_file(const std::string& path);
[[nodiscard]] std::unique_ptr<Recording> open_cloud_folder(const std::string& path,
                                                           const OpenOptions& options, Log& log);

}  // namespace understory
