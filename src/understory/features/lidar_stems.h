#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "understory/features/stem_segments.h"
#include "understory/sensor/rig.h"
#include "understory/sensor/scan.h"
#include "understory/sensor/stem_view.h"

namespace understory {

// The stems that one lidar of a machine sees, in its own frame.
struct LidarStems {
  Pose body_from_lidar;
  StemSegments found;
};

// The stems of a scan, lidar by lidar: rings of different lidars lie in no common row. `config.up`
// is given in the frame of the first lidar; `use` as in `find_stem_segments`.
[[nodiscard]] std::vector<LidarStems> find_stems_of_lidars(
    const Scan& scan, const Rig& rig, const StemSegmentConfig& config,
    const std::vector<std::uint8_t>& use = {});

// Up in the frame of the first lidar, by the lidar that sees most stems; `given` where none does.
[[nodiscard]] Eigen::Vector3d up_by_stems(const std::vector<LidarStems>& lidars,
                                          const Eigen::Vector3d& given);

// Whether the rings of each lidar with points are level (has_level_rings).
[[nodiscard]] bool all_have_level_rings(const Scan& scan, const Rig& rig);

// Leaves of stems that stand in the same place the one whose place is surest: a stem that two
// lidars see counts once. `from` is the number of the first stem of each lidar, in order; nothing
// happens for one lidar. Body frame.
void drop_double_stems(const std::vector<std::size_t>& from, std::vector<Stem>& stems);

}  // namespace understory
