#include "understory/preprocess/machine_boxes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "understory/util/error.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

constexpr double kFullTurn = 2.0 * std::numbers::pi;

double value_at(const std::vector<MachineBox::Sample>& series, TimeNs time) {
  const auto after =
      std::upper_bound(series.begin(), series.end(), time,
                       [](TimeNs t, const MachineBox::Sample& sample) { return t < sample.stamp; });
  if (after == series.begin()) return series.front().value;
  if (after == series.end()) return series.back().value;
  const auto before = std::prev(after);
  const double u =
      static_cast<double>(time - before->stamp) / static_cast<double>(after->stamp - before->stamp);
  return before->value + u * (after->value - before->value);
}

// A joint turned back by `value`: where the point would have been with the joint at zero.
Eigen::Vector3d undo_joint(const MachineBox& box, const Eigen::Vector3d& point, double value) {
  switch (box.joint) {
    case MachineBox::Joint::kRevolute:
      return box.joint_origin +
             Eigen::AngleAxisd(-value, box.joint_axis) * (point - box.joint_origin);
    case MachineBox::Joint::kPrismatic:
      return point - value * box.joint_axis;
    case MachineBox::Joint::kFixed:
      break;
  }
  return point;
}

bool in_fixed_box(const MachineBox& box, const Eigen::Vector3d& point) {
  const Eigen::Vector3d local = box.frame_from_box.inverse() * point;
  return (local.cwiseAbs().array() <= 0.5 * box.size_m.array()).all();
}

// The path of the point in the box as the joint goes through its range, one axis of the box. A turn
// gives constant + cosine * cos(value) + sine * sin(value), a slide constant + cosine * value.
struct Path {
  double constant = 0.0;
  double cosine = 0.0;
  double sine = 0.0;
};

std::array<Path, 3> path_of(const MachineBox& box, const Eigen::Vector3d& point) {
  const Pose box_from_frame = box.frame_from_box.inverse();
  std::array<Path, 3> path;
  if (box.joint == MachineBox::Joint::kPrismatic) {
    const Eigen::Vector3d start = box_from_frame * point;
    const Eigen::Vector3d along = -(box_from_frame.rotation() * box.joint_axis);
    for (std::size_t k = 0; k < 3; ++k)
      path[k] = {start[static_cast<int>(k)], along[static_cast<int>(k)], 0.0};
    return path;
  }
  const Eigen::Vector3d arm = point - box.joint_origin;
  const Eigen::Vector3d kept = box.joint_axis * box.joint_axis.dot(arm);
  const Eigen::Vector3d center = box_from_frame * (box.joint_origin + kept);
  const Eigen::Vector3d turning = box_from_frame.rotation() * (arm - kept);
  // Turning by -value.
  const Eigen::Vector3d across = -(box_from_frame.rotation() * box.joint_axis.cross(arm));
  for (std::size_t k = 0; k < 3; ++k) {
    const int i = static_cast<int>(k);
    path[k] = {center[i], turning[i], across[i]};
  }
  return path;
}

double along(const MachineBox& box, const Path& path, double value) {
  if (box.joint == MachineBox::Joint::kPrismatic) return path.constant + path.cosine * value;
  return path.constant + path.cosine * std::cos(value) + path.sine * std::sin(value);
}

// Values in the range at which the path meets the plane coordinate = level.
void add_crossings(const MachineBox& box, const Path& path, double level,
                   std::vector<double>& values) {
  const auto add = [&](double value) {
    if (value >= box.low && value <= box.high) values.push_back(value);
  };
  if (box.joint == MachineBox::Joint::kPrismatic) {
    if (path.cosine != 0.0) add((level - path.constant) / path.cosine);
    return;
  }
  const double radius = std::hypot(path.cosine, path.sine);
  const double reach = level - path.constant;
  if (radius == 0.0 || std::abs(reach) > radius) return;
  const double phase = std::atan2(path.sine, path.cosine);
  const double half = std::acos(reach / radius);
  for (const double root : {phase - half, phase + half}) {
    const double first = root + kFullTurn * std::ceil((box.low - root) / kFullTurn);
    for (double value = first; value <= box.high; value += kFullTurn)
      add(value);
  }
}

// Whether the point is inside at any value of the range. Between two neighbouring crossings of the
// planes of the box nothing changes, so one question in each interval is enough.
bool in_swept_box(const MachineBox& box, const Eigen::Vector3d& point) {
  const std::array<Path, 3> path = path_of(box, point);
  std::vector<double> values = {box.low, box.high};
  for (std::size_t k = 0; k < 3; ++k) {
    const double half = 0.5 * box.size_m[static_cast<int>(k)];
    add_crossings(box, path[k], half, values);
    add_crossings(box, path[k], -half, values);
  }
  std::sort(values.begin(), values.end());
  const auto inside = [&](double value) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (std::abs(along(box, path[k], value)) > 0.5 * box.size_m[static_cast<int>(k)])
        return false;
    }
    return true;
  };
  if (inside(box.low) || inside(box.high)) return true;
  for (std::size_t i = 0; i + 1 < values.size(); ++i) {
    if (inside(0.5 * (values[i] + values[i + 1]))) return true;
  }
  return false;
}

// Distance from the joint (or the box's place) beyond which no point can be inside.
struct Reach {
  Eigen::Vector3d center;
  double squared_radius;
};

Reach reach_of(const MachineBox& box) {
  const double half = 0.5 * box.size_m.norm();
  switch (box.joint) {
    case MachineBox::Joint::kRevolute: {
      const double arm = (box.frame_from_box.translation() - box.joint_origin).norm() + half;
      return {box.joint_origin, arm * arm};
    }
    case MachineBox::Joint::kPrismatic: {
      double most = std::abs(box.constant);
      if (box.value == MachineBox::Value::kSwept)
        most = std::max(std::abs(box.low), std::abs(box.high));
      if (box.value == MachineBox::Value::kSeries) {
        for (const MachineBox::Sample& sample : box.series)
          most = std::max(most, std::abs(sample.value));
      }
      return {box.frame_from_box.translation(), (half + most) * (half + most)};
    }
    case MachineBox::Joint::kFixed:
      break;
  }
  return {box.frame_from_box.translation(), half * half};
}

}  // namespace

bool inside_box(const MachineBox& box, const Eigen::Vector3d& point_in_frame, TimeNs time) {
  if (box.joint == MachineBox::Joint::kFixed) return in_fixed_box(box, point_in_frame);
  if (box.value == MachineBox::Value::kSwept) return in_swept_box(box, point_in_frame);
  const double value =
      box.value == MachineBox::Value::kSeries ? value_at(box.series, time) : box.constant;
  return in_fixed_box(box, undo_joint(box, point_in_frame, value));
}

std::vector<std::uint8_t> outside_machine(const Scan& scan, const Rig& rig,
                                          const std::vector<MachineBox>& boxes) {
  std::vector<std::uint8_t> keep(scan.points.size(), 1);
  if (boxes.empty()) return keep;
  std::vector<Reach> reaches;
  for (const MachineBox& box : boxes) {
    UNDERSTORY_CHECK(box.value != MachineBox::Value::kSeries || !box.series.empty());
    reaches.push_back(reach_of(box));
  }
  parallel_for(scan.points.size(), 1024, [&](std::size_t i) {
    const ScanPoint& point = scan.points[i];
    const Eigen::Vector3d in_lidar(point.x, point.y, point.z);
    const Eigen::Vector3d in_body = rig.body_from_lidar * in_lidar;
    for (std::size_t b = 0; b < boxes.size(); ++b) {
      const Eigen::Vector3d& p = boxes[b].frame == MachineBox::Frame::kBody ? in_body : in_lidar;
      if ((p - reaches[b].center).squaredNorm() > reaches[b].squared_radius) continue;
      if (!inside_box(boxes[b], p, scan.stamp + point.t_ns)) continue;
      keep[i] = 0;
      return;
    }
  });
  return keep;
}

}  // namespace understory
