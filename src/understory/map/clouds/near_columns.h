#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <unordered_map>

#include "understory/geometry/pose.h"
#include "understory/map/keyframes/keyframe_clouds.h"

namespace understory {

// Columns of the world that clouds show from near. A far view of such a column adds little to it,
// and blurs it by what the path errs between both. Ours: no paper names it.
class NearColumns {
 public:
  // `near_m`: points that lie nearer to the body's origin count, above 0.
  explicit NearColumns(double near_m) : near_m_(near_m) {}

  void add(const KeyframeCloud& cloud, const Pose& world_from_body);
  // Is the column at `place` seen well from near? World frame, metres.
  [[nodiscard]] bool hold(const Eigen::Vector3d& place) const;

 private:
  [[nodiscard]] static std::uint64_t column_of(const Eigen::Vector3d& place);

  double near_m_;
  std::unordered_map<std::uint64_t, std::uint32_t> points_;  // of those looked at, by column
};

}  // namespace understory
