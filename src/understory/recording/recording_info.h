#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "understory/recording/recording.h"

namespace understory {

// What `understory info` says of a recording.
struct RecordingInfo {
  struct Lidar {
    std::uint64_t scans = 0;
    std::uint64_t points = 0;
    std::uint64_t scans_without_point_times = 0;
    std::uint64_t empty_scans = 0;
    std::uint64_t outages = 0;     // gaps of more than 2.5 scans
    double rate_hz = 0.0;          // by the median step between scans of the start
    double scan_duration_s = 0.0;  // longest time between first and last point
    double longest_gap_s = 0.0;
    std::uint64_t backward_steps = 0;
    std::uint64_t duplicates = 0;
    int ring_count = 0;
    double nearest_m = 0.0;
    double farthest_m = 0.0;
    TimeNs first = 0;
    TimeNs last = 0;  // end of the last scan
  };
  struct Imu {
    std::uint64_t samples = 0;
    double rate_hz = 0.0;  // samples over their time
    double longest_gap_s = 0.0;
    std::uint64_t backward_steps = 0;
    std::uint64_t duplicates = 0;
    double mean_specific_force_m_s2 = 0.0;  // mean of norms
    double mean_angular_rate_rad_s = 0.0;   // mean of norms
    double highest_angular_rate_rad_s = 0.0;
    std::string gravity;                                   // "included", "missing", "unclear"
    Eigen::Vector3d up_in_imu = Eigen::Vector3d::Zero();   // mean specific force, unit length
    Eigen::Vector3d up_in_body = Eigen::Vector3d::Zero();  // zero if the IMU's place is unknown
    bool has_orientation = false;
    // How the gyroscope's axes have to be taken for its turns to agree with the accelerometer's
    // tilts. "x y z": they agree as they are; empty: the motion does not tell.
    std::string gyroscope_axes;
    TimeNs first = 0;
    TimeNs last = 0;
  };
  struct Gnss {
    std::uint64_t fixes = 0;
    std::uint64_t valid = 0;     // quality above 0
    std::uint64_t headings = 0;  // of them with one of a second antenna
    double rate_hz = 0.0;
    int best_quality = 0;
    TimeNs first = 0;
    TimeNs last = 0;
  };

  std::string path;
  std::string format;
  double duration_s = 0.0;
  Rig rig;
  std::vector<TopicReport> topics;
  Lidar lidar;
  Imu imu;
  Gnss gnss;
  std::uint64_t mag_samples = 0;
  std::vector<std::string> warnings;  // what would spoil a run
  bool complete = true;               // false: stopped before the end
  bool one_cloud = false;             // a single cloud, as of a plot, not the scans of a way
};

// Gathers the figures of a recording from its events, in one pass and constant memory.
class RecordingSurvey {
 public:
  RecordingSurvey();
  ~RecordingSurvey();
  void add(const Event& event);
  // The figures so far, with the warnings of the reader (`log`) and those that follow from the
  // figures.
  [[nodiscard]] RecordingInfo finish(const std::string& path, const Recording& recording,
                                     const Log& log) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

// Sensors that the extrinsics put more than 10 m from the body's origin or from the lidar, in words
// for the user. Millimetres are then taken for metres, or a place on the earth is given.
[[nodiscard]] std::vector<std::string> long_lever_arms(const Rig& rig);

}  // namespace understory
