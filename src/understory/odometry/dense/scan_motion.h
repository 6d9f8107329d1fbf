#pragma once

#include <optional>
#include <vector>

#include "understory/geometry/stamped_pose.h"
#include "understory/preprocess/body_cloud.h"
#include "understory/registration/matcher.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// How far the sensor moves within scans, over how far it moves from scan to scan in the same time.
// It is 1 where the times of the points are right, and -1 where they run backwards. It is 0 where
// the points have been deskewed already or all have the same time. It is 0.1 where they say that a
// scan takes ten times as long.
struct ScanMotion {
  int probes = 0;
  double ratio = 0.0;  // by least squares over the probes; 0 before there is one
  double sd = 0.0;     // its standard deviation, by how the probes differ; 0 before there are two
};

// A motion in metres: its rotation by what it moves at a usual range, 10 m.
[[nodiscard]] Vector6d motion_in_metres(Vector6d motion);

// What the probes say together.
class ScanMotionSums {
 public:
  // Motions in a scan's time, rotation (times a usual range) and shift, metres. `between` is not 0.
  void add(const Vector6d& within, const Vector6d& between);
  [[nodiscard]] ScanMotion motion() const;

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  int probes_ = 0;
  double products_ = 0.0;
  double squares_ = 0.0;
  double along_ = 0.0;  // squares of the motions within scans, along those between
};

// Finds out from scans now and then, while the sensor moves. The first and the last pose of a scan
// are matched each by itself (scan_path.h, hardly bound by what was guessed). The motion between
// them is held against that since the scan before. Costs one such match every `kEvery` scans. Not
// thread-safe.
class ScanMotionWatch {
 public:
  static constexpr int kEvery = 30;

  // A scan that was matched, before its path is corrected by anything else.
  //   target: the local map; without a cost nothing is found out
  //   source: deskewed along `guess`, thinned, body frame at its stamp
  //   matched: its pose by the match; duration: from the stamp to the last point
  void add(const MatchTarget& target, const BodyCloud& source,
           const std::vector<StampedPose>& guess, const StampedPose& matched, TimeNs duration);
  // A scan without a match.
  void interrupt() { last_.reset(); }
  void move_world(const Pose& new_world_from_old_world);

  [[nodiscard]] ScanMotion motion() const { return sums_.motion(); }

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  std::optional<StampedPose> last_;  // of the scan before
  int since_probe_ = 0;
  ScanMotionSums sums_;
};

}  // namespace understory
