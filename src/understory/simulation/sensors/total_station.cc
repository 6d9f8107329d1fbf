#include "understory/simulation/sensors/total_station.h"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>

#include "understory/simulation/sensors/counter_noise.h"

namespace understory {
namespace {

constexpr double kArcSecond = std::numbers::pi / 180.0 / 3600.0;
constexpr double kBehind = 2.0;      // of the route's start, metres
constexpr double kTripod = 1.7;      // height of the instrument's axis, metres
constexpr double kRearrange = 20.0;  // seconds after which felled trees are looked for
constexpr double kPrismRadius =
    0.1;  // of what stands nearer to the prism nothing blocks it, metres

Eigen::Vector3d vector_of(const std::vector<double>& triple) {
  return {triple[0], triple[1], triple[2]};
}

Eigen::Vector3d instrument(const SimulatedWorld& world) {
  const double heading = world.route.heading(0.0);
  const Eigen::Vector2d place =
      world.route.place(0.0) - kBehind * Eigen::Vector2d(std::cos(heading), std::sin(heading));
  return {place.x(), place.y(), world.terrain.height(place.x(), place.y()) + kTripod};
}

bool in_sight(const ForestScene& scene, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d way = to - from;
  const Ray ray{from.cast<float>(), way.normalized().cast<float>()};
  Hit hit;
  const double reach = way.norm() - kPrismRadius;
  if (reach <= 0.0) return true;
  scene.cast(&ray, 1, 0.0F, static_cast<float>(reach), &hit);
  return hit.surface == Surface::kNone;
}

// Distance and two angles with their errors, and back.
Eigen::Vector3d measured(const TotalStationConfig& config, const Eigen::Vector3d& way,
                         CounterNoise& noise) {
  const double distance = way.norm();
  const double far =
      distance + noise.normal() * (config.distance_sd_m + 1e-6 * config.distance_ppm * distance);
  const double sd = config.angle_sd_arcsec * kArcSecond;
  const double azimuth = std::atan2(way.y(), way.x()) + sd * noise.normal();
  const double elevation = std::asin(way.z() / distance) + sd * noise.normal();
  return far * Eigen::Vector3d(std::cos(azimuth) * std::cos(elevation),
                               std::sin(azimuth) * std::cos(elevation), std::sin(elevation));
}

}  // namespace

Eigen::Vector3d prism_in_world(const TotalStationConfig& config, const CarrierPath& path,
                               double time_s) {
  const Pose world_from_body = path.pose(time_s);
  const Eigen::Matrix3d rotation = world_from_body.rotation_matrix();
  const double yaw = std::atan2(rotation(1, 0), rotation(0, 0));
  const Eigen::Quaterniond upright(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()));
  const Eigen::Quaterniond link = upright.slerp(1.0 - config.levelling, world_from_body.rotation());
  // The link is joined to the body at the foot of its pillar, in the body's origin.
  return world_from_body.translation() + link * vector_of(config.prism_m);
}

std::vector<PrismSample> track_prism(SimulatedWorld& world, TimeNs start, double until_s) {
  const TotalStationConfig& config = world.site.total_station;
  std::vector<PrismSample> samples;
  if (!config.enabled) return samples;
  const std::uint64_t seed = hash_numbers(world.seed, stream_of(NoiseStream::kTotalStation));
  CounterNoise setup(seed, 0, 0);
  const Eigen::Vector3d from = instrument(world);
  const Eigen::Vector3d shift =
      config.setup_sd_m * Eigen::Vector3d(setup.normal(), setup.normal(), setup.normal());
  double found_s = -std::numeric_limits<double>::infinity();  // when it can measure again
  double arranged_s = -kRearrange;
  for (std::int64_t i = 0;; ++i) {
    const double time = (static_cast<double>(i) + 0.37) / config.rate_hz;
    if (time >= until_s) break;
    if (time >= arranged_s + kRearrange) {
      world.scene.arrange(time, time);
      arranged_s = time;
    }
    const Eigen::Vector3d prism = prism_in_world(config, world.plan.path, time);
    if (!in_sight(world.scene, from, prism)) {
      found_s = time + config.search_s;
      continue;
    }
    if (time < found_s) continue;
    CounterNoise noise(seed, static_cast<std::uint64_t>(i), 1);
    const TimeNs late = from_seconds(config.time_offset_s + config.time_sd_s * noise.normal());
    const Eigen::Vector3d place = from + measured(config, prism - from, noise) + shift;
    samples.push_back({start + from_seconds(time) + late, place});
  }
  return samples;
}

}  // namespace understory
