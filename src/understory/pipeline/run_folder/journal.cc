#include "understory/pipeline/run_folder/journal.h"

#include <cstring>

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

Journal::Journal(const std::filesystem::path& path) : file_(path) {}

Journal::Journal(const std::filesystem::path& path, const RecordCount& known)
    : file_(path, known) {}

void Journal::append(const ScanRecord& record) {
  file_.append({bytes_of(record)});
}

void Journal::for_each(const std::function<void(const ScanRecord&)>& visit) const {
  file_.for_each([&](std::uint64_t offset, RecordFile::Bytes bytes) {
    ScanRecord record;
    if (bytes.size() != sizeof(record)) {
      throw InputError(file_.path().string(), "at byte " + std::to_string(offset),
                       "expected the record of a scan");
    }
    std::memcpy(static_cast<void*>(&record), bytes.data(), sizeof(record));
    visit(record);
  });
}

}  // namespace understory
