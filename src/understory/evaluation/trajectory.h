#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <vector>

#include "understory/geometry/stamped_pose.h"

namespace understory {

// Poses in ascending order of time.
using Trajectory = std::vector<StampedPose>;

// Reads a TUM trajectory, `timestamp_s x y z qx qy qz qw`: separated by blanks, tabs or commas,
// comments (#, %) and empty lines passed over, plain or gzip. That of a run in north, east,
// down is turned back (world_frame.h). Times keep every nanosecond that is written. Poses out of
// order are sorted by time. Throws InputError with the line where one is not eight finite numbers
// or the quaternion is zero, and if there is no pose at all.
[[nodiscard]] Trajectory read_trajectory(const std::filesystem::path& path);

// The velocity of the body at one time, in the world frame.
struct StampedVelocity {
  TimeNs stamp = 0;
  Eigen::Vector3d velocity_in_world = Eigen::Vector3d::Zero();  // m/s
};

// Reads the columns `timestamp,vx,vy,vz` of a CSV table (states.csv.gz, velocity.csv), plain or
// gzip, sorted by time, turned back as by `read_trajectory`. Rows with an empty or non-finite
// velocity are passed over. Throws InputError where a column is missing or a cell is no number.
[[nodiscard]] std::vector<StampedVelocity> read_velocities(const std::filesystem::path& path);

// Where a reference instrument saw a prism on the carrier.
struct StampedPoint {
  TimeNs stamp = 0;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  // metres
};

// Reads the columns `timestamp,x,y,z` of a CSV table, plain or gzip, sorted by time. Throws
// InputError where a column is missing or a cell is no number, and if there is no row.
[[nodiscard]] std::vector<StampedPoint> read_points(const std::filesystem::path& path);

// Length of the path in metres through poses[first..last].
[[nodiscard]] double path_length(const Trajectory& poses, std::size_t first, std::size_t last);

}  // namespace understory
