#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"

namespace understory {

// How an estimate is moved onto the truth before errors are taken. Nothing is moved unless asked.
enum class Alignment {
  kNone,
  kFirst,  // the first pair's poses coincide
  kYaw,    // heading and translation, least squares over the positions: keeps gravity
  kSe3     // rotation and translation, least squares over the positions; never a scale
};

[[nodiscard]] std::string to_string(Alignment alignment);  // "none", "first", "yaw", "se3"
// Throws ConfigError on any other name.
[[nodiscard]] Alignment alignment_from_name(const std::string& name);

// The motion that lays the estimate on the truth, and what is known of it.
struct AlignmentResult {
  Pose target_from_source;
  // False where the points do not fix the motion: rotation errors after it then mean nothing. They
  // lie in one place, or for SE(3) on a line, or so nearly that their noise decides
  // (rotation_sd_deg over 5).
  bool determined = false;
  // How far the rotation itself is off because the pairs do not agree: jackknife over ten parts of
  // the pairs in their order, degrees. NaN where it is unknown (under six pairs).
  double rotation_sd_deg = std::numeric_limits<double>::quiet_NaN();
};

// Least-squares rigid motion that moves `source` onto `target`, pairwise, without scale, closed
// form: Umeyama 1991 eq. 34-43. Same frame and unit as the points. Needs at least one pair.
[[nodiscard]] AlignmentResult align_points_se3(const std::vector<Eigen::Vector3d>& source,
                                               const std::vector<Eigen::Vector3d>& target);

// The same with a rotation about the z axis only, closed form.
[[nodiscard]] AlignmentResult align_points_yaw(const std::vector<Eigen::Vector3d>& source,
                                               const std::vector<Eigen::Vector3d>& target);

// "x +1.200, y -0.310, z +0.020 m, yaw +31.20 deg, 31.25 deg in all": a motion in words.
[[nodiscard]] std::string motion_text(const Pose& target_from_source);
// Its heading: where the x axis is turned to in the plane, degrees from -180 to 180.
[[nodiscard]] double yaw_deg(const Pose& target_from_source);

}  // namespace understory
