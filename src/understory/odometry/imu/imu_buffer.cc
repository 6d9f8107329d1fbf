#include "understory/odometry/imu/imu_buffer.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

namespace understory {
namespace {

bool before(const InertialSample& sample, TimeNs stamp) {
  return sample.stamp < stamp;
}

// Between two samples, or the nearer one held outside of them.
InertialSample interpolate_samples(const InertialSample& a, const InertialSample& b, TimeNs stamp) {
  InertialSample s = a;
  s.stamp = stamp;
  if (b.stamp <= a.stamp) return s;
  const double u =
      std::clamp(to_seconds(stamp - a.stamp) / to_seconds(b.stamp - a.stamp), 0.0, 1.0);
  for (int i = 0; i < 3; ++i) {
    s.gyro[i] += u * (b.gyro[i] - a.gyro[i]);
    s.accel[i] += u * (b.accel[i] - a.accel[i]);
  }
  return s;
}

}  // namespace

SampleDefect defect_of(const ImuSample& sample, const ImuNoiseConfig& config) {
  if (!sample.angular_rate.allFinite() || !sample.specific_force.allFinite())
    return SampleDefect::kNotFinite;
  const double range = config.gyro_range_deg_s * std::numbers::pi / 180.0;
  // No sensor tells of twice its range.
  if (sample.angular_rate.norm() > 2.0 * range) return SampleDefect::kDegrees;
  if (sample.angular_rate.cwiseAbs().maxCoeff() > range ||
      sample.specific_force.cwiseAbs().maxCoeff() > config.accel_range_m_s2)
    return SampleDefect::kSaturated;
  return SampleDefect::kNone;
}

bool ImuBuffer::acceptable(const ImuSample& sample) {
  const std::string at = " at " + format_seconds(sample.stamp) + " s";
  const auto warn = [&](const std::string& key, const std::string& message) {
    if (log_ != nullptr) log_->warn(key, message + at);
    return false;
  };
  switch (defect_of(sample, config_)) {
    case SampleDefect::kNone:
      break;
    case SampleDefect::kNotFinite:
      return warn("imu.not_finite", "IMU sample that is not a number dropped");
    case SampleDefect::kDegrees:
      return warn("imu.degrees",
                  "IMU sample with an angular rate of " +
                      std::to_string(std::lround(sample.angular_rate.norm())) +
                      " rad/s dropped: probably degrees per second where rad/s are expected");
    case SampleDefect::kSaturated:
      return warn("imu.saturated", "IMU sample beyond the range of the sensor dropped");
  }
  if (last_stamp_ && sample.stamp == *last_stamp_)
    return warn("imu.duplicate", "IMU sample with a repeated stamp dropped");
  if (last_stamp_ && sample.stamp < *last_stamp_)
    return warn("imu.out_of_order", "IMU sample out of order dropped");
  return true;
}

void ImuBuffer::add(const ImuSample& sample) {
  if (!acceptable(sample)) return;
  InertialSample kept;
  kept.stamp = sample.stamp;
  for (int i = 0; i < 3; ++i) {
    kept.gyro[i] = sample.angular_rate[i];
    kept.accel[i] = sample.specific_force[i];
  }
  samples_.push_back(kept);
  last_stamp_ = sample.stamp;
}

std::vector<InertialSample> ImuBuffer::slice_available(TimeNs from, TimeNs to) const {
  std::vector<InertialSample> slice;
  if (samples_.empty() || to <= from) return slice;
  auto next = std::lower_bound(samples_.begin(), samples_.end(), from, before);
  // The sample before `from`, or the first one, held.
  auto last = next == samples_.begin() ? next : next - 1;
  if (next == samples_.begin() && next->stamp - from > max_gap()) return slice;
  if (next == samples_.end()) {
    if (from - last->stamp >= max_gap()) return slice;
    slice.push_back(interpolate_samples(*last, *last, from));
    slice.push_back(interpolate_samples(*last, *last, std::min(to, last->stamp + max_gap())));
    return slice;
  }
  if (next->stamp - last->stamp > max_gap()) return slice;
  slice.push_back(interpolate_samples(*last, *next, from));
  for (; next != samples_.end() && next->stamp < to; ++next) {
    if (next->stamp - last->stamp > max_gap()) return slice;
    if (next->stamp > from) slice.push_back(*next);
    last = next;
  }
  if (next == samples_.end()) {
    const TimeNs end = std::min(to, last->stamp + max_gap());
    if (end > slice.back().stamp) slice.push_back(interpolate_samples(*last, *last, end));
  } else if (next->stamp - last->stamp <= max_gap()) {
    slice.push_back(interpolate_samples(*last, *next, to));
  }
  return slice;
}

std::vector<InertialSample> ImuBuffer::slice(TimeNs from, TimeNs to) const {
  std::vector<InertialSample> slice = slice_available(from, to);
  if (slice.size() < 2 || slice.back().stamp < to) slice.clear();
  return slice;
}

std::vector<InertialSample> ImuBuffer::samples(TimeNs from, TimeNs to) const {
  std::vector<InertialSample> found;
  auto it = std::lower_bound(samples_.begin(), samples_.end(), from, before);
  for (; it != samples_.end() && it->stamp <= to; ++it)
    found.push_back(*it);
  return found;
}

void ImuBuffer::forget_before(TimeNs stamp) {
  while (samples_.size() >= 2 && samples_[1].stamp <= stamp)
    samples_.pop_front();
}

void ImuBuffer::save(BinaryWriter& writer) const {
  writer.put(std::vector<InertialSample>(samples_.begin(), samples_.end()));
  writer.put(last_stamp_.has_value());
  writer.put(last_stamp_.value_or(0));
}

void ImuBuffer::load(BinaryReader& reader) {
  const auto samples = reader.get_vector<InertialSample>();
  samples_.assign(samples.begin(), samples.end());
  const bool filled = reader.get<bool>();
  const auto stamp = reader.get<TimeNs>();
  last_stamp_ = filled ? std::optional<TimeNs>(stamp) : std::nullopt;
}

}  // namespace understory
