#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/recording/bags/byte_source.h"
#include "understory/util/log.h"

namespace understory {

// A number that each point of a scan has, and how it is packed.
struct E57Field {
  enum class Kind { kFloat, kDouble, kInteger, kOther };
  std::string name;  // "cartesianX"
  Kind kind = Kind::kOther;
  std::int64_t least = 0;  // of the integers
  int bits = 0;            // of each of them; 0: all are `least`
  double scale = 1.0;      // value = scale * integer + offset
  double offset = 0.0;
};

// One scan (data3D) of an E57 file.
struct E57Scan {
  std::string name;
  Pose file_from_scan;
  std::uint64_t points = 0;
  std::uint64_t section = 0;  // that holds the points: its physical place
  std::vector<E57Field> fields;

  // Distance of neighbouring numbers of single precision at a place in the frame of the file, m. 0:
  // points are in double precision or scaled.
  [[nodiscard]] double step_at(const Eigen::Vector3d& position) const;
};

// What the XML part of an E57 file tells.
struct E57Header {
  std::vector<E57Scan> scans;
  std::string coordinate_system;             // WKT, or empty
  [[nodiscard]] bool has_intensity() const;  // all scans have it
};

// A point of an E57 file, in the frame of the file.
struct E57Point {
  Eigen::Vector3d position;
  float intensity = 0.0F;  // as the file has it
};

// ASTM E2807 with the codec of bit packs, the only one that the standard defines. Throws InputError
// if the header cannot be used, or no scan has points.
[[nodiscard]] E57Header read_e57_header(ByteSource& file);

// Calls `visit` for each point of each scan, but those that the file marks as invalid. Memory does
// not depend on their number. Where the points of a scan break off there is a warning
// ("recording.damaged"), and the next scan goes on. Throws InputError if there is not one point.
void read_e57_points(ByteSource& file, const E57Header& header, Log& log,
                     const std::function<void(const E57Point&)>& visit);

}  // namespace understory
