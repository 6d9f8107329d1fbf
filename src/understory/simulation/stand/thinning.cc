#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "understory/simulation/carrier/motion.h"
#include "understory/simulation/sensors/counter_noise.h"

namespace understory::motion {
namespace {

constexpr double kBoomReach = 3.0;   // of the boom at rest, metres ahead of its pillar
constexpr double kBoomHeight = 2.6;  // of its tip above the body

// What a harvester does over a whole strip road.
struct Shift {
  Moves distance;
  Moves swing;
  Moves reach;
  Moves lift;
  std::vector<double> jolts_s;
  std::vector<Felling> fellings;
  double time_s = 0.0;  // of what is planned so far
  double swing_rad = 0.0;
  double at_m = 0.0;
};

void swing_to(const CarrierConfig& c, Shift& shift, double target) {
  const double time = turn_time(target - shift.swing_rad, c.turn_rate_deg_s);
  shift.swing.add(shift.time_s, time, target);
  shift.swing_rad = target;
  shift.time_s += time;
}

void drive_to(const CarrierConfig& c, Shift& shift, double goal) {
  const double time = std::max(1.5, 1.5 * std::abs(goal - shift.at_m) / c.speed_m_s);
  shift.distance.add(shift.time_s, time, goal);
  shift.at_m = goal;
  shift.time_s += time + 0.3;
  shift.jolts_s.push_back(shift.time_s);
}

void move_boom(Shift& shift, double time_s, double reach_m, double lift_m) {
  shift.reach.add(shift.time_s, time_s, reach_m);
  shift.lift.add(shift.time_s, time_s, lift_m);
  shift.time_s += time_s;
}

// Where a thinning harvester stands and what it may cut.
struct ThinningWork {
  const CarrierConfig& carrier;
  const Route& route;
  const Terrain& terrain;
  const Stand& stand;
  std::vector<const GrownTree*> cut;  // so far
};

// The swing and the boom that bring the head to a tree.
struct Reach {
  double swing_rad = 0.0;
  double reach_m = 0.0;
  double tip_m = 0.0;  // height of the tip in the body frame
};

constexpr double kGripHeight = kStumpHeight + 0.6;

std::optional<Reach> reach_to(const ThinningWork& work, double at_m, const GrownTree& tree) {
  const Eigen::Vector2d place = work.route.place(at_m);
  const Eigen::Vector3d grip = tree.centre(kGripHeight);
  const double distance = (grip.head<2>() - place).norm();
  if (distance < 3.4 || distance > 9.0) return std::nullopt;
  const double heading = work.route.heading(at_m);
  const Lie lie = lie_on(work.terrain, place, heading, 3.6, 2.2, 0.7);
  const Eigen::Quaterniond world_from_chassis =
      Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitZ()) *
      Eigen::AngleAxisd(lie.pitch, Eigen::Vector3d::UnitY()) *
      Eigen::AngleAxisd(lie.roll, Eigen::Vector3d::UnitX());
  const Eigen::Vector3d origin(place.x(), place.y(), lie.height_m + work.carrier.height_m);
  const Eigen::Vector3d grip_in_chassis = world_from_chassis.inverse() * (grip - origin);
  const Eigen::Vector3d head = head_in_body({0.0, 0.0});  // the boom drawn in to the pillar
  const double ahead = std::sqrt(grip_in_chassis.head<2>().squaredNorm() - head.y() * head.y());
  const double swing = std::remainder(
      std::atan2(grip_in_chassis.y(), grip_in_chassis.x()) - std::atan2(head.y(), ahead), kTau);
  if (std::abs(swing) > work.carrier.turn_deg * kDegree) return std::nullopt;
  return Reach{swing, ahead - head.x(), grip_in_chassis.z() - head.z()};
}

// A grown tree in reach, drawn among those whose neighbours were left standing.
const GrownTree* choose_tree(const ThinningWork& work, double at_m, Random& random) {
  constexpr double kApart = 2.2;  // a thinning leaves trees between those that it takes
  std::vector<const GrownTree*> candidates;
  for (const GrownTree& tree : work.stand.trees) {
    if (!tree.cloud.empty() || !reach_to(work, at_m, tree)) continue;
    const bool near = std::any_of(work.cut.begin(), work.cut.end(), [&](const GrownTree* other) {
      return (other->foot - tree.foot).head<2>().norm() < kApart;
    });
    if (!near) candidates.push_back(&tree);
  }
  if (candidates.empty()) return nullptr;
  return candidates[random.below(candidates.size())];
}

// The tree in the head is worked up in front, off the road's middle, while the cabin never quite
// rests. Ends at `end_s`, or a little later where that is too soon.
void work_up(const CarrierConfig& c, Shift& shift, Random& random, double side, double end_s) {
  const double front = -side * random.uniform(0.05, 0.5) * c.turn_deg * kDegree;
  do {
    swing_to(c, shift, front + 0.12 * c.turn_deg * kDegree * random.uniform(-1.0, 1.0));
    shift.time_s += random.uniform(1.0, 3.0);
    if (random.chance(0.4)) shift.jolts_s.push_back(shift.time_s);  // a log falls off
  } while (shift.time_s < end_s - 3.0);
}

// One tree: out to it, cut, let it fall, feed it through the head with the cabin turning to and
// fro, drop it. Where none is in reach the operator looks about and goes on.
void fell_tree(ThinningWork& work, Shift& shift, Random& random, double end_s) {
  const CarrierConfig& c = work.carrier;
  const GrownTree* tree = choose_tree(work, shift.at_m, random);
  if (tree == nullptr) {
    work_up(c, shift, random, random.chance(0.5) ? 1.0 : -1.0, std::min(end_s, shift.time_s + 6.0));
    shift.time_s = std::max(shift.time_s, end_s);
    return;
  }
  const Reach reach = reach_to(work, shift.at_m, *tree).value();
  const double side = reach.swing_rad > 0.0 ? 1.0 : -1.0;
  swing_to(c, shift, reach.swing_rad);
  shift.jolts_s.push_back(shift.time_s);
  move_boom(shift, 3.0, reach.reach_m - kBoomReach, reach.tip_m - kBoomHeight);
  shift.time_s += 0.3;
  Felling felling;
  felling.tree = tree->id;
  felling.grab_s = shift.time_s;
  felling.fall_s = shift.time_s + 1.5;
  felling.level_s = felling.fall_s + 2.2;
  felling.side = -side;
  felling.cuts_m = cuts_of(*tree);
  shift.time_s = felling.level_s;
  shift.jolts_s.push_back(felling.level_s);
  felling.feed_s = felling.level_s + 2.0;
  // Drawn in, though never onto the machine, and held at a height to work at.
  move_boom(shift, 2.0, random.uniform(0.5, 2.0), random.uniform(-0.6, 0.0));
  work_up(c, shift, random, side, end_s);
  felling.drop_s = shift.time_s;
  shift.fellings.push_back(felling);
  work.cut.push_back(tree);
}

// Works at one place for about the given time, backing up between trees as it comes.
void work_here(ThinningWork& work, Shift& shift, Random& random, double budget_s) {
  const CarrierConfig& c = work.carrier;
  constexpr double kTree = 32.0;
  const double end = shift.time_s + budget_s;
  const int trees = std::max(1, static_cast<int>(std::lround(budget_s / kTree)));
  const double here = shift.at_m;
  for (int i = 0; i < trees; ++i) {
    const double rest = end - shift.time_s;
    fell_tree(work, shift, random, shift.time_s + rest / (trees - i));
    if (c.back_up_m > 0.0 && random.chance(0.5)) {
      const double back = here - c.back_up_m * random.uniform(0.3, 1.0);
      drive_to(c, shift, shift.at_m < here ? here : std::max(0.0, back));
    }
  }
  swing_to(c, shift, 0.0);
}

Shift plan_shift(ThinningWork& work, Random& random) {
  const CarrierConfig& c = work.carrier;
  const double road_m = work.route.length_m();
  const double hop = std::max(2.0, c.turn_interval_s * c.speed_m_s);
  std::vector<double> stops;
  for (double at = hop * random.uniform(0.3, 1.0); at < road_m;
       at += hop * random.uniform(0.6, 1.4))
    stops.push_back(at);
  Shift shift;
  shift.time_s = c.still_s + 0.2;
  for (std::size_t i = 0; i < stops.size(); ++i) {
    drive_to(c, shift, stops[i]);
    // What is left of the time, less the drives to come, is shared by the stops that are left.
    const double drives = 1.5 * (road_m - shift.at_m) / c.speed_m_s;
    const double left = c.route_time_s - shift.time_s - drives;
    const double share = left / static_cast<double>(stops.size() - i);
    const bool last = i + 1 == stops.size();
    work_here(work, shift, random, std::max(25.0, share * (last ? 1.0 : random.uniform(0.6, 1.4))));
  }
  drive_to(c, shift, road_m);
  shift.time_s = std::max(shift.time_s + 2.0, c.route_time_s + 0.5);
  return shift;
}

}  // namespace

CarrierPlan plan_thinning(const SiteConfig& config, const Route& route, const Terrain& terrain,
                          const Stand& stand) {
  const CarrierConfig& c = config.carrier;
  // Each road has a shift of its own.
  const auto road = static_cast<std::uint64_t>(c.strip_road - 1);
  Random random(static_cast<std::uint64_t>(config.seed),
                stream_of(NoiseStream::kCarrier) + 1000 * road);
  ThinningWork work{c, route, terrain, stand, {}};
  Shift shift = plan_shift(work, random);
  std::sort(shift.jolts_s.begin(), shift.jolts_s.end());
  const double rock_roll = c.gait_deg * random.uniform(0.6, 1.0);
  const double rock_pitch = c.gait_deg * random.uniform(0.6, 1.0);
  const Wander shake(random, 0.4, 2.0);
  const double duration =
      config.duration_s > 0.0 ? std::min(config.duration_s + 1.0, 1e5) : shift.time_s;
  std::vector<Vector6d> controls;
  std::vector<Eigen::Vector2d> boom;
  double moving = 0.0;
  for (std::size_t i = 0; i < steps_of(duration); ++i) {
    const double t = kStep * static_cast<double>(i);
    const double s = shift.distance.at(t);
    const double speed = std::abs(shift.distance.at(t + kStep) - s) / kStep;
    moving += 0.1 * (std::min(1.0, speed / c.speed_m_s) - moving);
    const Eigen::Vector2d place = route.place(s);
    const double heading = route.heading(s);
    const Lie lie = lie_on(terrain, place, heading, 3.6, 2.2, 0.7);
    const double rock = rocking(shift.jolts_s, t);
    const double swing = shift.swing.at(t);
    // The cabin turns on the chassis, so pitch and roll turn with the swing.
    const double pitch = lie.pitch + kDegree * (rock_pitch * rock + 0.4 * moving * shake.at(t));
    const double roll =
        lie.roll + kDegree * (rock_roll * rock + 0.4 * moving * shake.at(t + 100.0));
    Vector6d control;
    control << place.x(), place.y(), lie.height_m + c.height_m + c.gait_m * rock,
        roll * std::cos(swing) + pitch * std::sin(swing),
        pitch * std::cos(swing) - roll * std::sin(swing), heading + swing;
    controls.push_back(control);
    boom.emplace_back(kBoomReach + shift.reach.at(t), kBoomHeight + shift.lift.at(t));
  }
  CarrierPlan plan{CarrierPath(CarrierPath::Spline(std::move(controls), kStep)),
                   BoomPath(std::move(boom), kStep),
                   {std::move(shift.fellings), {}, {}},
                   {}};
  for (const Felling& felling : plan.harvest.fellings)
    plan.shocks_s.push_back(felling.level_s);
  lay_out_logs(plan, stand, terrain);
  return plan;
}

}  // namespace understory::motion
