#include "understory/recording/recording_info.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "understory/recording/imu_axes.h"
#include "understory/util/median.h"

namespace understory {
namespace {

constexpr std::size_t kStepsForRate = 500;
constexpr double kGravity = 9.80665;

std::string format(const char* pattern, double value) {
  char text[160];
  std::snprintf(text, sizeof text, pattern, value);
  return text;
}

// Steps, gaps and disorder of a row of stamps. The newest stamp so far is the measure, so that a
// single one far ahead counts once.
class StampRow {
 public:
  void add(TimeNs stamp) {
    if (count_++ == 0) {
      first_ = last_ = stamp;
    } else if (stamp < previous_) {
      ++backward;
    } else if (stamp == previous_) {
      ++duplicates;
    } else {
      const TimeNs step = stamp - previous_;
      longest_gap = std::max(longest_gap, step);
      if (steps_.size() < kStepsForRate) steps_.push_back(step);
    }
    previous_ = stamp;
    first_ = std::min(first_, stamp);
    last_ = std::max(last_, stamp);
  }
  [[nodiscard]] TimeNs median_step() const { return upper_median(steps_); }
  [[nodiscard]] double rate_hz() const {
    const TimeNs step = median_step();
    return step > 0 ? 1.0 / to_seconds(step) : 0.0;
  }
  [[nodiscard]] TimeNs first() const { return first_; }
  [[nodiscard]] TimeNs last() const { return last_; }

  std::uint64_t backward = 0;
  std::uint64_t duplicates = 0;
  TimeNs longest_gap = 0;

 private:
  std::uint64_t count_ = 0;
  TimeNs first_ = 0;
  TimeNs last_ = 0;
  TimeNs previous_ = 0;
  std::vector<TimeNs> steps_;  // the first ones
};

}  // namespace

class RecordingSurvey::Impl {
 public:
  void operator()(const ScanPtr& scan) {
    RecordingInfo::Lidar& lidar = info_.lidar;
    const TimeNs before = scans_.last();
    const TimeNs step = scans_.median_step();
    scans_.add(scan->stamp);
    ++lidar.scans;
    lidar.points += scan->points.size();
    lidar.ring_count = std::max(lidar.ring_count, scan->ring_count);
    if (scan->points.empty()) ++lidar.empty_scans;
    if (!scan->has_point_times) ++lidar.scans_without_point_times;
    if (lidar.scans > 1 && step > 0 && (scan->stamp - before) / 5 > step / 2) ++lidar.outages;
    const TimeNs end = scan->end();
    lidar.last = lidar.scans == 1 ? end : std::max(lidar.last, end);
    lidar.scan_duration_s = std::max(lidar.scan_duration_s, to_seconds(end - scan->stamp));
    for (std::size_t i = 0; i < scan->points.size(); i += 16) {  // a sample is enough
      const ScanPoint& point = scan->points[i];
      const double range = std::hypot(point.x, point.y, point.z);
      nearest_ = std::min(nearest_, range);
      farthest_ = std::max(farthest_, range);
    }
  }

  void operator()(const ImuSample& sample) {
    RecordingInfo::Imu& imu = info_.imu;
    samples_.add(sample.stamp);
    axes_.add(sample);
    ++imu.samples;
    const double rate = sample.angular_rate.norm();
    force_sum_ += sample.specific_force;
    force_norm_sum_ += sample.specific_force.norm();
    rate_sum_ += rate;
    imu.highest_angular_rate_rad_s = std::max(imu.highest_angular_rate_rad_s, rate);
    imu.has_orientation = imu.has_orientation || sample.orientation.has_value();
  }

  void operator()(const GnssFix& fix) {
    fixes_.add(fix.stamp);
    ++info_.gnss.fixes;
    if (fix.quality > 0) ++info_.gnss.valid;
    if (std::isfinite(fix.heading_deg)) ++info_.gnss.headings;
    info_.gnss.best_quality = std::max(info_.gnss.best_quality, fix.quality);
  }

  void operator()(const MagSample&) { ++info_.mag_samples; }

  [[nodiscard]] RecordingInfo finish(const std::string& path, const Recording& recording,
                                     const Log& log) const {
    RecordingInfo info = info_;
    info.path = path;
    info.format = recording.format();
    info.one_cloud = info.format.starts_with("one cloud");
    info.rig = recording.rig();
    info.topics = recording.topics();
    finish_lidar(info);
    finish_imu(info);
    info.gnss.first = fixes_.first();
    info.gnss.last = fixes_.last();
    info.gnss.rate_hz = fixes_.rate_hz();
    finish_duration(info);
    for (const Log::Warning& warning : log.warnings()) {
      // A cloud of a plot is expected to lie in map coordinates.
      if (info.one_cloud && warning.key == "recording.far_cloud") continue;
      info.warnings.push_back(
          warning.first_message +
          (warning.count > 1 ? " (" + std::to_string(warning.count) + " such)" : "") + " [" +
          warning.key + "]");
    }
    if (info.one_cloud) return info;
    warn_of_lidar(info);
    warn_of_imu(info);
    warn_of_rest(info);
    for (const std::string& arm : long_lever_arms(info.rig))
      info.warnings.push_back(arm);
    return info;
  }

 private:
  void finish_lidar(RecordingInfo& info) const {
    RecordingInfo::Lidar& lidar = info.lidar;
    lidar.rate_hz = scans_.rate_hz();
    lidar.longest_gap_s = to_seconds(scans_.longest_gap);
    lidar.backward_steps = scans_.backward;
    lidar.duplicates = scans_.duplicates;
    lidar.first = scans_.first();
    if (lidar.points > 0) {
      lidar.nearest_m = nearest_;
      lidar.farthest_m = farthest_;
    }
  }

  void finish_imu(RecordingInfo& info) const {
    RecordingInfo::Imu& imu = info.imu;
    if (imu.samples == 0) return;
    const auto count = static_cast<double>(imu.samples);
    imu.rate_hz = samples_.rate_hz();
    imu.longest_gap_s = to_seconds(samples_.longest_gap);
    imu.backward_steps = samples_.backward;
    imu.duplicates = samples_.duplicates;
    imu.first = samples_.first();
    imu.last = samples_.last();
    imu.mean_specific_force_m_s2 = force_norm_sum_ / count;
    imu.mean_angular_rate_rad_s = rate_sum_ / count;
    imu.gyroscope_axes = axes_.result();
    const double mean = imu.mean_specific_force_m_s2;
    imu.gravity = mean > 8.0 && mean < 13.0 ? "included" : mean < 3.0 ? "missing" : "unclear";
    if (imu.gravity == "included" && force_sum_.norm() > 0.0) {
      imu.up_in_imu = force_sum_.normalized();
      if (info.rig.body_from_imu)
        imu.up_in_body = info.rig.body_from_imu->rotation() * imu.up_in_imu;
    }
  }

  static void finish_duration(RecordingInfo& info) {
    TimeNs first = 0;
    TimeNs last = 0;
    bool any = false;
    const auto include = [&](bool there, TimeNs begin, TimeNs end) {
      if (!there) return;
      first = any ? std::min(first, begin) : begin;
      last = any ? std::max(last, end) : end;
      any = true;
    };
    include(info.lidar.scans > 0, info.lidar.first, info.lidar.last);
    include(info.imu.samples > 0, info.imu.first, info.imu.last);
    include(info.gnss.fixes > 0, info.gnss.first, info.gnss.last);
    info.duration_s = to_seconds(last - first);
  }

  static void warn_of_lidar(RecordingInfo& info) {
    const RecordingInfo::Lidar& lidar = info.lidar;
    const auto warn = [&](const std::string& text) { info.warnings.push_back(text); };
    if (lidar.scans == 0) return warn("lidar: there is none; nothing can be mapped");
    if (lidar.scans_without_point_times > 0)
      warn("lidar: " + std::to_string(lidar.scans_without_point_times) + " of " +
           std::to_string(lidar.scans) +
           " scans have no times per point: motion within a scan "
           "cannot be taken out");
    if (lidar.empty_scans > 0)
      warn("lidar: " + std::to_string(lidar.empty_scans) + " scans have no points");
    if (lidar.outages > 0)
      warn("lidar: " + std::to_string(lidar.outages) + " gaps, the longest of " +
           format("%.2f s", lidar.longest_gap_s));
    warn_of_order(info, "lidar", lidar.backward_steps, lidar.duplicates);
    if (lidar.rate_hz > 0.0 && lidar.scan_duration_s > 1.5 / lidar.rate_hz)
      warn("lidar: the points of a scan lie up to " + format("%.3f s", lidar.scan_duration_s) +
           " apart at a rate of " + format("%.1f Hz", lidar.rate_hz) +
           ": their times may be misread");
  }

  static void warn_of_order(RecordingInfo& info, const std::string& what, std::uint64_t backward,
                            std::uint64_t duplicates) {
    if (backward > 0)
      info.warnings.push_back(what + ": time goes back " + std::to_string(backward) + " times");
    if (duplicates > 0)
      info.warnings.push_back(what + ": " + std::to_string(duplicates) +
                              " messages repeat the stamp before");
  }

  void warn_of_imu(RecordingInfo& info) const {
    const RecordingInfo::Imu& imu = info.imu;
    const auto warn = [&](const std::string& text) { info.warnings.push_back(text); };
    if (imu.samples == 0) return warn("imu: there is none; motion is guessed from the scans alone");
    warn_of_order(info, "imu", imu.backward_steps, imu.duplicates);
    if (imu.rate_hz < 50.0 && imu.samples > 10)
      warn("imu: only " + format("%.0f samples per second", imu.rate_hz));
    if (imu.longest_gap_s > 0.1) warn("imu: longest gap " + format("%.2f s", imu.longest_gap_s));
    if (imu.gravity == "missing")
      warn("imu: mean acceleration is " + format("%.2f m/s^2", imu.mean_specific_force_m_s2) +
           ": gravity has been taken out of it; specific force (+9.81 up at rest) is expected");
    if (imu.gravity == "unclear")
      warn("imu: mean acceleration is " + format("%.2f m/s^2", imu.mean_specific_force_m_s2) +
           " where " + format("%.2f", kGravity) + " is expected: wrong unit or scale");
    warn_of_rates(info);
    if (imu.up_in_body.norm() > 0.5 && imu.up_in_body.z() < 0.5)
      warn("imu: up lies along (" + format("%.2f, ", imu.up_in_body.x()) +
           format("%.2f, ", imu.up_in_body.y()) + format("%.2f", imu.up_in_body.z()) + ") of " +
           info.rig.body_frame +
           ", not along z: axes swapped, extrinsics wrong, or the sensor is "
           "mounted on its side");
    if (!info.rig.body_from_imu && info.lidar.scans > 0)
      warn("imu: its place relative to the lidar is unknown");
    warn_of_cover(info);
  }

  void warn_of_rates(RecordingInfo& info) const {
    const RecordingInfo::Imu& imu = info.imu;
    const double scale = axes_.rate_scale();
    const bool fits_degrees = scale > 0.0 && scale < 0.03;
    if (fits_degrees || imu.mean_angular_rate_rad_s > 5.0)
      info.warnings.push_back("imu: mean angular rate is " +
                              format("%.1f", imu.mean_angular_rate_rad_s) +
                              ": probably degrees per second where rad/s are expected");
    if (!imu.gyroscope_axes.empty() && imu.gyroscope_axes != "x y z")
      info.warnings.push_back(
          "imu: gyroscope and accelerometer disagree on the axes: tilts fit if the angular rates "
          "(x y z) are taken as (" +
          imu.gyroscope_axes + ")");
  }

  // Where the scans are, the IMU has to be.
  static void warn_of_cover(RecordingInfo& info) {
    if (info.lidar.scans < 2) return;
    const double late = to_seconds(info.imu.first - info.lidar.first);
    const double early = to_seconds(info.lidar.last - info.imu.last);
    const auto warn = [&](const std::string& text) { info.warnings.push_back(text); };
    if (info.imu.first > info.lidar.last || info.imu.last < info.lidar.first)
      return warn("imu: its times do not overlap with the lidar's (" + format("%.1f s", late) +
                  " between the starts): different clocks");
    if (late > 1.0) warn("imu: starts " + format("%.1f s", late) + " after the lidar");
    if (early > 1.0) warn("imu: stops " + format("%.1f s", early) + " before the lidar");
  }

  void warn_of_rest(RecordingInfo& info) const {
    warn_of_order(info, "gnss", fixes_.backward, fixes_.duplicates);
    if (info.gnss.fixes > 0 && info.gnss.valid == 0)
      info.warnings.push_back("gnss: no fix is valid");
    if (info.gnss.headings > 0 && !(info.rig.body_from_gnss && info.rig.body_from_second_gnss))
      info.warnings.push_back(
          "gnss: the headings of a second antenna are not used: give the places of both antennas, "
          "body_from_gnss and body_from_second_gnss, with --extrinsics FILE");
    for (const TopicReport& topic : info.topics) {
      if (topic.unreadable > 0)
        info.warnings.push_back(topic.name + ": " + std::to_string(topic.unreadable) +
                                " messages could not be read");
      if (topic.not_numbers > 0)
        info.warnings.push_back(topic.name + ": " + std::to_string(topic.not_numbers) + " of " +
                                std::to_string(topic.messages) +
                                " messages measure no numbers (NaN)");
    }
  }

  RecordingInfo info_;
  StampRow scans_;
  StampRow samples_;
  StampRow fixes_;
  ImuAxisCheck axes_;
  Eigen::Vector3d force_sum_ = Eigen::Vector3d::Zero();
  double force_norm_sum_ = 0.0;
  double rate_sum_ = 0.0;
  double nearest_ = 1e9;
  double farthest_ = 0.0;
};

RecordingSurvey::RecordingSurvey() : impl_(std::make_unique<Impl>()) {}
RecordingSurvey::~RecordingSurvey() = default;

void RecordingSurvey::add(const Event& event) {
  std::visit(*impl_, event);
}

RecordingInfo RecordingSurvey::finish(const std::string& path, const Recording& recording,
                                      const Log& log) const {
  return impl_->finish(path, recording, log);
}

std::vector<std::string> long_lever_arms(const Rig& rig) {
  constexpr double kLongestM = 10.0;
  std::vector<std::string> arms;
  const auto look_at = [&](const char* sensor, const std::optional<Pose>& body_from_sensor,
                           const std::string& source) {
    if (!body_from_sensor) return;
    const double arm =
        std::max(body_from_sensor->translation().norm(),
                 (body_from_sensor->translation() - rig.body_from_lidar.translation()).norm());
    if (arm > kLongestM)
      arms.push_back(std::string("the extrinsics (") + source + ") put the " + sensor + " " +
                     format("%.1f m", arm) +
                     " from the body or the lidar: check their unit and frame");
  };
  look_at("lidar", rig.body_from_lidar, rig.lidar_extrinsic_source);
  look_at("IMU", rig.body_from_imu, rig.imu_extrinsic_source);
  look_at("GNSS antenna", rig.body_from_gnss, rig.gnss_extrinsic_source);
  look_at("second GNSS antenna", rig.body_from_second_gnss, rig.second_gnss_extrinsic_source);
  return arms;
}

}  // namespace understory
