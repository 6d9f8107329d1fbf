#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "understory/geometry/stamped_pose.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// Where the points of a further lidar lie beside those of the first one, by the matches of each.
// Turns count by what they move at a usual range (motion_in_metres).
struct LidarOffset {
  std::size_t lidar = 0;   // 1: the second one
  int probes = 0;          // scans that were looked at
  double apart_m = 0.0;    // root mean square, of the next two together
  double late_s = 0.0;     // that its clock is late by: what changes with the motion
  double late_sd_s = 0.0;  // standard deviation, by how the probes differ
  // What does not change with the motion, by a wrong place on the body. The place is off by more:
  // the map holds the points of both lidars, and draws those of each to itself.
  double misplaced_m = 0.0;
  double misplaced_sd_m = 0.0;

  // Whether these are worth telling, over 5 ms or 1.5 cm, and sure.
  [[nodiscard]] bool clock_is_off() const;
  [[nodiscard]] bool place_is_off() const;
};

// What the probes of one further lidar say together. Its points lie apart by a constant, where its
// place on the body is wrong, and by the motion times the error of its clock.
class LidarOffsetSums {
 public:
  // Both in metres, rotations by what they move at a usual range, in the body's axes.
  //   apart: from the pose by the first lidar's points to that by its own
  //   speed: of the body, per second
  void add(const Vector6d& apart, const Vector6d& speed);
  // Nothing before there are enough probes.
  [[nodiscard]] std::optional<LidarOffset> offset(std::size_t lidar) const;

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  int probes_ = 0;
  Vector6d apart_ = Vector6d::Zero();  // sums of these, their squares and products
  Vector6d speed_ = Vector6d::Zero();
  Vector6d apart_squares_ = Vector6d::Zero();
  Vector6d speed_squares_ = Vector6d::Zero();
  Vector6d products_ = Vector6d::Zero();
};

// Compares the lidars of one machine, now and then, while it moves: the points of each are matched
// to the local map by themselves. Not thread-safe.
class LidarAgreement {
 public:
  static constexpr int kEvery = 5;

  // Whether a scan of several lidars, matched at this pose, is to be looked at. Each scan once, in
  // order of time.
  [[nodiscard]] bool wants(const StampedPose& matched);
  // `poses`: of the scan by the points of each lidar alone, the first one's first; nothing where
  // they gave none.
  void add(const std::vector<std::optional<Pose>>& poses);
  // A scan without a match.
  void interrupt() { last_.reset(); }
  void move_world(const Pose& new_world_from_old_world);

  // That of the lidar which lies farthest off; nothing before enough scans were looked at.
  [[nodiscard]] std::optional<LidarOffset> worst() const;

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  std::optional<StampedPose> last_;  // of the scan before
  Vector6d speed_ = Vector6d::Zero();
  int since_probe_ = 0;
  std::vector<LidarOffsetSums> further_;
};

}  // namespace understory
