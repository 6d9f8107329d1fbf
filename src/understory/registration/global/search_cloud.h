#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/geometry/voxel_index.h"
#include "understory/registration/global/range_view.h"
#include "understory/registration/global/tilt_and_height.h"
#include "understory/registration/global/uprights.h"
#include "understory/registration/matcher.h"

namespace understory {

// Which points of a voxel grid have a neighbour. One look tells whether a place is within about 0.6
// m of a point of the cloud. Immutable, thread-safe.
class NearGrid {
 public:
  explicit NearGrid(const Points& points);
  [[nodiscard]] bool near(const Eigen::Vector3f& point) const;

 private:
  [[nodiscard]] std::optional<std::size_t> bit_of(const Eigen::Vector3f& point) const;

  Eigen::Vector3f low_ = Eigen::Vector3f::Zero();
  Eigen::Vector3i size_ = Eigen::Vector3i::Zero();
  std::vector<std::uint64_t> bits_;
};

// A cloud made ready to be matched without a guess. Level frame: z up, metres; its origin is that
// of the cloud if one lidar saw it from there, else the middle of the cloud. Immutable for all who
// hold it, thread-safe.
struct SearchCloud {
  std::string trouble;  // why the cloud cannot be matched; empty: it can
  Pose level_from_cloud;
  double up_weight = 0.0;      // see UpEstimate
  Points points;               // one for each voxel of 0.2 m
  std::vector<float> above_m;  // their heights above the ground
  Points plants;               // those that stand above the ground, at most a few thousand
  Points ground;               // those on the ground, at most a few hundred
  double range_m = 0.0;        // mean distance of the points from the origin
  std::vector<Upright> uprights;
  // What tells tilt and height of a cloud of few rings; empty for a dense one.
  bool few_rings = false;
  std::vector<UprightAxis> axes;
  std::vector<Eigen::Vector3d> ground_means;
  std::shared_ptr<const NearGrid> near;
  VoxelIndex voxels;  // those of 0.2 m that hold points, by voxel_key
  // What a lidar at the origin saw; none where the cloud is no single view.
  std::shared_ptr<const RangeView> view;
  MatchTargetPtr target;       // of NDT, coarse to fine, to refine what is found
  MatchTargetPtr fine_target;  // of NDT, small cells, for the last steps
};

// Whether the voxel of 0.2 m around a place of the level frame holds points.
[[nodiscard]] bool holds_points(const SearchCloud& cloud, const Eigen::Vector3f& at);

// Makes a cloud ready. `points`: z about up, within 40 degrees; metres, as they come from the
// sensor or a map. Never throws for odd points: `trouble` says what is wrong with them.
[[nodiscard]] SearchCloud prepare_search(const Points& points);

}  // namespace understory
