#include "understory/map/keyframe_clouds.h"

#include <array>

#include "understory/util/error.h"

namespace understory {
namespace {

constexpr std::uint32_t kMark = 0x4b464332;  // "KFC2"

struct RecordHeader {
  std::uint32_t mark = kMark;
  std::int32_t id = 0;
  std::int64_t stamp = 0;
  std::uint64_t count = 0;
  std::array<double, 7> keyframe_from_body = {0, 0, 0, 0, 0, 0, 1};  // x y z, qx qy qz qw
};

std::array<double, 7> to_numbers(const Pose& pose) {
  const Eigen::Vector3d& t = pose.translation();
  const Eigen::Quaterniond& q = pose.rotation();
  return {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()};
}

Pose to_pose(const std::array<double, 7>& n) {
  return {Eigen::Quaterniond(n[6], n[3], n[4], n[5]), Eigen::Vector3d(n[0], n[1], n[2])};
}

}  // namespace

KeyframeClouds::KeyframeClouds(const std::filesystem::path& path, std::size_t keep) : path_(path) {
  if (keep > 0) {
    index_existing(keep);
  } else {
    std::ofstream create(path, std::ios::binary | std::ios::trunc);
    if (!create) throw OutputError(path.string(), "cannot be created");
  }
  file_.open(path, std::ios::binary | std::ios::in | std::ios::out);
  if (!file_) throw OutputError(path.string(), "cannot be opened for writing");
}

void KeyframeClouds::index_existing(std::size_t keep) {
  std::ifstream file(path_, std::ios::binary);
  if (!file) throw InputError(path_.string(), "", "keyframe clouds of the checkpoint are missing");
  const std::uint64_t size = std::filesystem::file_size(path_);
  while (offsets_.size() < keep) {
    RecordHeader header;
    file.seekg(static_cast<std::streamoff>(end_));
    file.read(reinterpret_cast<char*>(&header), sizeof(header));
    const std::uint64_t left = size - end_;
    if (!file || header.mark != kMark ||
        header.count > (left - sizeof(header)) / sizeof(KeyframePoint)) {
      throw InputError(path_.string(), "at byte " + std::to_string(end_),
                       "expected cloud " + std::to_string(offsets_.size()));
    }
    offsets_.push_back(end_);
    end_ += sizeof(header) + header.count * sizeof(KeyframePoint);
  }
  file.close();
  std::filesystem::resize_file(path_, end_);
}

void KeyframeClouds::append(const KeyframeCloud& cloud) {
  const RecordHeader header{kMark, cloud.id, cloud.stamp, cloud.points.size(),
                            to_numbers(cloud.keyframe_from_body)};
  file_.seekp(static_cast<std::streamoff>(end_));
  file_.write(reinterpret_cast<const char*>(&header), sizeof(header));
  const std::size_t bytes = cloud.points.size() * sizeof(KeyframePoint);
  file_.write(reinterpret_cast<const char*>(cloud.points.data()),
              static_cast<std::streamsize>(bytes));
  if (!file_) throw OutputError(path_.string(), "cannot be written (is the disk full?)");
  offsets_.push_back(end_);
  end_ += sizeof(header) + bytes;
}

void KeyframeClouds::flush() {
  file_.flush();
  if (!file_) throw OutputError(path_.string(), "cannot be written (is the disk full?)");
}

KeyframeCloud KeyframeClouds::read(std::size_t i) const {
  UNDERSTORY_CHECK(i < offsets_.size());
  RecordHeader header;
  file_.seekg(static_cast<std::streamoff>(offsets_[i]));
  file_.read(reinterpret_cast<char*>(&header), sizeof(header));
  const bool sound = file_ && header.mark == kMark;
  KeyframeCloud cloud;
  if (sound) {
    cloud = {header.id, header.stamp, std::vector<KeyframePoint>(header.count),
             to_pose(header.keyframe_from_body)};
    file_.read(reinterpret_cast<char*>(cloud.points.data()),
               static_cast<std::streamsize>(header.count * sizeof(KeyframePoint)));
  }
  if (!sound || !file_) {
    throw InputError(path_.string(), "at byte " + std::to_string(offsets_[i]),
                     "expected cloud " + std::to_string(i));
  }
  return cloud;
}

}  // namespace understory
