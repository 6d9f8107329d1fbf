#pragma once

#include <Eigen/Core>
#include <optional>

#include "understory/geometry/pose.h"
#include "understory/sensor/scan.h"

namespace understory {

// How the carrier is taken to move at the first scan of a recording. Body frame.
struct AssumedMotion {
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular_rate_rad_s = Eigen::Vector3d::Zero();
};

// Whether a recording began within a turn of its lidar. The first scan is then shorter than the
// second or, where points have no times, sees less around it. The next scan then comes so soon that
// a small error between the two is a great speed.
[[nodiscard]] bool is_part_of_turn(const Scan& first, const Scan& second);

// A carrier that is on its way when the recording begins smears its first scan, and the second,
// matched to it, tells the speed. Returns the motion to do both again with. Returns nothing where
// `assumed` smears the first scan by no more than 5 mm at 10 m beside it. So it does where the
// second scan comes half a second later or more and tells nothing of it. `world_from_second` is the
// pose by matching. `rate_is_known`: an IMU tells the turning, which stays as assumed.
[[nodiscard]] std::optional<AssumedMotion> better_start(const Scan& first, const Scan& second,
                                                        const Pose& world_from_first,
                                                        const Pose& world_from_second,
                                                        const AssumedMotion& assumed,
                                                        bool rate_is_known);

}  // namespace understory
