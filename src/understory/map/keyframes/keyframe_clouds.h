#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/util/files/record_file.h"
#include "understory/util/time.h"

namespace understory {

// One point of a cloud, in the body frame at the cloud's stamp, metres.
struct KeyframePoint {
  float x = 0.0F;
  float y = 0.0F;
  float z = 0.0F;
  std::uint16_t intensity = 0;
  std::uint16_t t_10us = 0;  // since the cloud's stamp, in steps of 10 microseconds
};

// Points of one scan, in the body frame, metres, at a pose relative to their keyframe.
struct KeyframeCloud {
  std::int32_t id = 0;  // of a keyframe, which takes the cloud along when it is moved
  TimeNs stamp = 0;
  std::vector<KeyframePoint> points;
  Pose keyframe_from_body;  // at the stamp; identity for the keyframe's own cloud
};

// Clouds that belong to keyframes, on disk, appended one after another, so that memory does not
// grow with the length of a run. Not thread-safe. Throws OutputError where the disk is full,
// InputError where the file is damaged.
class KeyframeClouds {
 public:
  // Begins anew.
  explicit KeyframeClouds(const std::filesystem::path& path);
  // Goes on behind the clouds that are `known`; what follows them is cut off.
  KeyframeClouds(const std::filesystem::path& path, const RecordCount& known);

  void append(const KeyframeCloud& cloud);
  // Waits until all clouds are on the disk.
  void sync() { file_.sync(); }
  [[nodiscard]] std::size_t size() const { return offsets_.size(); }
  // The i-th appended cloud.
  [[nodiscard]] KeyframeCloud read(std::size_t i) const;
  [[nodiscard]] const RecordCount& count() const { return file_.count(); }

 private:
  std::vector<std::uint64_t> offsets_;  // of the records
  RecordFile file_;
};

}  // namespace understory
