#include <algorithm>
#include <cmath>

#include "understory/simulation/carrier/motion.h"
#include "understory/simulation/sensors/counter_noise.h"

namespace understory::motion {
namespace {

constexpr double kGravity = 9.81;

// ---- a sleigh's way over time -----------------------------------------------------------------

bool narrow(const CarrierConfig& c, double share) {
  return share >= c.narrow_from && share < c.narrow_to;
}

// Distances at every step: slow where the path is narrow, standing at the halts.
std::vector<double> sleigh_distances(const SiteConfig& config, double length_m, double factor,
                                     std::vector<double> halts_m, const Wander& pace,
                                     Random random) {
  const CarrierConfig& c = config.carrier;
  std::sort(halts_m.begin(), halts_m.end(), std::greater<>());
  std::vector<double> distances;
  double distance = 0.0;
  double speed = 0.0;
  double halt_until = c.still_s;
  const double limit = config.duration_s > 0.0 ? config.duration_s + 1.0 : 1e5;
  for (double t = 0.0; t < limit; t += kStep) {
    distances.push_back(distance);
    if (!halts_m.empty() && distance >= halts_m.back()) {
      halt_until = t + c.halt_s * random.uniform(0.5, 1.5);
      halts_m.pop_back();
    }
    const double usual = narrow(c, distance / length_m) ? c.narrow_speed_m_s : c.speed_m_s;
    const double rest = std::min(length_m, halts_m.empty() ? length_m : halts_m.back()) - distance;
    const double wanted =
        t < halt_until ? 0.0 : factor * usual * std::max(0.4, 1.0 + 0.25 * pace.at(t));
    // Brakes before halts and the end, with half a metre per second squared.
    const double braked = std::min(wanted, std::sqrt(std::max(0.0, rest)) + 0.05);
    speed += std::clamp(braked - speed, -0.8 * kStep, 0.5 * kStep);
    if (t < halt_until) speed = std::min(speed, braked);
    distance = std::min(length_m, distance + std::max(0.0, speed) * kStep);
    if (distance >= length_m - 0.02 && config.duration_s <= 0.0) break;
  }
  distances.insert(distances.end(), static_cast<std::size_t>(2.0 / kStep), distance);
  return distances;
}

std::vector<double> sleigh_way(const SiteConfig& config, double length_m, Random& random) {
  const CarrierConfig& c = config.carrier;
  std::vector<double> halts;
  for (int i = 0; i < c.halts; ++i)
    halts.push_back(length_m * (i + random.uniform(0.2, 0.8)) / c.halts);
  const Wander pace(random, 0.01, 0.1);
  const Random fork = random;
  double factor = 1.0;
  if (c.route_time_s > 0.0) {
    SiteConfig whole = config;
    whole.duration_s = 0.0;
    double standing = c.still_s + c.halts * c.halt_s;
    for (int i = 0; i < 4; ++i) {
      const double time =
          kStep *
          static_cast<double>(sleigh_distances(whole, length_m, factor, halts, pace, fork).size());
      factor *= (time - standing) / std::max(1.0, c.route_time_s - standing);
    }
  }
  return sleigh_distances(config, length_m, factor, halts, pace, fork);
}

// A near tumble: up on one runner and back within two seconds.
double tumble(double age_s) {
  return ease(age_s / 0.7) - ease((age_s - 1.0) / 0.8);
}

}  // namespace

CarrierPlan plan_sleigh(const SiteConfig& config, const Route& route, const Terrain& terrain) {
  const CarrierConfig& c = config.carrier;
  Random random(static_cast<std::uint64_t>(config.seed), stream_of(NoiseStream::kCarrier));
  const std::vector<double> way = sleigh_way(config, route.length_m(), random);
  std::vector<double> bumps;  // where the runners hit something
  for (double s = random.exponential(8.0); s < route.length_m(); s += random.exponential(8.0))
    bumps.push_back(s);
  std::vector<double> tumbles_m;
  for (int i = 0; i < c.tumbles; ++i)
    tumbles_m.push_back(route.length_m() * (i + random.uniform(0.3, 0.9)) / c.tumbles);
  const Wander sway(random, 0.1, 0.6);
  const Wander yaw(random, 0.05, 0.4);
  std::vector<Vector6d> controls;
  CarrierPlan plan{CarrierPath(CarrierPath::Spline({Vector6d::Zero()}, kStep)), BoomPath(), {}, {}};
  std::vector<double> jolts;
  std::vector<std::pair<double, double>> rolls;  // when, which way
  std::size_t bump = 0;
  std::size_t tumbled = 0;
  for (std::size_t i = 0; i < way.size(); ++i) {
    const double t = kStep * static_cast<double>(i);
    const double s = way[i];
    for (; bump < bumps.size() && s > bumps[bump]; ++bump) {
      jolts.push_back(t);
      plan.shocks_s.push_back(t);
    }
    for (; tumbled < tumbles_m.size() && s > tumbles_m[tumbled]; ++tumbled)
      rolls.emplace_back(t, tumbled % 2 == 0 ? 1.0 : -1.0);
    if (jolts.size() > 20) jolts.erase(jolts.begin(), jolts.begin() + 10);
    const Eigen::Vector2d place = route.place(s);
    const double heading = route.heading(s);
    const Lie lie = lie_on(terrain, place, heading, 2.0, 0.7, 0.3);
    const double speed = i > 0 ? (s - way[i - 1]) / kStep : 0.0;
    const double moving = std::min(1.0, speed / std::max(0.3, c.narrow_speed_m_s));
    const double rock = rocking(jolts, t);
    double over = 0.0;
    for (const auto& [start, side] : rolls)
      over += side * c.tumble_deg * kDegree * tumble(t - start);
    Vector6d control;
    control << place.x(), place.y(), lie.height_m + c.height_m + c.gait_m * rock,
        lie.roll + over + kDegree * (c.gait_deg * rock + c.tilt_sd_deg * moving * sway.at(t)),
        lie.pitch +
            kDegree * (0.8 * c.gait_deg * rock + c.tilt_sd_deg * moving * sway.at(t + 50.0)),
        heading + kDegree * c.yaw_wander_deg * moving * yaw.at(t);
    controls.push_back(control);
  }
  plan.path = CarrierPath(CarrierPath::Spline(std::move(controls), kStep));
  return plan;
}

// ---- a UAV ------------------------------------------------------------------------------------

namespace {

// Where a UAV wants to be. It stands on the ground, rises, follows the route with slow changes of
// pace and height, and hovers at the end.
struct Flight {
  std::vector<Eigen::Vector3d> places;
  std::vector<double> headings;
};

Flight fly(const SiteConfig& config, const Route& route, const Terrain& terrain, Random& random) {
  const CarrierConfig& c = config.carrier;
  const Wander pace(random, 0.02, 0.12);
  const Wander east(random, 0.05, 0.4);
  const Wander north(random, 0.05, 0.4);
  const Wander up(random, 0.04, 0.3);
  const double climb = 3.0 + c.height_m / 1.2;
  const double start = c.still_s + climb;
  double speed_of_way = c.speed_m_s;
  if (c.route_time_s > 0.0) {
    // A little faster than need be: what is left at the end it hovers.
    speed_of_way = 1.03 * route.length_m() / std::max(1.0, c.route_time_s - start - 6.0);
  }
  const double whole = c.route_time_s > 0.0 ? c.route_time_s + 1.0
                                            : start + 1.04 * route.length_m() / speed_of_way + 8.0;
  const double total = config.duration_s > 0.0 ? config.duration_s + 1.0 : whole;
  Flight flight;
  double distance = 0.0;
  double height = 0.0;
  for (double t = 0.0; t < total; t += kStep) {
    const double begun = ease((t - start) / 3.0);
    const double braking = ease((route.length_m() - distance) / (2.0 * speed_of_way) + 0.05);
    distance = std::min(route.length_m(), distance + kStep * speed_of_way * begun * braking *
                                                         std::max(0.2, 1.0 + 0.2 * pace.at(t)));
    const Eigen::Vector2d place = route.place(distance);
    const double ground = terrain.smooth_height(place.x(), place.y(), 2.0);
    height = t == 0.0 ? ground : height + 0.03 * (ground - height);  // follows the ground smoothly
    const double air = ease((t - c.still_s) / climb);
    const double above = c.begins_aloft ? c.height_m + 0.2 * up.at(t) * air
                                        : 0.35 + (c.height_m - 0.35 + 0.2 * up.at(t)) * air;
    flight.places.emplace_back(place.x() + 0.12 * air * east.at(t),
                               place.y() + 0.12 * air * north.at(t), height + above);
    flight.headings.push_back(route.heading(distance) + first_turn(c, t));
  }
  return flight;
}

}  // namespace

CarrierPlan plan_uav(const SiteConfig& config, const Route& route, const Terrain& terrain) {
  const CarrierConfig& c = config.carrier;
  Random random(static_cast<std::uint64_t>(config.seed), stream_of(NoiseStream::kCarrier));
  const Flight flight = fly(config, route, terrain, random);
  const Wander roll(random, 0.3, 2.0);
  const Wander pitch(random, 0.3, 2.0);
  const Wander yaw(random, 0.03, 0.2);
  const std::size_t count = flight.places.size();
  std::vector<Vector6d> controls;
  Eigen::Vector3d push = Eigen::Vector3d::Zero();  // what the rotors give, less gravity, world
  for (std::size_t i = 0; i < count; ++i) {
    const double t = kStep * static_cast<double>(i);
    const Eigen::Vector3d& here = flight.places[i];
    const Eigen::Vector3d& before = flight.places[i > 0 ? i - 1 : 0];
    const Eigen::Vector3d& after = flight.places[std::min(count - 1, i + 1)];
    const Eigen::Vector3d velocity = (after - before) / (2.0 * kStep);
    const Eigen::Vector3d acceleration = (after - 2.0 * here + before) / (kStep * kStep);
    push += 0.25 * (acceleration + 0.3 * velocity - push);  // against the drag, too
    const double air = ease((t - c.still_s) / 3.0);
    const double heading = flight.headings[i] + kDegree * c.yaw_wander_deg * air * yaw.at(t);
    const double forward = push.x() * std::cos(heading) + push.y() * std::sin(heading);
    const double left = -push.x() * std::sin(heading) + push.y() * std::cos(heading);
    Vector6d control;
    control << here.x(), here.y(), here.z(),
        -std::atan2(left, kGravity) + kDegree * c.tilt_sd_deg * air * roll.at(t),
        std::atan2(forward, kGravity) + kDegree * c.tilt_sd_deg * air * pitch.at(t), heading;
    controls.push_back(control);
  }
  return {CarrierPath(CarrierPath::Spline(std::move(controls), kStep)), BoomPath(), {}, {}};
}

}  // namespace understory::motion
