#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "understory/geometry/stamped_pose.h"
#include "understory/georeference/satellites/fix_covariance.h"
#include "understory/georeference/systems/geodetic.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// How fixes and a path are brought together by time.
struct PairingConfig {
  // Where the antenna is in the body frame, metres.
  Eigen::Vector3d antenna_in_body = Eigen::Vector3d::Zero();
  // And the second one, to which the headings of the fixes lead. Not known: they do not count.
  std::optional<Eigen::Vector3d> second_antenna_in_body = {};
  // degrees: of a heading whose receiver does not say how good it is [chosen: a metre apart].
  double heading_sd_deg = 0.5;
  // Added to the stamps of the fixes: negative where the receiver's are late.
  double time_offset_s = 0.0;
  // Fixes of one interval become one pair. The interval is this long at least, and longer where
  // that gives more than `most_pairs` [bound: a path moves little in a second; time].
  double interval_s = 1.0;
  std::size_t most_pairs = 1000;
  FixCovarianceConfig covariance;
};

// The antenna by the path and by the receiver, means over the fixes of one interval. The motion
// that lays the path on the fixes takes the one mean to the other.
struct SatellitePair {
  double time_s = 0.0;  // since the first fix
  Eigen::Vector3d antenna_in_world = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_in_world = Eigen::Vector3d::Zero();  // of the antenna, m/s
  Eigen::Vector3d fix_in_enu = Eigen::Vector3d::Zero();
  bool has_height = false;  // all its fixes have one; else z of the fix is no measurement
  // By the second antenna: the turn about up from the world to east, north, up, and its standard
  // deviation, rad. NaN: no fix of the interval has a heading.
  double turn_rad = std::numeric_limits<double>::quiet_NaN();
  double turn_sd_rad = std::numeric_limits<double>::quiet_NaN();
  // Mean covariance that the fixes state: errors within an interval are nearly the same.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  std::size_t fixes = 0;
};

// The fixes of one interval, which become a pair.
class GatheredPair {
 public:
  // `one`: a pair of a single fix.
  void add(const SatellitePair& one) { singles_.push_back(one); }
  // The mean of those that agree with the others; there is a fix at least. Of three and more, one
  // is left out that is far from the median of them, farther than the antenna moved meanwhile.
  [[nodiscard]] SatellitePair mean() const;
  [[nodiscard]] std::size_t fixes() const { return singles_.size(); }
  [[nodiscard]] double begin_s() const { return singles_.front().time_s; }  // there is a fix
  // Of each fix, in the order they came: 1 if it is left out.
  [[nodiscard]] std::vector<char> left_out() const;

  // The state, bit for bit.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  std::vector<SatellitePair> singles_;
};

// The turn about up from the world to east, north, up by the heading of a fix, rad, -pi to pi.
// `baseline_in_world` leads from the antenna to the second one, any length. NaN where the fix has
// no heading or the baseline is upright.
[[nodiscard]] double turn_by_heading(const GnssFix& fix, const Eigen::Vector3d& baseline_in_world);
// How good a heading is, rad: as the receiver states, else `heading_sd_deg`.
[[nodiscard]] double turn_sd_rad(const GnssFix& fix, double heading_sd_deg);

// All pairs of a run, in order of time. Frame east, north, up at the first fix that is not far from
// most others.
struct SatellitePairs {
  std::optional<GeodeticPlace> origin;
  std::vector<SatellitePair> pairs;
  TimeNs first_fix = 0;           // where `time_s` of the pairs counts from
  std::size_t fixes_in_time = 0;  // that have a place of the antenna
  std::set<TimeNs> left_out;      // stamps of fixes that contradict others of their second
  std::string reason;             // why there are none, for a person
};

// Where the antenna was at a time, world frame, linear between poses. Nothing outside of the path
// or where poses are more than two seconds apart. `trajectory` is in order of time.
[[nodiscard]] std::optional<Eigen::Vector3d> antenna_place(
    const std::vector<StampedPose>& trajectory, const Eigen::Vector3d& antenna_in_body,
    TimeNs stamp);

// Fixes without a place on the globe are passed over. Deterministic; thread-safe.
[[nodiscard]] SatellitePairs pair_by_time(const std::vector<StampedPose>& trajectory,
                                          const std::vector<GnssFix>& fixes,
                                          const PairingConfig& config);

// The pairs that have a height.
[[nodiscard]] std::vector<SatellitePair> with_height(const std::vector<SatellitePair>& pairs);
// Those where most have one; else all of them, and no height counts.
[[nodiscard]] std::vector<SatellitePair> of_one_kind(const std::vector<SatellitePair>& pairs);

// Diagonal of the box around the antenna's places in the plane, metres.
[[nodiscard]] double plane_extent_m(const std::vector<SatellitePair>& pairs);

}  // namespace understory
