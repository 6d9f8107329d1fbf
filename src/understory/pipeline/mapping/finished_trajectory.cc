#include "understory/pipeline/mapping/finished_trajectory.h"

#include "understory/util/error.h"

namespace understory {
namespace {

// The correction at the next keyframe after `i` against odometry from keyframe i; identity after
// the last one.
Pose correction_after(const std::vector<Keyframe>& keyframes, std::size_t i) {
  if (i + 1 >= keyframes.size() || keyframes[i + 1].begins_piece) return {};
  const Pose predicted = keyframes[i].world_from_body * keyframes[i + 1].previous_from_this;
  return predicted.inverse() * keyframes[i + 1].world_from_body;
}

double share_of_time(const std::vector<Keyframe>& keyframes, std::size_t i, TimeNs stamp) {
  if (i + 1 >= keyframes.size()) return 0.0;
  const double span = to_seconds(keyframes[i + 1].stamp - keyframes[i].stamp);
  return span > 0.0 ? to_seconds(stamp - keyframes[i].stamp) / span : 1.0;
}

// Of a scan that follows the keyframe `i` and is the first keyframe of a new piece of map.
bool begins_piece(const std::vector<Keyframe>& keyframes, std::size_t i, const ScanRecord& record) {
  return i + 1 < keyframes.size() && keyframes[i + 1].begins_piece &&
         record.stamp == keyframes[i + 1].stamp;
}

}  // namespace

void for_each_finished_scan(const Journal& journal, const std::vector<Keyframe>& keyframes,
                            const std::function<void(const FinishedScan&)>& visit) {
  std::size_t current = keyframes.size();  // whose correction is at hand; none yet
  Pose correction;
  journal.for_each([&](const ScanRecord& record) {
    const auto i = static_cast<std::size_t>(record.keyframe);
    UNDERSTORY_CHECK(i < keyframes.size());
    if (i != current) {
      current = i;
      correction = correction_after(keyframes, i);
    }
    const double u = share_of_time(keyframes, i, record.stamp);
    FinishedScan scan;
    scan.record = &record;
    scan.world_from_body =
        keyframes[i].world_from_body * record.keyframe_from_body() * correction.power(u);
    scan.velocity_in_world =
        keyframes[i].world_from_body.rotation() *
        Eigen::Vector3d(record.velocity[0], record.velocity[1], record.velocity[2]);
    if (begins_piece(keyframes, i, record)) {
      scan.velocity_in_world = keyframes[i + 1].world_from_body.rotation() *
                               scan.world_from_body.rotation().conjugate() * scan.velocity_in_world;
      scan.world_from_body = keyframes[i + 1].world_from_body;
    }
    visit(scan);
  });
}

}  // namespace understory
