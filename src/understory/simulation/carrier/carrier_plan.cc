#include <algorithm>
#include <cmath>
#include <numbers>

#include "understory/simulation/carrier/carrier.h"
#include "understory/simulation/carrier/motion.h"
#include "understory/simulation/sensors/counter_noise.h"

namespace understory {

using namespace motion;

namespace {

// ---- a walker with the sensor on a pole ------------------------------------------------------

struct Walk {
  std::vector<double> distance;  // at every step
  std::vector<double> pace;      // share of the usual speed, 0 standing
};

Walk walk_at(const SiteConfig& config, const CarrierConfig& c, double length_m,
             const Wander& speed) {
  Walk walk;
  double distance = 0.0;
  const double limit = config.duration_s > 0.0 ? config.duration_s : 1e6;
  for (double t = 0.0; t <= limit + 1.0; t += kStep) {
    const double start = ease((t - c.still_s) / 1.5);
    const double braking = std::max(0.08, ease((length_m - distance) / (1.2 * c.speed_m_s)));
    const double pace = start * braking * (1.0 + 0.12 * speed.at(t));
    walk.distance.push_back(distance);
    walk.pace.push_back(distance < length_m ? pace : 0.0);
    distance = std::min(length_m, distance + std::max(0.0, pace) * c.speed_m_s * kStep);
    const bool arrived = distance >= length_m - 0.02;
    if (arrived && config.duration_s <= 0.0) break;
  }
  const std::size_t rest = static_cast<std::size_t>(2.0 / kStep);
  walk.distance.insert(walk.distance.end(), rest, distance);
  walk.pace.insert(walk.pace.end(), rest, 0.0);
  return walk;
}

Walk walk_along(const SiteConfig& config, double length_m, Random& random) {
  const Wander speed(random, 0.02, 0.15);
  CarrierConfig c = config.carrier;
  c.route_time_s *= c.rounds;
  if (c.route_time_s > 0.0) {
    // The speed at which the whole route takes the time that it should.
    SiteConfig whole = config;
    whole.duration_s = 0.0;
    c.speed_m_s = length_m / std::max(1.0, c.route_time_s - c.still_s - 4.0);
    for (int i = 0; i < 3; ++i) {
      const double time =
          kStep * static_cast<double>(walk_at(whole, c, length_m, speed).distance.size());
      c.speed_m_s *= (time - c.still_s) / std::max(1.0, c.route_time_s - c.still_s);
    }
  }
  return walk_at(config, c, length_m, speed);
}

Moves quick_turns(const CarrierConfig& c, double duration_s, Random& random) {
  Moves turns;
  double t = c.still_s + 4.0;
  double at = 0.0;
  while (true) {
    t += 0.35 * c.turn_interval_s + random.exponential(0.65 * c.turn_interval_s);
    const double target =
        random.chance(0.35) ? 0.0 : random.uniform(-0.5, 0.5) * c.turn_deg * kDegree;
    const double time = turn_time(target - at, c.turn_rate_deg_s * random.uniform(0.6, 1.0));
    if (t + time > duration_s - 3.0) break;
    turns.add(t, time, target);
    t += time;
    at = target;
  }
  return turns;
}

CarrierPlan plan_walk(const SiteConfig& config, const Route& route, const Terrain& terrain) {
  const CarrierConfig& c = config.carrier;
  Random random(static_cast<std::uint64_t>(config.seed), stream_of(NoiseStream::kCarrier));
  const Walk walk = walk_along(config, route.length_m(), random);
  const double duration = kStep * static_cast<double>(walk.distance.size() - 1);
  const Moves turns = quick_turns(c, duration, random);
  const Wander roll(random, 0.08, 0.5);
  const Wander pitch(random, 0.08, 0.5);
  const Wander yaw(random, 0.05, 0.35);
  const Wander side(random, 0.05, 0.3);
  const Wander lift(random, 0.05, 0.3);
  const double step_length = 0.68;
  std::vector<Vector6d> controls;
  double pace = 0.0;
  for (std::size_t i = 0; i < walk.distance.size(); ++i) {
    const double t = kStep * static_cast<double>(i);
    pace += 0.1 * (std::clamp(walk.pace[i], 0.0, 1.2) - pace);  // a gait does not start at once
    // Hands never hold a pole quite still, but before the walk it stands on the ground.
    const double sway = ease((t - c.still_s) / 2.0) * (0.25 + 0.75 * std::min(1.0, pace));
    const double step = kTau * walk.distance[i] / step_length;  // one step each 2 pi
    const Eigen::Vector2d place = route.place(walk.distance[i]);
    const double heading = route.heading(walk.distance[i]);
    const double lateral = 0.9 * c.gait_m * pace * std::sin(0.5 * step) + 0.04 * sway * side.at(t);
    const double forward = 0.35 * c.gait_m * pace * std::sin(step + 0.6);
    Vector6d control;
    control[0] = place.x() - lateral * std::sin(heading) + forward * std::cos(heading);
    control[1] = place.y() + lateral * std::cos(heading) + forward * std::sin(heading);
    control[2] = terrain.smooth_height(place.x(), place.y(), 0.6) + c.height_m +
                 c.gait_m * pace * std::cos(step) + 0.03 * sway * lift.at(t);
    control[3] = kDegree * (0.9 * c.gait_deg * pace * std::sin(0.5 * step + 0.4) +
                            c.tilt_sd_deg * sway * roll.at(t));
    control[4] = kDegree * (0.7 * c.gait_deg * pace * std::sin(step + 1.1) +
                            c.tilt_sd_deg * sway * pitch.at(t));
    control[5] =
        heading + turns.at(t) + first_turn(c, t) +
        kDegree * (c.yaw_wander_deg * sway * yaw.at(t) + c.gait_deg * pace * std::sin(0.5 * step));
    controls.push_back(control);
  }
  return {CarrierPath(CarrierPath::Spline(std::move(controls), kStep)), BoomPath(), {}, {}};
}

// ---- a harvester ----------------------------------------------------------------------------

struct Work {
  Moves distance;
  Moves swing;
  Moves reach;
  Moves lift;
  std::vector<double> jolts_s;  // when the boom stops or a stem falls
  double duration_s = 0.0;
};

// One work stop: the boom goes out to a tree, cuts it, swings it over and comes back.
void work_at_stop(const CarrierConfig& c, Work& work, Random& random, double& t) {
  const int trees = 1 + static_cast<int>(random.below(2));
  double swing = 0.0;
  const auto swing_to = [&](double target) {
    const double time = turn_time(target - swing, c.turn_rate_deg_s);
    work.swing.add(t, time, target);
    swing = target;
    t += time;
    work.jolts_s.push_back(t);
  };
  for (int k = 0; k < trees; ++k) {
    const double side = random.chance(0.5) ? 1.0 : -1.0;
    swing_to(side * random.uniform(0.3, 1.0) * c.turn_deg * kDegree);
    work.reach.add(t, 2.0, random.uniform(2.5, 6.0));
    work.lift.add(t, 2.0, random.uniform(-1.6, -0.4));
    t += 2.5;
    work.jolts_s.push_back(t);  // the saw has cut through
    work.reach.add(t, 1.8, random.uniform(0.5, 1.5));
    work.lift.add(t, 1.8, random.uniform(-0.6, 0.6));
    t += 2.0;
    swing_to(-side * random.uniform(0.1, 0.5) * c.turn_deg * kDegree);
    t += random.uniform(0.5, 1.5);
  }
  swing_to(0.0);
}

Work harvester_work(const SiteConfig& config, double road_m, Random& random) {
  const CarrierConfig& c = config.carrier;
  Work work;
  double t = c.still_s + 0.2;
  double at = 0.0;
  int direction = 1;
  const double hop = std::max(2.0, c.turn_interval_s * c.speed_m_s);
  while (true) {
    const double goal = direction > 0 ? std::min(road_m, at + hop * random.uniform(0.6, 1.4))
                                      : std::max(0.0, at - 2.0 * hop * random.uniform(0.6, 1.4));
    const double time = std::max(1.5, 1.5 * std::abs(goal - at) / c.speed_m_s);
    work.distance.add(t, time, goal);
    t += time + 0.3;
    work.jolts_s.push_back(t);
    at = goal;
    if (direction < 0 && at <= 0.0) break;
    if (at >= road_m) direction = -1;
    if (direction > 0 || random.chance(0.3)) work_at_stop(c, work, random, t);
    t += 0.3;
  }
  work.duration_s = t + 2.0;
  return work;
}

CarrierPlan plan_harvester(const SiteConfig& config, const Route& route, const Terrain& terrain) {
  const CarrierConfig& c = config.carrier;
  Random random(static_cast<std::uint64_t>(config.seed), stream_of(NoiseStream::kCarrier));
  const Work work = harvester_work(config, route.length_m(), random);
  const double rock_roll = c.gait_deg * random.uniform(0.6, 1.0);
  const double rock_pitch = c.gait_deg * random.uniform(0.6, 1.0);
  const Wander shake(random, 0.4, 2.0);
  const double duration = config.duration_s > 0.0 ? config.duration_s + 1.0 : work.duration_s;
  std::vector<Vector6d> controls;
  std::vector<Eigen::Vector2d> boom;
  double moving = 0.0;
  for (std::size_t i = 0; i < steps_of(duration); ++i) {
    const double t = kStep * static_cast<double>(i);
    const double s = work.distance.at(t);
    const double speed = std::abs(work.distance.at(t + kStep) - s) / kStep;
    moving += 0.1 * (std::min(1.0, speed / c.speed_m_s) - moving);
    const Eigen::Vector2d place = route.place(s);
    const double heading = route.heading(s);
    const Eigen::Vector2d along(std::cos(heading), std::sin(heading));
    const Eigen::Vector2d across(-along.y(), along.x());
    const auto ground = [&](const Eigen::Vector2d& p) {
      return terrain.smooth_height(p.x(), p.y(), 0.7);
    };
    const double front = ground(place + 1.8 * along);
    const double back = ground(place - 1.8 * along);
    const double left = ground(place + 1.1 * across);
    const double right = ground(place - 1.1 * across);
    const double rock = rocking(work.jolts_s, t);
    const double swing = work.swing.at(t) + first_turn(c, t);
    // The chassis lies on the ground; the cabin turns on it, so pitch and roll turn with the swing.
    const double chassis_pitch = -std::atan2(front - back, 3.6) + kDegree * rock_pitch * rock +
                                 kDegree * 0.4 * moving * shake.at(t);
    const double chassis_roll = std::atan2(left - right, 2.2) + kDegree * rock_roll * rock +
                                kDegree * 0.4 * moving * shake.at(t + 100.0);
    Vector6d control;
    control << place.x(), place.y(),
        0.25 * (front + back + left + right) + c.height_m + c.gait_m * rock,
        chassis_roll * std::cos(swing) + chassis_pitch * std::sin(swing),
        chassis_pitch * std::cos(swing) - chassis_roll * std::sin(swing), heading + swing;
    controls.push_back(control);
    boom.emplace_back(3.0 + work.reach.at(t), 2.6 + work.lift.at(t));
  }
  return {CarrierPath(CarrierPath::Spline(std::move(controls), kStep)),
          BoomPath(std::move(boom), kStep),
          {},
          {}};
}

// Sensors on a table: the path is one point, which the spline holds for ever.
CarrierPlan plan_still(const SiteConfig& config, const Route& route, const Terrain& terrain) {
  const Eigen::Vector2d place = route.place(0.0);
  Vector6d control = Vector6d::Zero();
  control.head<2>() = place;
  control[2] = terrain.smooth_height(place.x(), place.y(), 0.6) + config.carrier.height_m;
  control[5] = route.heading(0.0);
  return {CarrierPath(CarrierPath::Spline({control}, kStep)), BoomPath(), {}, {}};
}

}  // namespace

CarrierPlan plan_carrier(const SiteConfig& config, const Route& route, const Terrain& terrain,
                         const Stand& stand) {
  if (config.carrier.kind == "harvester" && config.carrier.work == "thinning") {
    return plan_thinning(config, route, terrain, stand);
  }
  if (config.carrier.kind == "still") return plan_still(config, route, terrain);
  if (config.carrier.kind == "uav") return plan_uav(config, route, terrain);
  if (config.carrier.kind == "sleigh") return plan_sleigh(config, route, terrain);
  if (config.carrier.kind == "harvester") return plan_harvester(config, route, terrain);
  return plan_walk(config, route, terrain);
}

}  // namespace understory
