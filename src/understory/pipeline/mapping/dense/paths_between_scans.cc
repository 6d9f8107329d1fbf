#include "understory/pipeline/mapping/dense/paths_between_scans.h"

namespace understory {
namespace {

constexpr const char* kImuPathFile = "imu_path.bin";
constexpr const char* kPartialPathFile = "partial_path.bin";

}  // namespace

PathsBetweenScans::PathsBetweenScans(const DenseMappingConfig& config, std::filesystem::path folder)
    : with_imu_(config.imu_rate),
      with_parts_(config.scan_fraction < 1.0),
      folder_(std::move(folder)) {}

void PathsBetweenScans::begin() {
  imu_.reset();
  if (with_imu_) imu_ = std::make_unique<RelativePath>(folder_ / kImuPathFile);
  parts_.reset();
  if (with_parts_) parts_ = std::make_unique<RelativePath>(folder_ / kPartialPathFile);
}

void PathsBetweenScans::sync() {
  if (imu_) imu_->sync();
  if (parts_) parts_->sync();
}

void PathsBetweenScans::list(std::vector<CountedFile>& files) const {
  if (imu_) files.push_back({kImuPathFile, imu_->count()});
  if (parts_) files.push_back({kPartialPathFile, parts_->count()});
}

void PathsBetweenScans::save(BinaryWriter& writer) const {
  if (imu_) writer.put(imu_->count());
  if (parts_) writer.put(parts_->count());
}

void PathsBetweenScans::load(BinaryReader& reader) {
  if (with_imu_)
    imu_ = std::make_unique<RelativePath>(folder_ / kImuPathFile, reader.get<RecordCount>());
  if (with_parts_) {
    parts_ = std::make_unique<RelativePath>(folder_ / kPartialPathFile, reader.get<RecordCount>());
  }
}

}  // namespace understory
