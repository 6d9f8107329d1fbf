#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <string>

#include "understory/recording/bags/byte_source.h"
#include "understory/util/log.h"

namespace understory {

// What the header of a LAS or LAZ file tells.
struct LasHeader {
  int version_minor = 0;
  int point_format = 0;
  bool compressed = false;
  bool has_gps_time = false;
  bool gps_week_time = false;    // times count from the beginning of a week
  bool of_this_program = false;  // by its system identifier
  bool has_trees = false;        // points have tree_id and HeightAboveGround, see LasWriter
  std::uint64_t points = 0;
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  Eigen::Vector3d low = Eigen::Vector3d::Zero();  // bounding box as the header states it
  Eigen::Vector3d high = Eigen::Vector3d::Zero();
  std::string coordinate_system;  // "EPSG:25832", WKT, or empty
  std::uint64_t point_position = 0;
  std::uint32_t record_length = 0;
};

// A point of a LAS or LAZ file.
struct LasPoint {
  Eigen::Vector3d position;  // in the file's coordinate system
  float intensity = 0.0F;
  std::uint8_t classification = 0;
  bool withheld = false;  // marked as not to be used
  double gps_time = 0.0;
  // With LasHeader::has_trees only.
  std::uint32_t tree_id = 0;         // 0: of no tree
  float height_above_ground = 0.0F;  // metres; NaN where the ground is not known
};

// LAS 1.0 to 1.4, point formats 0 to 10. Throws InputError if the header cannot be used.
[[nodiscard]] LasHeader read_las_header(ByteSource& file);

// Calls `visit` for each point that may be used; memory does not depend on their number. Points of
// the classes noise (7, 18) and withheld ones are left out with a warning ("recording.noise").
// Files of this program keep them: it finds its noise anew. Where the points break off there is a
// warning ("recording.damaged"). Throws InputError if there is not one. Returns how many were left
// out as noise or withheld.
std::uint64_t read_las_points(ByteSource& file, const LasHeader& header, Log& log,
                              const std::function<void(const LasPoint&)>& visit);
// Throws InputError for a file of which read_las_points left all points out.
void refuse_all_noise(const ByteSource& file, std::uint64_t left_out);

}  // namespace understory
