#include "understory/simulation/carrier/machine.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "understory/util/error.h"

namespace understory {
namespace {

// Distance along the ray to a sphere, or a negative number.
double meet_sphere(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                   const Eigen::Vector3d& centre, double radius, double near_m) {
  const Eigen::Vector3d m = origin - centre;
  const double b = m.dot(direction);
  const double discriminant = b * b - (m.squaredNorm() - radius * radius);
  if (discriminant < 0.0) return -1.0;
  const double t = -b - std::sqrt(discriminant);
  return t >= near_m ? t : -1.0;
}

// Distance along the ray to the capsule, with the outward normal; negative if it misses.
double meet_bar(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                const Machine::Bar& bar, double near_m, Eigen::Vector3d& normal) {
  const Eigen::Vector3d axis = bar.to - bar.from;
  const double length = axis.norm();
  const Eigen::Vector3d unit = axis / length;
  const Eigen::Vector3d m = origin - bar.from;
  const Eigen::Vector3d d_side = direction - direction.dot(unit) * unit;
  const Eigen::Vector3d m_side = m - m.dot(unit) * unit;
  const double a = d_side.squaredNorm();
  const double b = d_side.dot(m_side);
  const double discriminant = b * b - a * (m_side.squaredNorm() - bar.radius_m * bar.radius_m);
  double best = -1.0;
  if (a > 1e-12 && discriminant >= 0.0) {
    const double t = (-b - std::sqrt(discriminant)) / a;
    const double along = (m + t * direction).dot(unit);
    if (t >= near_m && along >= 0.0 && along <= length) {
      normal = (m_side + t * d_side) / bar.radius_m;
      return t;
    }
  }
  for (const Eigen::Vector3d& end : {bar.from, bar.to}) {
    const double t = meet_sphere(origin, direction, end, bar.radius_m, near_m);
    if (t >= 0.0 && (best < 0.0 || t < best)) {
      best = t;
      normal = (origin + t * direction - end) / bar.radius_m;
    }
  }
  return best;
}

// Whether a ray stays clear of the ball around a bar.
bool passes_by(const Machine::Bar& bar, const Eigen::Vector3d& origin,
               const Eigen::Vector3d& direction) {
  const Eigen::Vector3d middle = 0.5 * (bar.from + bar.to) - origin;
  const double radius = 0.5 * (bar.to - bar.from).norm() + bar.radius_m + 1e-6;
  const double along = middle.dot(direction);
  const double aside = middle.squaredNorm() - along * along;
  return aside > radius * radius || (along < 0.0 && middle.squaredNorm() > radius * radius);
}

}  // namespace

Machine::Machine(const CarrierConfig& config, const CarrierPlan& plan, const Stand& stand)
    : present_(config.kind == "harvester"), plan_(plan) {
  for (const Felling& felling : plan.harvest.fellings) {
    const auto tree = std::find_if(stand.trees.begin(), stand.trees.end(),
                                   [&](const GrownTree& t) { return t.id == felling.tree; });
    UNDERSTORY_CHECK(tree != stand.trees.end());
    trees_.push_back(&*tree);
  }
}

Machine::Parts Machine::at(double time_s) const {
  const BoomPath::Vector boom = plan_.boom.value(time_s);
  const Eigen::Vector3d head = head_in_body(boom);
  const double side = head.y();  // the boom stands to the right of the sensor
  const Eigen::Vector3d pillar(0.9, side, 1.9);
  const Eigen::Vector3d tip(head.x(), side, boom[1]);
  Eigen::Vector3d elbow = 0.5 * (pillar + tip);
  elbow.z() += std::sqrt(std::max(0.3, 9.0 - 0.25 * (tip - pillar).squaredNorm())) * 0.7;
  Parts parts;
  parts.bars = {
      {{0.9, side, 0.9}, pillar, 0.16},
      {pillar, elbow, 0.13},
      {elbow, tip, 0.11},
      {tip, head, 0.09},
      {head + Eigen::Vector3d(0.0, -0.25, 0.0), head + Eigen::Vector3d(0.0, 0.25, 0.0), 0.28},
      // Front wheels and the cabin's corner posts behind the sensor.
      {{1.5, 1.05, 0.6}, {1.5, 1.4, 0.6}, 0.6},
      {{1.5, -1.4, 0.6}, {1.5, -1.05, 0.6}, 0.6},
      {{0.35, 0.75, 1.0}, {0.35, 0.75, 2.9}, 0.06},
      {{0.35, -0.45, 1.0}, {0.35, -0.45, 2.9}, 0.06}};
  for (const FallenLog& log : plan_.harvest.logs) {
    if (time_s < log.cut_s || time_s >= log.lies_s) continue;
    const Pose body_from_world = plan_.path.pose(time_s).inverse();
    const Wood wood = log.at(time_s);
    parts.bars.push_back({body_from_world * wood.from, body_from_world * wood.to,
                          0.5 * (wood.radius_from_m + wood.radius_to_m), Surface::kDeadWood});
  }
  return parts;
}

std::optional<HeldTree> Machine::held(double time_s) const {
  for (std::size_t i = 0; i < trees_.size(); ++i) {
    const Felling& felling = plan_.harvest.fellings[i];
    if (time_s < felling.grab_s) break;
    if (time_s < felling.drop_s) return held_tree(plan_, felling, *trees_[i], time_s);
  }
  return std::nullopt;
}

void Machine::cast(const Parts& parts, const Eigen::Vector3d& origin,
                   const Eigen::Vector3d& direction, double near_m, double far_m, Hit& hit) {
  for (const Bar& bar : parts.bars) {
    if (passes_by(bar, origin, direction)) continue;
    Eigen::Vector3d normal;
    const double t = meet_bar(origin, direction, bar, near_m, normal);
    if (t < 0.0 || t > far_m) continue;
    if (hit.surface != Surface::kNone && hit.range_m <= t) continue;
    hit.range_m = static_cast<float>(t);
    hit.cosine = static_cast<float>(std::min(1.0, std::abs(normal.dot(direction))));
    hit.reflectivity = 0.5F;
    hit.tree = 0;
    hit.surface = bar.surface;
  }
}

}  // namespace understory
