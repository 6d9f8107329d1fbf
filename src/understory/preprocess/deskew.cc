#include "understory/preprocess/deskew.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "understory/sensor/lidar_parts.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

constexpr std::size_t kBlock = 4096;

// A rigid motion in single precision: small numbers only, as it leads from the body to the body.
struct Motion {
  float r[9];
  float t[3];
};

Motion motion_of(const Pose& pose) {
  const Eigen::Matrix3d rotation = pose.rotation_matrix();
  Motion motion;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j)
      motion.r[3 * i + j] = static_cast<float>(rotation(i, j));
    motion.t[i] = static_cast<float>(pose.translation()[i]);
  }
  return motion;
}

// Poses between given ones, with the screw of each interval worked out once.
class PoseTrack {
 public:
  PoseTrack(std::span<const StampedPose> poses, double max_extrapolation_s)
      : poses_(poses), reach_(static_cast<TimeNs>(max_extrapolation_s * 1e9)) {
    screws_.reserve(poses.size());
    for (std::size_t i = 0; i + 1 < poses.size(); ++i) {
      UNDERSTORY_CHECK(poses[i].stamp < poses[i + 1].stamp);
      screws_.push_back(right_difference(poses[i + 1].world_from_body, poses[i].world_from_body));
    }
  }

  // P4 (34): X_m-1 (+) [(t - t_m-1) / (t_m - t_m-1) (X_m (-) X_m-1)].
  [[nodiscard]] Pose at(TimeNs time) const {
    time = std::clamp(time, poses_.front().stamp - reach_, poses_.back().stamp + reach_);
    const auto after =
        std::upper_bound(poses_.begin() + 1, poses_.end() - 1, time,
                         [](TimeNs t, const StampedPose& pose) { return t < pose.stamp; });
    const auto i = static_cast<std::size_t>(after - poses_.begin()) - 1;
    const double u = static_cast<double>(time - poses_[i].stamp) /
                     static_cast<double>(poses_[i + 1].stamp - poses_[i].stamp);
    return poses_[i].world_from_body * Pose::exp(u * screws_[i]);
  }

 private:
  std::span<const StampedPose> poses_;
  TimeNs reach_;
  std::vector<Vector6d> screws_;
};

// Indices of the points to keep, in order.
std::vector<std::uint32_t> kept_indices(std::size_t n, std::span<const std::uint8_t> keep) {
  std::vector<std::uint32_t> indices;
  indices.reserve(n);
  for (std::size_t i = 0; i < n; ++i) {
    if (keep.empty() || keep[i] != 0) indices.push_back(static_cast<std::uint32_t>(i));
  }
  return indices;
}

void place(const ScanPoint& point, const Motion& motion, const RayOrigins& origins, std::size_t to,
           BodyCloud& cloud) {
  const float* r = motion.r;
  cloud.points[to] = {r[0] * point.x + r[1] * point.y + r[2] * point.z + motion.t[0],
                      r[3] * point.x + r[4] * point.y + r[5] * point.z + motion.t[1],
                      r[6] * point.x + r[7] * point.y + r[8] * point.z + motion.t[2]};
  cloud.range[to] = origins.range(point);
  cloud.intensity[to] = point.intensity;
  cloud.ring[to] = point.ring;
  cloud.t_ns[to] = point.t_ns;
}

// One motion for each time step in which a point was measured: lidar at that time to body at t0.
std::vector<Motion> motions_of_steps(const Scan& scan, const Rig& rig, const PoseTrack& track,
                                     std::uint32_t step) {
  std::uint32_t last = 0;
  for (const ScanPoint& point : scan.points)
    last = std::max(last, point.t_ns);
  const std::size_t steps = last / step + 1;
  std::vector<std::uint8_t> used(steps, 0);
  for (const ScanPoint& point : scan.points)
    used[point.t_ns / step] = 1;

  const Pose body_from_world = track.at(scan.stamp).inverse();
  std::vector<Motion> motions(steps);
  parallel_for(steps, 256, [&](std::size_t i) {
    if (used[i] == 0) return;
    const TimeNs middle =
        scan.stamp + static_cast<TimeNs>(i) * step + static_cast<TimeNs>(step / 2);
    motions[i] = motion_of(body_from_world * track.at(middle) * rig.body_from_lidar);
  });
  return motions;
}

}  // namespace

DeskewResult deskew(const Scan& scan, const Rig& rig, std::span<const StampedPose> poses,
                    std::span<const std::uint8_t> keep, const DeskewConfig& config) {
  UNDERSTORY_CHECK(keep.empty() || keep.size() == scan.points.size());
  UNDERSTORY_CHECK(config.time_step_ns > 0);
  DeskewResult result;
  result.cloud.stamp = scan.stamp;
  result.deskewed = scan.has_point_times && poses.size() >= 2;
  if (scan.points.empty()) return result;

  const auto step =
      static_cast<std::uint32_t>(std::min<std::int64_t>(config.time_step_ns, UINT32_MAX));
  std::vector<Motion> motions;
  if (result.deskewed) {
    const PoseTrack track(poses, config.max_extrapolation_s);
    motions = motions_of_steps(scan, rig, track, step);
    const TimeNs first = poses.front().stamp - scan.stamp;
    const TimeNs last = poses.back().stamp - scan.stamp;
    for (const ScanPoint& point : scan.points)
      result.extrapolated += point.t_ns < first || point.t_ns > last ? 1 : 0;
  }
  const RayOrigins origins(rig);
  const Motion still = motion_of(rig.body_from_lidar);
  const std::vector<std::uint32_t> indices = kept_indices(scan.points.size(), keep);
  result.cloud.resize(indices.size());
  const std::size_t blocks = (indices.size() + kBlock - 1) / kBlock;
  parallel_for(blocks, 1, [&](std::size_t b) {
    const std::size_t end = std::min(indices.size(), (b + 1) * kBlock);
    for (std::size_t i = b * kBlock; i < end; ++i) {
      const ScanPoint& point = scan.points[indices[i]];
      place(point, result.deskewed ? motions[point.t_ns / step] : still, origins, i, result.cloud);
    }
  });
  return result;
}

}  // namespace understory
