#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

class ByteSource;

// A whole point cloud as a file holds it. Coordinates of point i in the file's frame (a coordinate
// system, or the sensor's) are origin + points[i]. The origin in double takes up the large part, so
// floats keep tenths of a millimetre. All other columns are either empty or one per point.
struct PointCloudFile {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3f> points;       // metres, relative to origin; finite
  std::vector<float> intensity;              // as the file has it
  std::vector<std::uint16_t> ring;           // PCD, PLY with a field of rings: laser number
  std::vector<std::uint8_t> classification;  // ASPRS classes, LAS only
  std::vector<double> gps_time;              // LAS: GPS time as stored (week or adjusted standard)
  bool gps_week_time = false;                // LAS: gps_time counts from the beginning of a week
  std::string coordinate_system;             // LAS, E57: "EPSG:25832" or WKT; empty if not given
  std::string format;                        // "LAZ 1.4, point format 6", "PCD binary"
  // Distance of neighbouring numbers at the first point, in which a file of single precision holds
  // its coordinates; 0: it holds them in double precision.
  double step = 0.0;
  double las_step = 0.0;         // LAS: the coarsest step of its three coordinates; else 0
  std::uint64_t not_finite = 0;  // points that were left out: no places (is_place)
};

// Whether this can be a place: finite, and at most 1e10 from zero, which holds the Earth in
// millimetres. Some programs write a number like 1e30 where a beam met nothing.
[[nodiscard]] bool is_place(const Eigen::Vector3d& position);

// The origin of a cloud whose first point lies here: zero, or a round place near it.
[[nodiscard]] Eigen::Vector3d cloud_origin(const Eigen::Vector3d& first);

// What a header says of its cloud: format, coordinate system and times.
struct LasHeader;
[[nodiscard]] PointCloudFile described_by(const LasHeader& header);
struct E57Header;
[[nodiscard]] PointCloudFile described_by(const E57Header& header);

// Whether the name ends like that of a file that can hold a map: .las, .laz, .e57, .ply, .pcd, in
// capital letters, too. (.bin is one scan.)
[[nodiscard]] bool has_map_name(const std::filesystem::path& path);

// From the frame of a file into another, in double precision.
using PlaceChange = std::function<Eigen::Vector3d(const Eigen::Vector3d&)>;

// Reads .las, .laz, .e57, .pcd, .ply or KITTI .bin (told by content, .bin by name). Points that
// are no places (is_place) are left out. A file that breaks off gives the points up to there and a
// warning ("recording.damaged"); throws InputError if no point can be had from it. Of LAS, LAZ and
// E57 each point polls `progress`. With `change`, points and origin are in the frame that it leads
// to.
[[nodiscard]] PointCloudFile read_cloud(const std::string& path, Log& log,
                                        const ProgressSink& progress = {},
                                        const PlaceChange& change = {});
[[nodiscard]] PointCloudFile read_cloud(ByteSource& file, Log& log,
                                        const ProgressSink& progress = {},
                                        const PlaceChange& change = {});

}  // namespace understory
