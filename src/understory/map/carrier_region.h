#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/geometry/stamped_pose.h"
#include "understory/map/keyframes/keyframe_clouds.h"
#include "understory/map/keyframes/keyframe_map.h"
#include "understory/util/config/config.h"
#include "understory/util/progress.h"

namespace understory {

// Which points of the finished map are of what carries the lidar.
struct CarrierSearchConfig {
  double reach_m = 3.0;  // from the lidar, at most 10; 0: none is looked for
  double share = 0.5;    // of the clouds that show a part of the carrier at one place, 0..1
};
void describe(ConfigTable& table, CarrierSearchConfig& config);

// The places of a cloud's points in the body frame as the body stood when each was measured. A
// deskewed cloud has them at its stamp, where parts of the carrier are smeared by the motion.
class PlacesAsMeasured {
 public:
  // `path`: in order of time, not empty. Times after its end go on as the last two poses do.
  PlacesAsMeasured(const KeyframeCloud& cloud, std::span<const StampedPose> path);
  [[nodiscard]] Eigen::Vector3d operator()(const KeyframePoint& point) const {
    return then_from_body_[point.t_10us / kStep10us] *
           Eigen::Vector3f(point.x, point.y, point.z).cast<double>();
  }

 private:
  static constexpr std::uint16_t kStep10us = 200;
  std::vector<Pose> then_from_body_;  // by steps of the time since the cloud's stamp
};

// The space that the carrier fills, in the body frame: voxels of 0.2 m around the lidar.
class CarrierRegion {
 public:
  CarrierRegion() = default;  // nothing
  // `filled`: one entry a voxel, x slowest, z fastest; a cube of them around `centre_in_body`.
  CarrierRegion(const Eigen::Vector3d& centre_in_body, double reach_m,
                std::vector<std::uint8_t> filled);

  [[nodiscard]] bool empty() const { return filled_.empty(); }
  // `place_in_body`: metres, in the body frame as the body stood when the point was measured.
  [[nodiscard]] bool holds(const Eigen::Vector3d& place_in_body) const;

 private:
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  double reach_m_ = 0.0;
  int edge_ = 0;
  std::vector<std::uint8_t> filled_;
};

// Finds the carrier in the clouds of a finished run: what stays at one place in the body frame and
// at none in the world. Clouds are taken at places 0.5 m apart, 60 at most. A voxel of the body
// frame stays if `share` of them have points in it. It is of the carrier if other clouds show
// nothing where most of these points lie in the world. Ground, walls and trunks beside a path are
// shown from elsewhere. Empty where the body did not move by 4 m, or no such voxel is found.
// `lidar_in_body`: metres. Throws InputError where the file of the clouds is damaged.
[[nodiscard]] CarrierRegion find_carrier(const KeyframeClouds& clouds,
                                         const std::vector<Keyframe>& keyframes,
                                         std::span<const StampedPose> path,
                                         const Eigen::Vector3d& lidar_in_body,
                                         const CarrierSearchConfig& config,
                                         const ProgressSink& progress);

}  // namespace understory
