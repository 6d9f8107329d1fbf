#pragma once

#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "understory/forest/inventory.h"
#include "understory/geometry/pose.h"
#include "understory/geometry/stamped_pose.h"
#include "understory/map/keyframes/keyframe_clouds.h"
#include "understory/output/run_summary.h"
#include "understory/sensor/rig.h"

namespace understory {

// How high a lidar looks in each direction, learnt from its returns: a height is none where nobody
// looked at the top.
struct LidarView {
  static constexpr int kSectors = 36;
  Pose body_from_lidar;
  // Elevation of the highest return by azimuth, lidar frame, degrees; NaN where there is none.
  std::array<double, kSectors> highest_deg = no_returns();

  // Places in the body frame as the body stood when each was measured. A place that was moved to
  // the stamp of its scan has another elevation: the body tilts during a scan.
  void add(const std::vector<Eigen::Vector3d>& places);
  // Whether a point in the lidar's frame is in view, or below it.
  [[nodiscard]] bool covers(const Eigen::Vector3d& point_in_lidar) const;

 private:
  [[nodiscard]] static std::array<double, kSectors> no_returns();
};

// From some of the clouds, evenly chosen. `path`: of the body, in order of time; with it the motion
// during each scan is undone. Empty: the clouds are taken as they are.
[[nodiscard]] LidarView learn_view(const KeyframeClouds& clouds, const Pose& body_from_lidar,
                                   std::span<const StampedPose> path);

// Where the lidar was, of the poses, when a place within 60 m was in its view (world frame, about
// one place a metre). Occlusion is not looked at.
[[nodiscard]] Lookouts seen_from(const LidarView& view, const std::vector<Pose>& world_from_body);

// For run.json, and back with the keyframes of the run folder. Empty where the folder does not
// tell.
[[nodiscard]] LidarViewFigures figures_of(const LidarView& view);
[[nodiscard]] Lookouts seen_in_run(const std::filesystem::path& run);

// Where the body of the carrier was at the poses, metres, world frame. The second gives the
// keyframes of a run folder, or nothing where it has none.
[[nodiscard]] std::vector<Eigen::Vector3d> places_of(const std::vector<Pose>& world_from_body);
[[nodiscard]] std::vector<Eigen::Vector3d> places_in_run(const std::filesystem::path& run);

// The beams of a recording's lidar where the setting leaves that to the recording. Several lidars
// are none. The second form takes what run.json tells of the lidar.
[[nodiscard]] BeamConfig beams_in(const BeamConfig& config, const Rig& rig);
[[nodiscard]] BeamConfig beams_in_run(const BeamConfig& config, const std::filesystem::path& run);

// The model as run.json tells it; empty where it is unknown or several lidars were merged.
[[nodiscard]] std::string single_lidar_model(const Rig& rig);

}  // namespace understory
