#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/sensor/rig.h"
#include "understory/sensor/scan.h"

namespace understory {

// A box around a part of the machine that carries the lidar, with at most one degree of freedom. P4
// section 3.3 has body, cabin and boom of a harvester.
struct MachineBox {
  enum class Joint { kFixed, kRevolute, kPrismatic };
  enum class Frame { kBody, kLidar };
  enum class Value { kConstant, kSwept, kSeries };
  struct Sample {
    TimeNs stamp = 0;
    double value = 0.0;
  };

  std::string name;
  Frame frame = Frame::kBody;
  Pose frame_from_box;                               // of the box's centre at joint value 0
  Eigen::Vector3d size_m = Eigen::Vector3d::Ones();  // full edge lengths
  Joint joint = Joint::kFixed;
  Eigen::Vector3d joint_origin = Eigen::Vector3d::Zero();  // a point on the axis, in `frame`
  Eigen::Vector3d joint_axis = Eigen::Vector3d::UnitZ();   // unit, in `frame`
  Value value = Value::kConstant;
  double constant = 0.0;  // rad or m
  double low = 0.0;       // of a sweep: inside at any value in [low, high] counts
  double high = 0.0;
  std::vector<Sample> series;  // sorted by stamp; linear between, held outside
};

// Reads `boxes:` from a YAML file. Each entry has name, frame (body|lidar), center_m [x,y,z],
// rotation_deg [roll,pitch,yaw] and size_m [x,y,z]. It may have joint: {type: revolute|prismatic,
// origin_m, axis, and one of value_deg|value_m, range_deg|range_m [low, high], series: file.csv}. A
// series file has the header `timestamp,value` (seconds; degrees or metres), its path relative to
// the YAML. All problems in one ConfigError; an unreadable series is an InputError.
[[nodiscard]] std::vector<MachineBox> read_machine_boxes(const std::string& path);

// One entry a point of the scan: 0 if it lies in a box, else 1. Tested on the raw scan, because the
// machine moves along with the body: deskewing would smear it. Parallel, thread-safe.
[[nodiscard]] std::vector<std::uint8_t> outside_machine(const Scan& scan, const Rig& rig,
                                                        const std::vector<MachineBox>& boxes);

// Whether a point of the box's own `frame` is inside at the time.
[[nodiscard]] bool inside_box(const MachineBox& box, const Eigen::Vector3d& point_in_frame,
                              TimeNs time);

}  // namespace understory
