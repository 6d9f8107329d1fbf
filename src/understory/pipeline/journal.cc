#include "understory/pipeline/journal.h"

#include "understory/util/error.h"

namespace understory {

Pose ScanRecord::keyframe_from_body() const {
  return Pose::from_unit({rotation[3], rotation[0], rotation[1], rotation[2]},
                         {translation[0], translation[1], translation[2]});
}

void ScanRecord::set_pose(const Pose& keyframe_from_body) {
  const Eigen::Quaterniond& q = keyframe_from_body.rotation();
  rotation = {q.x(), q.y(), q.z(), q.w()};
  Eigen::Map<Eigen::Vector3d>(translation.data()) = keyframe_from_body.translation();
}

Matrix6d ScanRecord::pose_covariance() const {
  Matrix6d matrix;
  std::size_t k = 0;
  for (int i = 0; i < 6; ++i) {
    for (int j = i; j < 6; ++j)
      matrix(i, j) = matrix(j, i) = covariance[k++];
  }
  return matrix;
}

void ScanRecord::set_covariance(const Matrix6d& matrix) {
  std::size_t k = 0;
  for (int i = 0; i < 6; ++i) {
    for (int j = i; j < 6; ++j)
      covariance[k++] = matrix(i, j);
  }
}

Journal::Journal(const std::filesystem::path& path, std::uint64_t keep) : path_(path) {
  auto mode = std::ios::binary | std::ios::trunc;
  if (keep > 0) {
    std::error_code error;
    const std::uint64_t bytes = std::filesystem::file_size(path, error);
    if (error || bytes < keep * sizeof(ScanRecord)) {
      throw InputError(path.string(), "",
                       "holds fewer scans than its checkpoint says (" + std::to_string(keep) + ")");
    }
    std::filesystem::resize_file(path, keep * sizeof(ScanRecord));
    mode = std::ios::binary | std::ios::app;
  }
  size_ = keep;
  file_.open(path, mode);
  if (!file_) throw OutputError(path.string(), "cannot be opened for writing");
}

void Journal::append(const ScanRecord& record) {
  file_.write(reinterpret_cast<const char*>(&record), sizeof(record));
  if (!file_) throw OutputError(path_.string(), "cannot be written (is the disk full?)");
  ++size_;
}

void Journal::flush() {
  file_.flush();
  if (!file_) throw OutputError(path_.string(), "cannot be written (is the disk full?)");
}

void Journal::for_each(const std::function<void(const ScanRecord&)>& visit) const {
  std::ifstream file(path_, std::ios::binary);
  ScanRecord record;
  for (std::uint64_t i = 0; i < size_; ++i) {
    file.read(reinterpret_cast<char*>(&record), sizeof(record));
    if (!file) throw InputError(path_.string(), "record " + std::to_string(i), "ends too early");
    visit(record);
  }
}

}  // namespace understory
