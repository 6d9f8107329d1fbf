#include "understory/map/keyframes/keyframe_clouds.h"

#include <array>
#include <cmath>
#include <cstring>
#include <string>

#include "understory/util/error.h"

namespace understory {
namespace {

struct CloudHead {
  std::int64_t id = 0;
  std::int64_t stamp = 0;
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

RecordFile::Bytes bytes_of_points(const std::vector<KeyframePoint>& points) {
  return {reinterpret_cast<const std::uint8_t*>(points.data()),
          points.size() * sizeof(KeyframePoint)};
}

}  // namespace

KeyframeClouds::KeyframeClouds(const std::filesystem::path& path) : file_(path) {}

KeyframeClouds::KeyframeClouds(const std::filesystem::path& path, const RecordCount& known)
    : file_(path, known, &offsets_) {}

void KeyframeClouds::append(const KeyframeCloud& cloud) {
  const CloudHead head{cloud.id, cloud.stamp, to_numbers(cloud.keyframe_from_body)};
  offsets_.push_back(file_.append({bytes_of(head), bytes_of_points(cloud.points)}));
}

KeyframeCloud KeyframeClouds::read(std::size_t i) const {
  UNDERSTORY_CHECK(i < offsets_.size());
  const std::vector<std::uint8_t> bytes = file_.read(i, offsets_[i]);
  CloudHead head;
  if (bytes.size() < sizeof(head) || (bytes.size() - sizeof(head)) % sizeof(KeyframePoint) != 0) {
    throw InputError(file_.path().string(), "at byte " + std::to_string(offsets_[i]),
                     "expected cloud " + std::to_string(i));
  }
  std::memcpy(&head, bytes.data(), sizeof(head));
  KeyframeCloud cloud{
      static_cast<std::int32_t>(head.id), head.stamp, {}, to_pose(head.keyframe_from_body)};
  cloud.points.resize((bytes.size() - sizeof(head)) / sizeof(KeyframePoint));
  if (!cloud.points.empty())
    std::memcpy(cloud.points.data(), bytes.data() + sizeof(head), bytes.size() - sizeof(head));
  return cloud;
}

}  // namespace understory
