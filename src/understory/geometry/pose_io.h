#pragma once

#include "understory/geometry/pose.h"
#include "understory/util/binary_io.h"

namespace understory {

// A pose in a checkpoint, bit for bit: the quaternion is not normalised again on reading.
inline void put_pose(BinaryWriter& writer, const Pose& pose) {
  writer.put_doubles(pose.rotation().coeffs().data(), 4);
  writer.put_doubles(pose.translation().data(), 3);
}

[[nodiscard]] inline Pose get_pose(BinaryReader& reader) {
  Eigen::Quaterniond rotation;
  Eigen::Vector3d translation;
  reader.get_doubles(rotation.coeffs().data(), 4);
  reader.get_doubles(translation.data(), 3);
  return Pose::from_unit(rotation, translation);
}

}  // namespace understory
