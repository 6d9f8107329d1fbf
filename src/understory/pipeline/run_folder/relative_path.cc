#include "understory/pipeline/run_folder/relative_path.h"

#include <array>
#include <cstring>

#include "understory/output/run_tables.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr std::size_t kPosesInRecord = 64;

// A pose as it lies in the file.
struct PoseRecord {
  TimeNs stamp = 0;
  std::uint64_t scan = 0;
  std::array<double, 4> rotation{0, 0, 0, 1};  // x y z w
  std::array<double, 3> translation{};
};

PoseRecord record_of(const RelativePose& pose) {
  const Eigen::Quaterniond& q = pose.scan_from_body.rotation();
  const Eigen::Vector3d& t = pose.scan_from_body.translation();
  return {pose.stamp, pose.scan, {q.x(), q.y(), q.z(), q.w()}, {t.x(), t.y(), t.z()}};
}

RelativePose pose_of(const PoseRecord& record) {
  const auto& [x, y, z, w] = record.rotation;
  const auto& [tx, ty, tz] = record.translation;
  return {record.stamp, record.scan, Pose::from_unit({w, x, y, z}, {tx, ty, tz})};
}

}  // namespace

RelativePath::RelativePath(const std::filesystem::path& path) : file_(path) {}

RelativePath::RelativePath(const std::filesystem::path& path, const RecordCount& known)
    : file_(path, known) {}

void RelativePath::add(const RelativePose& pose) {
  waiting_.push_back(pose);
  if (waiting_.size() >= kPosesInRecord) append_waiting();
}

void RelativePath::append_waiting() {
  if (waiting_.empty()) return;
  std::vector<PoseRecord> records;
  records.reserve(waiting_.size());
  for (const RelativePose& pose : waiting_)
    records.push_back(record_of(pose));
  file_.append({{reinterpret_cast<const std::uint8_t*>(records.data()),
                 records.size() * sizeof(PoseRecord)}});
  waiting_.clear();
}

void RelativePath::sync() {
  append_waiting();
  file_.sync();
}

void RelativePath::for_each(const std::function<void(const RelativePose&)>& visit) {
  append_waiting();
  file_.for_each([&](std::uint64_t offset, RecordFile::Bytes bytes) {
    if (bytes.size() % sizeof(PoseRecord) != 0) {
      throw InputError(file_.path().string(), "at byte " + std::to_string(offset),
                       "expected a record of poses between scans");
    }
    PoseRecord record;
    for (std::size_t i = 0; i < bytes.size(); i += sizeof(record)) {
      std::memcpy(static_cast<void*>(&record), bytes.data() + i, sizeof(record));
      visit(pose_of(record));
    }
  });
}

std::uint64_t write_relative_path(const std::filesystem::path& file, RelativePath& path,
                                  const Trajectory& scans) {
  TumWriter writer(file);
  std::uint64_t poses = 0;
  path.for_each([&](const RelativePose& pose) {
    UNDERSTORY_CHECK(pose.scan < scans.size());
    writer.add({pose.stamp, scans[pose.scan].world_from_body * pose.scan_from_body});
    ++poses;
  });
  writer.commit();
  return poses;
}

}  // namespace understory
