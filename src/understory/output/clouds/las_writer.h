#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>

#include "understory/output/clouds/las_stream.h"
#include "understory/util/progress.h"
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

// Whether a point has room in a file: it is near enough to the offset.
[[nodiscard]] bool has_room(const LasOptions& options, const Eigen::Vector3d& point);

// LAS 1.4, point format 6, compressed where the path ends in .laz. Points are handed over one after
// another and not held; with LasOptions::copc they wait on disk for the octree (copc_writer.h).
// The files appear with `commit`, which can be stopped. Not thread-safe.
class LasWriter {
 public:
  LasWriter(const std::filesystem::path& path, const LasOptions& options);
  ~LasWriter();
  LasWriter(const LasWriter&) = delete;
  LasWriter& operator=(const LasWriter&) = delete;

  void add(const LasRecord& point);
  void commit(const ProgressSink& progress = {});
  [[nodiscard]] std::uint64_t points() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace understory
