#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "understory/sensor/rig.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/log.h"

namespace understory {

// Fixed transforms between named frames, as /tf_static gives them.
class TransformTree {
 public:
  // The first transform between two frames stays. True if this is it.
  bool add(const std::string& parent, const std::string& child, const Pose& parent_from_child);
  // target_from_source along any chain of transforms, either way; nothing if there is none.
  [[nodiscard]] std::optional<Pose> find(const std::string& target,
                                         const std::string& source) const;
  [[nodiscard]] bool has_frame(const std::string& frame) const { return edges_.count(frame) > 0; }
  [[nodiscard]] bool empty() const { return edges_.empty(); }
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  std::map<std::string, std::map<std::string, Pose>> edges_;  // [a][b] = a_from_b
};

// The frames of the sensors' messages; empty where there is no such sensor.
struct SensorFrames {
  std::string lidar;
  std::string imu;
  std::string gnss;
  std::string second_gnss;  // the antenna that headings lead to; that of `gnss` tells nothing
};

// The rig by the frames: base_link is the body where it is connected to the lidar, else the IMU
// where that is, else the lidar.
[[nodiscard]] Rig rig_from_transforms(const TransformTree& tree, const SensorFrames& frames);

// Puts the places of IMU and antennas that have become known into a rig made by
// `rig_from_transforms`; its body stays. True if there was any.
bool complete_rig(const TransformTree& tree, const SensorFrames& frames, Rig& rig);

// Puts the extrinsics of a YAML file over those of the recording, which has its own body frame:
//     body_frame: base_link
//     lidar_model: VLP-16
//     body_from_lidar: {translation_m: [0, 0, 1.2], rotation_xyzw: [0, 0, 0, 1]}
//     late_s: 0.02
//     body_from_imu: {translation_m: [0, 0, 0], rpy_deg: [0, 0, 90]}
//     body_from_gnss: {translation_m: [0, 0, 2]}
//     body_from_second_gnss: {translation_m: [1, 0, 2]}
// Several lidars stand in a list instead of body_from_lidar and late_s; `lidar_entry` counts its
// entries:
//     lidars:
//       - {topic: /front, body_from_lidar: {translation_m: [1, 0, 2]}, late_s: 0.03}
//       - {topic: /rear, body_from_lidar: {translation_m: [-1, 0, 2], rpy_deg: [0, 0, 180]}}
// A rotation is given as rotation_xyzw, rpy_deg (fixed axes x, y, z) or matrix (nine numbers, row
// by row); without one it is none. Without `body_frame`, or with the recording's body (`body_names`
// are its other names), the places are on that body. Sensors that the file does not name then stay
// where they were. With another `body_frame` they move along: a sensor in the file whose place the
// recording knows too leads from one body to the other. What cannot be moved is dropped, with a
// warning ("recording.extrinsics_body"). Throws ConfigError with all that is wrong, and where
// nothing tells the lidar's place; InputError if the file cannot be read.
void apply_extrinsics_file(const std::string& path, const std::vector<std::string>& body_names,
                           Rig& rig, Log& log, int lidar_entry = 0);

// A lidar as an extrinsics file lists it.
struct ListedLidar {
  std::string topic;    // as --lidar-topic names it
  double late_s = 0.0;  // its stamps less those of the other sensors, for one moment
};
// The list of an extrinsics file, empty where it has none. Throws as `apply_extrinsics_file`.
[[nodiscard]] std::vector<ListedLidar> lidars_of_file(const std::string& path);
// `late_s` of the only lidar of such a file, 0 where it says nothing. Throws as the others.
[[nodiscard]] double lateness_of_file(const std::string& path);

}  // namespace understory
