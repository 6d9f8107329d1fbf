#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <limits>

#include "understory/georeference/satellites/online_georeference.h"
#include "understory/util/files/atomic_file.h"

namespace understory {

// The body on the globe at one scan, and its place in a coordinate system, x east and y north.
struct GlobalRow {
  GlobalPose pose;
  Eigen::Vector2d grid = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
};

// Writes global.csv.gz (docs/reference/outputs.md), one row a scan. The file appears whole at
// `commit` or not at all; OutputError where it cannot be written.
class GlobalWriter {
 public:
  explicit GlobalWriter(const std::filesystem::path& path);
  void add(const GlobalRow& row);
  void commit() { file_.commit(); }

 private:
  AtomicTextFile file_;
};

}  // namespace understory
