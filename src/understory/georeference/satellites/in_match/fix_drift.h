#pragma once

#include <Eigen/Core>
#include <deque>

#include "understory/geometry/pose.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// A fix beside the antenna at the same time.
struct FixAtAntenna {
  Eigen::Vector3d fix_in_world = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();    // as stated, world axes, m^2
  Eigen::Vector3d antenna_in_world = Eigen::Vector3d::Zero();  // by the path
};

// Tells a receiver that drifts by metres while it states centimetres, where its fixes pull at the
// matches (P3 section 5.1). The path follows such fixes, so that it cannot be compared with them.
// Now and then a scan is also matched without the fixes. The difference tells where the path would
// lie without any pull. Fixes of the last hundred metres are compared with that path. Plane and
// height by themselves. World frame, metres. Deterministic; not thread-safe.
class FixDrift {
 public:
  // `heading_sd_rad`: how well the heading of the map was known when it was laid on the globe.
  explicit FixDrift(double heading_sd_rad) : heading_sd_rad_(heading_sd_rad) {}

  // The next pose of the antenna. `loose`: its match did not hold it in every direction.
  void add_pose(const Eigen::Vector3d& antenna_in_world, bool loose);
  // The last scan by its points alone, and with the fixes; the antenna of both.
  void note_pull(const Eigen::Vector3d& alone, const Eigen::Vector3d& pulled);
  // How far the fix has left the path since it could be trusted, metres. 0 where stated errors and
  // those of the odometry explain it. Fixes in order of time.
  [[nodiscard]] double add_fix(const FixAtAntenna& fix);
  // Whether fixes have left the path, and not come back.
  [[nodiscard]] bool left() const { return left_; }
  // The most that one of them was away from the path, metres; 0: none left it.
  [[nodiscard]] double farthest_m() const { return farthest_m_; }

  // `fixes`: how the places of fixes moved in the world; `path`: how the path did.
  void move(const Pose& fixes, const Pose& path);
  // The path begins anew; farthest_m() is of the whole run.
  void clear();

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  // A fix that was trusted, and where the antenna would have been without the pull.
  struct Anchor {
    Eigen::Vector3d fix = Eigen::Vector3d::Zero();
    Eigen::Vector3d antenna = Eigen::Vector3d::Zero();
    Eigen::Vector3d variance = Eigen::Vector3d::Zero();  // of the fix, along each axis, m^2
    double way_m = 0.0;
    double loose_m = 0.0;
  };
  // How far a fix is off, against one anchor: metres, and in standard deviations.
  struct Departure {
    double metres = 0.0;
    double steps = 0.0;
  };

  [[nodiscard]] Departure departure(const Anchor& now, const Anchor& before) const;
  [[nodiscard]] Departure largest_departure(const Anchor& now) const;
  // Against the last `count` anchors.
  [[nodiscard]] Departure usual_departure(const Anchor& now, std::size_t count) const;

  double heading_sd_rad_ = 0.0;
  std::deque<Anchor> anchors_;  // the newest last
  Eigen::Vector3d last_antenna_ = Eigen::Vector3d::Zero();
  bool has_antenna_ = false;
  double way_m_ = 0.0;         // of the antenna
  double loose_m_ = 0.0;       // of that, where matches were loose
  double probed_way_m_ = 0.0;  // at the last scan that was matched alone
  // By how much fixes have moved the path: the local map, and the last scan against it.
  Eigen::Vector3d map_drawn_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d scan_drawn_ = Eigen::Vector3d::Zero();
  bool left_ = false;
  double farthest_m_ = 0.0;
};

}  // namespace understory
