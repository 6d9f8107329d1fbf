#pragma once

#include <optional>

#include "understory/odometry/motion/motion_model.h"
#include "understory/sensor/imu_sample.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/time.h"

namespace understory {

// For how long samples of an IMU came that could not be used. A hole between samples counts a tenth
// of a second at most: holes are counted where the messages are put in order. Not thread-safe.
class ImuUsage {
 public:
  // In order of time. `has_place`: its extrinsics are known.
  void add(const ImuSample& sample, bool has_place, const ImuNoiseConfig& config);

  [[nodiscard]] TimeNs without_place() const { return without_place_; }
  // Not finite, or beyond the sensor's range: see defect_of.
  [[nodiscard]] TimeNs unusable() const { return unusable_; }

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  std::optional<TimeNs> last_;
  TimeNs without_place_ = 0;
  TimeNs unusable_ = 0;
};

}  // namespace understory
