#include "understory/odometry/stems/gathered_scan.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "understory/geometry/path_pose.h"
#include "understory/odometry/odometry_constants.h"
#include "understory/preprocess/deskew.h"
#include "understory/util/angles.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace odometry_constants::gathered_scan;

// A point of a cell.
struct CellPoint {
  std::uint32_t cell = 0;  // rings from below, then columns
  float range = 0.0F;      // level
  float slope = 0.0F;      // tangent of the elevation
  float intensity = 0.0F;
};

// reference_from_body over the time of the scans, by even motion.
std::vector<StampedPose> even_path(TimeNs from, TimeNs to, TimeNs stamp, const Vector6d& per_s) {
  std::vector<StampedPose> path;
  for (TimeNs at = from;; at = std::min(to, at + kPathStep)) {
    path.push_back({at, Pose::exp(to_seconds(at - stamp) * per_s)});
    if (at >= to) return path;
  }
}

// Turns of the path in place of those of even motion; the path is left as it is where samples lack.
void turn_by_gyroscope(std::vector<StampedPose>& path, TimeNs stamp, const Rig& rig,
                       const GatheredMotion& motion) {
  if (motion.samples == nullptr || !rig.body_from_imu) return;
  const std::vector<InertialSample> samples =
      motion.samples->slice(path.front().stamp, path.back().stamp);
  if (samples.size() < 2) return;
  const Eigen::Quaterniond body_from_imu = rig.body_from_imu->rotation();
  std::vector<StampedPose> turned{{samples.front().stamp, Pose()}};
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const Eigen::Vector3d rate =
        body_from_imu * (0.5 * (samples[i - 1].angular_rate() + samples[i].angular_rate())) -
        motion.gyro_bias;
    const double seconds = to_seconds(samples[i].stamp - samples[i - 1].stamp);
    const Eigen::Quaterniond turn =
        (turned.back().world_from_body.rotation() * so3_exp(seconds * rate)).normalized();
    turned.push_back({samples[i].stamp, Pose(turn, Eigen::Vector3d::Zero())});
  }
  const Eigen::Quaterniond reference = pose_on_path(turned, stamp).rotation().conjugate();
  for (StampedPose& pose : path) {
    pose.world_from_body = Pose(reference * pose_on_path(turned, pose.stamp).rotation(),
                                pose.world_from_body.translation());
  }
}

std::vector<CellPoint> cells_of(std::span<const ScanPtr> scans,
                                const std::vector<StampedPose>& path, const Rig& rig,
                                const std::vector<MachineBox>* boxes) {
  const Pose lidar_from_body = rig.body_from_lidar.inverse();
  std::vector<CellPoint> points;
  for (const ScanPtr& scan : scans) {
    std::vector<std::uint8_t> keep;
    if (boxes != nullptr) keep = outside_machine(*scan, rig, *boxes);
    const BodyCloud cloud = deskew(*scan, rig, path, keep).cloud;
    const Pose lidar_from_scan = lidar_from_body * pose_on_path(path, scan->stamp);
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const Eigen::Vector3d point = lidar_from_scan * cloud.points[i].cast<double>();
      const double range = point.head<2>().norm();
      if (!(range > kNearest)) continue;
      const double slope = point.z() / range;
      const double ring = (std::atan(slope) / kDegree + 90.0) / kRingDeg;
      const double column = (std::atan2(point.y(), point.x()) / kDegree + 180.0) / kColumnDeg;
      const auto cell = static_cast<std::uint32_t>(ring) * kColumns +
                        std::min(static_cast<std::uint32_t>(column), kColumns - 1);
      points.push_back(
          {cell, static_cast<float>(range), static_cast<float>(slope), cloud.intensity[i]});
    }
  }
  std::sort(points.begin(), points.end(), [](const CellPoint& a, const CellPoint& b) {
    return a.cell != b.cell ? a.cell < b.cell : a.range < b.range;
  });
  return points;
}

// One return of the points of a cell, which are sorted by range.
ScanPoint return_of(std::span<const CellPoint> cell) {
  const float median = cell[(cell.size() - 1) / 2].range;
  float count = 0.0F;
  float range = 0.0F;
  float slope = 0.0F;
  float intensity = 0.0F;
  for (const CellPoint& point : cell) {
    if (std::abs(point.range - median) > kSameSurface) continue;
    count += 1.0F;
    range += point.range;
    slope += point.slope;
    intensity += point.intensity;
  }
  range /= count;
  const double azimuth = ((cell.front().cell % kColumns + 0.5) * kColumnDeg - 180.0) * kDegree;
  ScanPoint result;
  result.x = range * static_cast<float>(std::cos(azimuth));
  result.y = range * static_cast<float>(std::sin(azimuth));
  result.z = range * slope / count;
  result.intensity = intensity / count;
  result.ring = static_cast<std::uint16_t>(cell.front().cell / kColumns);
  return result;
}

}  // namespace

ScanPtr gather_scans(std::span<const ScanPtr> scans, TimeNs stamp, const Rig& rig,
                     const GatheredMotion& motion, const std::vector<MachineBox>* boxes) {
  UNDERSTORY_CHECK(!scans.empty());
  TimeNs from = stamp;
  TimeNs to = stamp;
  for (const ScanPtr& scan : scans) {
    from = std::min(from, scan->stamp);
    to = std::max(to, scan->end());
  }
  std::vector<StampedPose> path = even_path(from, to, stamp, motion.per_s);
  turn_by_gyroscope(path, stamp, rig, motion);
  const std::vector<CellPoint> points = cells_of(scans, path, rig, boxes);
  auto gathered = std::make_shared<Scan>();
  gathered->stamp = stamp;
  gathered->has_point_times = false;
  gathered->ring_count = static_cast<int>(180.0 / kRingDeg);
  for (std::size_t begin = 0, end = 0; begin < points.size(); begin = end) {
    while (end < points.size() && points[end].cell == points[begin].cell)
      ++end;
    if (end - begin < kFewestOfACell) continue;
    gathered->points.push_back(return_of(std::span(points).subspan(begin, end - begin)));
  }
  return gathered;
}

}  // namespace understory
