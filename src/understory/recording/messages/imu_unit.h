#pragma once

#include <string>

#include "understory/sensor/imu_sample.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// The unit of an IMU's accelerations. Drivers that give multiples of gravity are told from m/s^2 by
// the mean over the first seconds. No carrier keeps that at a tenth of gravity.
class ImuUnit {
 public:
  // By the mean specific force of the first samples. True if it is g.
  bool judge(double mean_specific_force);
  // Nothing is known: an IMU that begins later is judged by its first sample.
  void forget() { text_.clear(); }
  [[nodiscard]] bool known() const { return !text_.empty(); }
  // For TopicReport::conventions; empty where nothing is known.
  [[nodiscard]] const std::string& text() const { return text_; }

  // Brings the specific force of a sample to m/s^2.
  void convert(ImuSample& sample) const { sample.specific_force *= scale_; }

  // The state, for checkpoints.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  double scale_ = 1.0;
  std::string text_ = "m/s^2, rad/s (assumed)";
};

}  // namespace understory
