#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/georeference/satellites/receiver_noise.h"
#include "understory/georeference/satellites/satellite_pairs.h"
#include "understory/georeference/satellites/second_antenna.h"

namespace understory {

// What holds a run's up.
enum class LevelledBy {
  kNothing,
  kStems,    // the mean direction of the stems
  kGravity,  // an IMU, or a place on the earth
};
// How straight a path is: the length of the mean of the body's headings, 0 to 1. 0: it turned
// through all headings alike, or the path is empty. 1: it kept its heading.
[[nodiscard]] double straightness(const std::vector<StampedPose>& path);
// How far its up may be off gravity, degrees, one standard deviation about each level axis. By an
// IMU 0.05 where the carrier turned, and 0.25 where it kept its heading: then nothing tells a tilt
// from the accelerometer's bias [tuned: docs/method/georeference.md]. By stems 1.0 [chosen: six
// simulated runs of three stands, seeds 3 and 7, are off by 0.11; the trees of a slope may lean
// alike]. By nothing 5.0 [chosen: a lidar that is carried by hand].
[[nodiscard]] double tilt_sd_deg(LevelledBy what, double straightness);

// A fit of each degree of freedom to what knows it best (P4 section 5.3 and its future work).
struct SplitFitConfig {
  double tilt_sd_deg = 0.05;  // of the run's up, see LevelledBy
  // A pair counts as at most that many times as good or as bad as the median says [chosen].
  double most_scale = 10.0;
  // How far the receiver's clock may be off beyond what is known; 0 holds it.
  double time_offset_sd_s = 0.0;
  SecondAntennaConfig second_antenna;
  // Pairs that lie far off the others get a larger error.
  bool robust = true;
  // Errors in the plane and in height before the fixes are looked at [tuned: the four GNSS presets
  // of docs/method/georeference.md, seeds up to 19].
  ReceiverPriorConfig plane;
  ReceiverPriorConfig height;
};

// The headings of a second antenna, and what became of them.
struct UsedHeadings {
  TurnByHeadings turn;
  bool used = false;  // false: they contradict the positions
  // By them minus by the positions alone, rad, and its standard deviation; NaN where the path spans
  // too little for positions to tell a heading.
  double off_rad = std::numeric_limits<double>::quiet_NaN();
  double off_sd_rad = std::numeric_limits<double>::quiet_NaN();
};

// The motion that lays a run on its fixes and what is known of the receiver's errors.
struct SplitFit {
  bool found = false;
  std::string reason;  // if not
  Pose enu_from_world;
  // The middle of the path, target frame. `spread` is the covariance of a small turn about the
  // east, north and up axes through it (rad), then a shift east, north, up (m).
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  Matrix6d spread = Matrix6d::Zero();
  bool height_known = false;   // false: no fix has a height, and that of the run is kept
  double time_offset_s = 0.0;  // beyond that of the pairs
  double time_offset_sd_s = 0.0;
  NoisyTimes plane_times;  // as used, with the extra errors of what lies far off
  NoisyTimes height_times;
  NoiseBelief plane_noise;
  NoiseBelief height_noise;
  std::vector<char> far_off;             // of each pair: 1 if it hardly counts
  std::optional<UsedHeadings> headings;  // nothing: fewer than three pairs have one
};

// Heading and place come from the positions in the plane and the headings of a second antenna.
// Height and tilt come from the heights, and from how level the run's world is. The errors of the
// fixes are correlated in time, and their size is estimated along (`estimate_under_noise`).
// Headings that contradict the positions are left out. `pairs` all have heights or none counts. Not
// found for fewer than three pairs, or where the path spans less than five metres and there are no
// headings. Deterministic; thread-safe.
[[nodiscard]] SplitFit fit_split(const std::vector<SatellitePair>& pairs,
                                 const SplitFitConfig& config);

// Covariance of a right perturbation of `target_from_source` (rotation first), from that of a turn
// about the target's axes and a shift (rotation first). The turn is through `middle`. The other
// function leads back.
[[nodiscard]] Matrix6d right_from_spread(const Matrix6d& spread, const Pose& target_from_source,
                                         const Eigen::Vector3d& middle);
[[nodiscard]] Matrix6d spread_from_right(const Matrix6d& covariance, const Pose& target_from_source,
                                         const Eigen::Vector3d& middle);

// Root mean square over places (target frame) of the error that a spread makes one expect, metres.
[[nodiscard]] double expected_error_m(const Matrix6d& spread, const Eigen::Vector3d& middle,
                                      const std::vector<Eigen::Vector3d>& places);

}  // namespace understory
