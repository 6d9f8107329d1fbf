#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "understory/geometry/pose.h"
#include "understory/odometry/dense/dense_odometry.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/time.h"

namespace understory {

// Notices where the position is lost, and tells where a new piece of map had best begin. Not
// thread-safe.
class Recovery {
 public:
  // Lost after so many scans in a row without a match.
  explicit Recovery(int lost_after_scans) : lost_after_scans_(lost_after_scans) {}

  // Whether so much time has passed since the last scan with points that a match may be one by
  // chance.
  [[nodiscard]] bool is_outage(TimeNs stamp) const;
  // After an outage: whether the match finds few of the points that matches found before it. (Right
  // matches after 10 s found 0.87 of that share, wrong ones 0.13.)
  [[nodiscard]] bool lost_over_outage(TimeNs stamp, const DenseEstimate& estimate) const;
  // Unmatched for so long that the prediction is worth nothing, or not even finite any more.
  // `unmatched_in_a_row`: scans before this one.
  [[nodiscard]] bool lost(const DenseEstimate& estimate, std::uint64_t unmatched_in_a_row) const;
  // About where the carrier is by a prediction over an outage; where it was last, if that is worth
  // nothing. World from body.
  [[nodiscard]] Pose place_after_outage(const NavState& predicted) const;

  // After a time when the lidar saw nothing: whether the next scan had better be waited for. That
  // is so where this one, which may see half around, was not matched and the prediction is certain
  // to a metre. No more than five scans are waited for.
  [[nodiscard]] bool waits(const NavState& predicted, const DenseEstimate& estimate);

  // `seen`: it has points, and what to do about it was decided. One that is not is as none for
  // outages: nothing tells whether the prediction still holds.
  void note_scan(TimeNs stamp, bool seen = true);
  // Of a scan whose pose is good.
  void note_good(const DenseEstimate& estimate);
  // The first scan is done again.
  void forget_matches() { last_inliers_ = 0.0; }

  [[nodiscard]] TimeNs last_scan() const { return last_scan_; }  // stamp
  [[nodiscard]] const Pose& last_good() const { return last_good_; }
  [[nodiscard]] const Eigen::Vector3d& last_velocity_in_body() const { return last_velocity_; }

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  int lost_after_scans_;
  Pose last_good_;                                           // of the last scan that was matched
  Eigen::Vector3d last_velocity_ = Eigen::Vector3d::Zero();  // of it, in its body frame
  double last_inliers_ = 0.0;  // share of its points near the map; 0: there was no match
  TimeNs last_scan_ = 0;
  TimeNs last_seen_ = 0;      // stamp of the last scan that had points
  std::uint32_t waited_ = 0;  // scans since the lidar sees again
};

// Puts a new odometry and the estimate of its first scan to a pose: to its position and heading.
// The vertical stays that of the odometry.
void put_at(const Pose& world_from_body, DenseOdometry& odometry, DenseEstimate& estimate);

}  // namespace understory
