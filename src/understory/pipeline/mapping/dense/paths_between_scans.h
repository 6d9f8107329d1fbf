#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "understory/pipeline/mapping/dense/dense_mapping_config.h"
#include "understory/pipeline/run_folder/relative_path.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/files/record_file.h"

namespace understory {

// Poses between scans, as they were known then. Predictions come at the rate of the IMU (P4 F2),
// estimates from parts of a revolution (P4, discussion). Not thread-safe.
class PathsBetweenScans {
 public:
  PathsBetweenScans(const DenseMappingConfig& config, std::filesystem::path folder);
  // Empty files.
  void begin();

  // A prediction for each sample of the IMU; null without `imu_rate`.
  [[nodiscard]] RelativePath* imu() { return imu_.get(); }
  // A pose for each part of each scan but the first; null with `scan_fraction` 1.
  [[nodiscard]] RelativePath* parts() { return parts_.get(); }

  void sync();
  void list(std::vector<CountedFile>& files) const;
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  bool with_imu_ = false;
  bool with_parts_ = false;
  std::filesystem::path folder_;
  std::unique_ptr<RelativePath> imu_;
  std::unique_ptr<RelativePath> parts_;
};

}  // namespace understory
