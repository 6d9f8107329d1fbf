#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <iosfwd>
#include <memory>
#include <string>

namespace understory {

// How points are written to LAS and LAZ.
struct LasOptions {
  // Written into the header; choose a round number of metres near the data. Coordinates further
  // than 2,147 million steps of `scale` from it (2,147 km) do not fit and are an OutputError.
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  // Step of the stored coordinates, in the units of the coordinate system.
  Eigen::Vector3d scale = Eigen::Vector3d::Constant(0.001);
  bool gps_week_time = false;  // LasRecord::gps_time counts from the beginning of a week
  bool trees = false;          // two more columns: tree_id and HeightAboveGround (as PDAL names it)
  std::string crs_wkt;  // OGC WKT of the coordinate system; empty = local frame, none written
  // Stamps are written as adjusted standard GPS time if they are of this century (Unix time), else
  // as seconds as they are.
  std::string generating_software = "understory";
  // LasWriter: the same points as Cloud Optimized Point Cloud as well, beside NAME.laz as
  // NAME.copc.laz. Only with steps that are the same along all axes.
  bool copc = false;
};

// A point as LAS stores it: coordinates in steps from the offset.
struct LasPointSteps {
  double gps_time = 0.0;
  std::int32_t x = 0;
  std::int32_t y = 0;
  std::int32_t z = 0;
  std::uint32_t tree_id = 0;  // with LasOptions::trees only, as the next
  float height_above_ground = 0.0F;
  std::uint16_t intensity = 0;
  std::uint8_t classification = 1;
};

// One LAS 1.4 file of point format 6 on its way through LASzip into a stream that can seek. The
// compressed points are one chunk where `one_chunk` says so. Failures are OutputErrors that name
// `file`. Not thread-safe; several may work beside each other.
class LasStream {
 public:
  struct Form {
    bool compressed = true;
    bool one_chunk = false;
  };
  LasStream(std::ostream& stream, std::string file, const LasOptions& options, const Form& form);
  ~LasStream();
  LasStream(const LasStream&) = delete;
  LasStream& operator=(const LasStream&) = delete;

  void add(const LasPointSteps& point);
  // Writes what is left, and the counts and bounds of the header.
  void close();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace understory
