#pragma once

#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "understory/odometry/imu/preintegration.h"

namespace understory {

// Why a sample of an IMU cannot be used by itself.
enum class SampleDefect {
  kNone,
  kNotFinite,
  kDegrees,   // more than twice the sensor's range: degrees per second, no radians
  kSaturated  // at the end of the sensor's range
};
[[nodiscard]] SampleDefect defect_of(const ImuSample& sample, const ImuNoiseConfig& config);

// Checked IMU samples in order of time, as long as somebody needs them. Not thread-safe.
class ImuBuffer {
 public:
  ImuBuffer(const ImuNoiseConfig& config, Log* log) : config_(config), log_(log) {}

  // Drops (with a warning) samples that are not after the last one, not finite, or saturated.
  void add(const ImuSample& sample);

  // Samples over [from, to] with interpolated ones at both ends, for preintegration. Across holes
  // of up to max_gap_s the samples are joined linearly, or held at the ends. Empty if a longer hole
  // (or the beginning or end of the data) lies in between.
  [[nodiscard]] std::vector<InertialSample> slice(TimeNs from, TimeNs to) const;
  // The same from `from` as far as the samples reach without a hole, at most to `to`; empty if they
  // do not reach `from`. back().stamp says how far.
  [[nodiscard]] std::vector<InertialSample> slice_available(TimeNs from, TimeNs to) const;

  // All samples kept with stamps in [from, to].
  [[nodiscard]] std::vector<InertialSample> samples(TimeNs from, TimeNs to) const;

  // Forgets what is not needed for slices from `stamp` on.
  void forget_before(TimeNs stamp);

  [[nodiscard]] bool empty() const { return samples_.empty(); }
  [[nodiscard]] bool ever_filled() const { return last_stamp_.has_value(); }

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  [[nodiscard]] bool acceptable(const ImuSample& sample);
  [[nodiscard]] TimeNs max_gap() const { return from_seconds(config_.max_gap_s); }

  ImuNoiseConfig config_;
  Log* log_;
  std::deque<InertialSample> samples_;
  std::optional<TimeNs> last_stamp_;
};

}  // namespace understory
