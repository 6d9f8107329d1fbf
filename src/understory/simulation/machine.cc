#include "understory/simulation/machine.h"

#include <algorithm>
#include <cmath>
#include <numbers>

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

// The stem in the head: its foot end just below the grip while it stands; falling, it turns to the
// side; level, it is fed through the grip to and fro.
Machine::Bar stem_in(const HeldStem& stem, const Eigen::Vector3d& head, double time_s) {
  const double fallen = std::clamp((time_s - stem.fall_s) / (stem.level_s - stem.fall_s), 0.0, 1.0);
  const double tilt = 0.5 * std::numbers::pi * fallen * fallen;
  const Eigen::Vector3d along(0.0, stem.side * std::sin(tilt), std::cos(tilt));
  const double work = std::max(1.0, stem.drop_s - stem.level_s);
  const double share = std::clamp((time_s - stem.level_s) / work, 0.0, 1.0);
  const double fed = 0.4 + (stem.length_m - 2.0) * std::abs(std::sin(2.5 * share));
  const double length = stem.length_m * (1.0 - 0.55 * share);  // logs are cut off
  return {head - std::min(fed, length - 0.5) * along, head + std::max(0.5, length - fed) * along,
          stem.radius_m};
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

Machine::Machine(const CarrierConfig& config, const CarrierPlan& plan)
    : present_(config.kind == "harvester"), boom_(plan.boom), held_(plan.held) {}

Machine::Parts Machine::at(double time_s) const {
  const BoomPath::Vector boom = boom_.value(time_s);
  const double reach = boom[0];
  const double height = boom[1];
  const double side = -0.75;  // the boom stands to the right of the sensor
  const Eigen::Vector3d pillar(0.9, side, 1.9);
  const Eigen::Vector3d tip(0.9 + reach, side, height);
  Eigen::Vector3d elbow = 0.5 * (pillar + tip);
  elbow.z() += std::sqrt(std::max(0.3, 9.0 - 0.25 * (tip - pillar).squaredNorm())) * 0.7;
  const Eigen::Vector3d head = tip - Eigen::Vector3d(0.0, 0.0, 0.75);
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
  for (const HeldStem& stem : held_) {
    if (time_s >= stem.grab_s && time_s < stem.drop_s) {
      parts.bars.push_back(stem_in(stem, head, time_s));
    }
  }
  return parts;
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
    hit.surface = Surface::kMachine;
  }
}

}  // namespace understory
