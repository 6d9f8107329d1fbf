#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "understory/recording/recording.h"

namespace understory {

// Writes one scan as a cloud file; throws OutputError.
using CloudWriter = std::function<void(const std::string& path, const Scan& scan)>;

// The writer for ".pcd" (binary), ".ply" (binary) or ".bin" (KITTI: x y z intensity, so without
// times and rings); none for any other ending. PCD and PLY hold x, y, z, intensity (float32), t
// (uint32, nanoseconds since the scan's stamp), ring (uint16) and return_index (uint8).
[[nodiscard]] CloudWriter cloud_writer(const std::string& ending);

// Writes a recording as a folder: 000000.pcd ... and times.txt (stamp of each cloud, seconds),
// imu.csv, gnss.csv, extrinsics.yaml. Makes the folder if it is missing; throws OutputError if it
// holds clouds already or cannot be written. Magnetometer samples have no place in it. Not
// thread-safe.
class CloudFolderWriter {
 public:
  CloudFolderWriter(const std::string& folder, const std::string& ending, CloudWriter write_cloud);
  ~CloudFolderWriter();
  CloudFolderWriter(const CloudFolderWriter&) = delete;
  CloudFolderWriter& operator=(const CloudFolderWriter&) = delete;

  void set_rig(const Rig& rig);
  void write(const Event& event);
  void finish();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace understory
