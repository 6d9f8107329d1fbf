#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "understory/util/time.h"

namespace understory {

// A point on its way into map.laz.
struct LasRecord {
  double x = 0.0;
  double y = 0.0;
  double z = 0.0;
  TimeNs stamp = 0;
  std::uint16_t intensity = 0;
  std::uint8_t classification = 1;  // LAS: 1 unclassified, 2 ground, 3-5 vegetation
  // Instead of the stamp: the time as another LAS file stores it.
  std::optional<double> gps_time = std::nullopt;
  // With LasOptions::trees only.
  std::uint32_t tree_id = 0;      // 0: of no tree
  float height_above_ground = 0;  // metres; NaN where the ground is not known
};

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
};

// Whether a point has room in a file: it is near enough to the offset.
[[nodiscard]] bool has_room(const LasOptions& options, const Eigen::Vector3d& point);

// LAS 1.4, point format 6, compressed where the path ends in .laz. Points are handed over one after
// another and not held. The file appears with `commit`. Not thread-safe.
class LasWriter {
 public:
  LasWriter(const std::filesystem::path& path, const LasOptions& options);
  ~LasWriter();
  LasWriter(const LasWriter&) = delete;
  LasWriter& operator=(const LasWriter&) = delete;

  void add(const LasRecord& point);
  void commit();
  [[nodiscard]] std::uint64_t points() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace understory
