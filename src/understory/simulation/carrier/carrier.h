#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/simulation/carrier/route.h"
#include "understory/simulation/scene/spline.h"
#include "understory/simulation/scene/terrain.h"
#include "understory/simulation/site.h"
#include "understory/simulation/stand/harvest.h"
#include "understory/simulation/stand/stand.h"

namespace understory {

// The body's motion at one moment.
struct CarrierState {
  Pose world_from_body;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();              // world, m/s
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();          // world, m/s^2
  Eigen::Vector3d angular_rate = Eigen::Vector3d::Zero();          // body, rad/s
  Eigen::Vector3d angular_acceleration = Eigen::Vector3d::Zero();  // body, rad/s^2
};

// The true path of the body frame: one quintic B-spline of position and of roll, pitch, yaw. Every
// sensor takes its exact pose, rate and acceleration at any time from it. Immutable, thread-safe.
class CarrierPath {
 public:
  using Spline = QuinticSpline<6>;  // x, y, z, roll, pitch, yaw
  explicit CarrierPath(Spline spline) : spline_(std::move(spline)) {}

  [[nodiscard]] Pose pose(double time_s) const;
  [[nodiscard]] CarrierState state(double time_s) const;
  [[nodiscard]] double duration_s() const { return spline_.duration_s(); }

 private:
  Spline spline_;
};

// Where a harvester's boom is, in the body frame: reach and height of its tip, metres.
using BoomPath = QuinticSpline<2>;

// All that a carrier does in a recording.
struct CarrierPlan {
  CarrierPath path;
  BoomPath boom;
  Harvest harvest;               // what a thinning cuts
  std::vector<double> shocks_s;  // when a falling stem or a jolt shakes the carrier, in order
};

// The motion along a route. A walker with a pole has gait, sway and quick turns; a harvester has
// work stops, cabin swings and rocking. A UAV hovers and tilts with the acceleration, a sleigh
// jolts, halts and nearly tumbles. Or the carrier stands still for ever. config.duration_s cuts it
// or lengthens it by standing still. A harvester that thins fells trees of the stand, whose ids
// must differ.
[[nodiscard]] CarrierPlan plan_carrier(const SiteConfig& config, const Route& route,
                                       const Terrain& terrain, const Stand& stand);

}  // namespace understory
