#pragma once

#include <optional>

#include "understory/geometry/pose.h"
#include "understory/geometry/stamped_pose.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// A pose in a checkpoint, bit for bit: the quaternion is not normalised again on reading.
inline void put_pose(BinaryWriter& writer, const Pose& pose) {
  writer.put_doubles(pose.rotation().coeffs().data(), 4);
  writer.put_doubles(pose.translation().data(), 3);
}

// Reads what put_pose has written. Throws InputError at the end of the bytes.
[[nodiscard]] inline Pose get_pose(BinaryReader& reader) {
  Eigen::Quaterniond rotation;
  Eigen::Vector3d translation;
  reader.get_doubles(rotation.coeffs().data(), 4);
  reader.get_doubles(translation.data(), 3);
  return Pose::from_unit(rotation, translation);
}

// A pose with its time, in the bytes of checkpoints; get_stamped_pose reads it.
inline void put_stamped_pose(BinaryWriter& writer, const StampedPose& pose) {
  writer.put(pose.stamp);
  put_pose(writer, pose.world_from_body);
}

// Reads what put_stamped_pose has written.
[[nodiscard]] inline StampedPose get_stamped_pose(BinaryReader& reader) {
  const auto stamp = reader.get<TimeNs>();
  return {stamp, get_pose(reader)};
}

// What may be there, by the functions for what it is.
template <typename T, typename Put>
void put_optional(BinaryWriter& writer, const std::optional<T>& value, const Put& put) {
  writer.put(value.has_value());
  if (value) put(writer, *value);
}

template <typename Get>
[[nodiscard]] auto get_optional(BinaryReader& reader, const Get& get)
    -> std::optional<decltype(get(reader))> {
  if (!reader.get<bool>()) return std::nullopt;
  return get(reader);
}

}  // namespace understory
