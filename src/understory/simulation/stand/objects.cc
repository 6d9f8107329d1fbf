#include "understory/simulation/stand/objects.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "understory/simulation/sensors/counter_noise.h"
#include "understory/util/angles.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using Board = StandObject::Board;
using Vector = Eigen::Vector3d;

constexpr double kSunk = 0.4;        // metres that things reach into the ground
constexpr double kGroundStep = 0.5;  // metres between the heights under a walker's line
constexpr double kRoom = 0.15;       // metres between a thing and the bark of a tree

// The world's place of a thing's own frame, at the height of its foot.
Vector in_world(const StandObject& object, const Vector& own) {
  return object.foot + Eigen::AngleAxisd(object.yaw_rad, Vector::UnitZ()) * own;
}

// Of the ground over the foot, at a place in the thing's own frame.
double ground_at(const StandObject& object, const Terrain& terrain, double x, double y) {
  const Vector place = in_world(object, {x, y, 0.0});
  return terrain.smooth_height(place.x(), place.y(), 0.3) - object.foot.z();
}

void set_size(StandObject& object, double length, double width, double height) {
  object.size_m = {length, width, height};
}

// ---- what things are made of; lengths in metres -------------------------------------------------

void make_wall(StandObject& wall, double length, double height) {
  constexpr double kThick = 0.2;
  set_size(wall, length, kThick, height);
  wall.boards.push_back(
      {{-0.5 * length, -0.5 * kThick, -1.0}, {0.5 * length, 0.5 * kThick, height}});
}

void make_post(StandObject& post, Random& random) {
  const double radius = random.uniform(0.035, 0.09);
  const double height = random.uniform(1.0, 2.2);
  set_size(post, 2.0 * radius, 2.0 * radius, height);
  const Vector lean(random.normal(0.0, 0.02), random.normal(0.0, 0.02), 1.0);
  post.rods.push_back({-kSunk * lean, height * lean, radius, radius});
}

void make_fence(StandObject& fence, const Terrain& terrain, Random& random) {
  constexpr double kPanel = 2.5;
  const int panels = 2 + static_cast<int>(random.uniform(0.0, 3.0));
  const double length = kPanel * panels;
  const double height = random.uniform(1.0, 1.4);
  set_size(fence, length, 0.12, height);
  for (int i = 0; i <= panels; ++i) {
    const double x = kPanel * i - 0.5 * length;
    const double ground = ground_at(fence, terrain, x, 0.0);
    fence.rods.push_back({{x, 0.0, ground - kSunk}, {x, 0.0, ground + height}, 0.05, 0.05});
    if (i == panels) continue;
    const double next = ground_at(fence, terrain, x + kPanel, 0.0);
    for (const double share : {0.3, 0.6, 0.9}) {
      fence.rods.push_back({{x, 0.06, ground + share * height},
                            {x + kPanel, 0.06, next + share * height},
                            0.035,
                            0.035});
    }
  }
}

void make_vehicle(StandObject& vehicle, Random& random) {
  const double length = random.uniform(3.8, 5.2);
  const double width = random.uniform(1.65, 1.95);
  const double height = random.uniform(1.45, 2.1);
  set_size(vehicle, length, width, height);
  const double side = 0.5 * width;
  const double end = 0.5 * length;
  vehicle.boards.push_back({{-end, -side, 0.3}, {end, side, 0.55 * height}});
  // The cabin begins behind the bonnet; its glass is taken for a wall.
  vehicle.boards.push_back(
      {{-0.9 * end, -0.9 * side, 0.55 * height}, {0.35 * end, 0.9 * side, height}});
  for (const double x : {-0.62 * end, 0.62 * end}) {
    for (const double y : {-side, side}) {
      const double inwards = y > 0.0 ? -0.2 : 0.2;
      vehicle.rods.push_back({{x, y + inwards, 0.32}, {x, y + 1.4 * inwards, 0.32}, 0.32, 0.32});
    }
  }
}

void make_walk(StandObject& walker, Random& random) {
  walker.walk_m = random.uniform(4.0, 10.0);
  walker.speed_m_s = random.uniform(0.6, 1.5);
  walker.start_m = random.uniform(0.0, 2.0 * walker.walk_m);
}

void level_walk(StandObject& walker, const Terrain& terrain) {
  for (double x = -0.5 * walker.walk_m; x < 0.5 * walker.walk_m + kGroundStep; x += kGroundStep)
    walker.ground_m.push_back(ground_at(walker, terrain, x, 0.0));
}

// ---- where they stand ---------------------------------------------------------------------------

// Half of the length and width that a thing needs.
Eigen::Vector2d half_room(const StandObject& object) {
  const double length = object.size_m.x() + object.walk_m;
  return {0.5 * length, 0.5 * object.size_m.y()};
}

// How far a place is outside of the rectangle that a thing needs; 0 inside.
double gap_to(const StandObject& object, const Eigen::Vector2d& place) {
  const Eigen::Vector2d off = Eigen::Rotation2Dd(-object.yaw_rad) * (place - object.foot.head<2>());
  const Eigen::Array2d beyond = off.array().abs() - half_room(object).array();
  return beyond.max(0.0).matrix().norm();
}

// The smallest distance of the route to places along the thing.
double clearance_of(const StandObject& object, const Route& route) {
  const Eigen::Vector2d half = half_room(object);
  double least = 1e9;
  for (double x = -half.x(); x <= half.x() + 1e-9; x += std::max(0.1, 0.25 * half.x())) {
    for (const double y : {-half.y(), half.y()})
      least = std::min(least, route.distance_to(in_world(object, {x, y, 0.0}).head<2>()));
  }
  return least;
}

bool is_free(const StandObject& object, const std::vector<StandObject>& others) {
  const double reach = half_room(object).norm() + 0.8;
  return std::all_of(others.begin(), others.end(), [&](const StandObject& other) {
    return (object.foot - other.foot).head<2>().norm() > reach + half_room(other).norm();
  });
}

// What places depend on.
struct Site {
  const ObjectsConfig& config;
  const Terrain& terrain;
  const Route& route;
};

// Beside the route, with any yaw.
void draw_object_place(const Site& site, Random& random, StandObject& object) {
  const auto& [config, terrain, route] = site;
  const double along = random.uniform(0.02, 0.98) * route.length_m();
  const double heading = route.heading(along);
  const double side = random.uniform() < 0.5 ? -1.0 : 1.0;
  const double aside =
      side * (config.clearance_m + half_room(object).y() + random.uniform() * config.reach_m);
  const Eigen::Vector2d place =
      route.place(along) + aside * Eigen::Vector2d(-std::sin(heading), std::cos(heading));
  object.foot = {place.x(), place.y(), terrain.smooth_height(place.x(), place.y(), 0.3)};
  // Long things lie along the route, more or less.
  object.yaw_rad =
      object.size_m.x() > 2.5 ? heading + random.normal(0.0, 0.3) : random.uniform(0.0, kTau);
}

bool find_room(const Site& site, const std::vector<StandObject>& others, Random& random,
               StandObject& object) {
  constexpr int kAttempts = 300;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    draw_object_place(site, random, object);
    if (clearance_of(object, site.route) >= site.config.clearance_m && is_free(object, others))
      return true;
  }
  return false;
}

// A thing without a place. A fence is only as large as it may become: its posts need the ground.
StandObject new_object(ObjectKind kind, Random& random) {
  StandObject object;
  object.kind = kind;
  switch (kind) {
    case ObjectKind::kWall:
      make_wall(object, random.uniform(5.0, 9.0), random.uniform(2.4, 4.5));
      break;
    case ObjectKind::kPost:
      make_post(object, random);
      break;
    case ObjectKind::kFence:
      set_size(object, 10.0, 0.12, 1.2);
      break;
    case ObjectKind::kVehicle:
      make_vehicle(object, random);
      break;
    case ObjectKind::kPerson:
    case ObjectKind::kWalker:
    case ObjectKind::kFollower:
      shape_person(object, random);
      if (kind == ObjectKind::kWalker) make_walk(object, random);
      break;
  }
  return object;
}

// The other wall of a building's corner, at one end of the first and away from the route.
StandObject second_wall(const StandObject& first, const Route& route, Random& random) {
  StandObject wall;
  wall.kind = ObjectKind::kWall;
  make_wall(wall, random.uniform(3.5, 6.0), first.size_m.z());
  const double end = random.uniform() < 0.5 ? -0.5 : 0.5;
  wall.yaw_rad = first.yaw_rad + 0.25 * kTau;
  const double half = 0.5 * wall.size_m.x();
  const Vector one = in_world(first, {end * first.size_m.x(), half, 0.0});
  const Vector other = in_world(first, {end * first.size_m.x(), -half, 0.0});
  const bool one_is_farther = route.distance_to(one.head<2>()) > route.distance_to(other.head<2>());
  wall.foot = one_is_farther ? one : other;
  return wall;
}

void make_room(const StandObject& object, Stand& stand) {
  const auto covers = [&](const Vector& place, double reach) {
    return gap_to(object, place.head<2>()) < reach + kRoom;
  };
  std::erase_if(stand.trees, [&](const GrownTree& tree) {
    return covers(tree.foot, 0.7 * tree.dbh_m) || covers(tree.centre(1.5), 0.7 * tree.dbh_m);
  });
  std::erase_if(stand.plants,
                [&](const Plant& plant) { return covers(plant.foot, 0.3 * plant.height_m); });
  std::erase_if(stand.dead_wood, [&](const Wood& wood) {
    return covers(wood.from, 0.2) || covers(wood.to, 0.2) ||
           covers(0.5 * (wood.from + wood.to), 0.2);
  });
  std::erase_if(stand.boulders,
                [&](const Wood& wood) { return covers(wood.from, wood.radius_from_m); });
}

ObjectMotion motion_on_track(const StandObject& object, double time_s) {
  const double at = std::max(0.0, time_s) / object.track_step_s;
  const auto low = static_cast<std::size_t>(at);
  if (low + 1 >= object.track.size()) return {object.track.back(), Eigen::Vector2d::Zero()};
  const Vector step = object.track[low + 1] - object.track[low];
  return {object.track[low] + (at - static_cast<double>(low)) * step,
          step.head<2>() / object.track_step_s};
}

}  // namespace

void describe_objects(ConfigTable& table, ObjectsConfig& c) {
  table.section("objects", [&] {
    table.add("houses", c.houses, {0, 100}, "", "corners of buildings, two walls each");
    table.add("posts", c.posts, {0, 1000}, "", "posts of 1 to 2.2 m");
    table.add("fences", c.fences, {0, 100}, "", "fences of posts and rails");
    table.add("vehicles", c.vehicles, {0, 100}, "", "parked vehicles");
    table.add("people", c.people, {0, 1000}, "", "people who stand");
    table.add("walkers", c.walkers, {0, 1000}, "", "people who walk to and fro");
    table.add("clearance_m", c.clearance_m, {0.5, 100.0}, "m", "from the route to their next part");
    table.add("reach_m", c.reach_m, {0.0, 1000.0}, "m", "farthest that they begin behind that");
    table.add("followers", c.followers, {0, 20}, "",
              "people who walk behind the carrier all the way, two abreast");
    table.add("follow_m", c.follow_m, {0.5, 100.0}, "m", "from the body to the first of them");
  });
}

void shape_person(StandObject& person, Random& random) {
  const double height = random.uniform(1.55, 1.92);
  set_size(person, 0.35, 0.5, height);
  const double hip = 0.5 * height;
  const double shoulder = 0.82 * height;
  for (const double side : {-1.0, 1.0}) {
    const double step = person.kind != ObjectKind::kPerson ? side * 0.2 : 0.0;
    person.rods.push_back({{step, 0.12 * side, 0.06}, {0.0, 0.09 * side, hip}, 0.055, 0.085});
    person.rods.push_back(
        {{0.5 * step, 0.27 * side, hip}, {0.0, 0.22 * side, shoulder - 0.05}, 0.035, 0.05});
  }
  person.rods.push_back({{0.0, 0.0, hip}, {0.0, 0.0, shoulder - 0.1}, 0.14, 0.17});
  person.rods.push_back({{0.0, 0.0, height - 0.2}, {0.0, 0.0, height - 0.1}, 0.09, 0.1});
}

std::string object_name(ObjectKind kind) {
  constexpr std::array kNames = {"wall",   "post",   "fence",   "vehicle",
                                 "person", "walker", "follower"};
  return kNames.at(static_cast<std::size_t>(kind));
}

ObjectMotion motion_at(const StandObject& object, double time_s) {
  if (!object.track.empty()) return motion_on_track(object, time_s);
  if (object.walk_m <= 0.0) return {object.foot, Eigen::Vector2d::Zero()};
  const double way =
      std::fmod(object.start_m + object.speed_m_s * std::max(0.0, time_s), 2.0 * object.walk_m);
  const bool back = way > object.walk_m;
  const double from_start = back ? 2.0 * object.walk_m - way : way;
  const double at = from_start / kGroundStep;
  const auto low = std::min(object.ground_m.size() - 2, static_cast<std::size_t>(at));
  const double share = at - static_cast<double>(low);
  const Eigen::Vector2d along(std::cos(object.yaw_rad), std::sin(object.yaw_rad));
  ObjectMotion motion;
  motion.foot = in_world(object, {from_start - 0.5 * object.walk_m, 0.0, 0.0});
  motion.foot.z() +=
      object.ground_m[low] + share * (object.ground_m[low + 1] - object.ground_m[low]);
  motion.velocity = (back ? -1.0 : 1.0) * object.speed_m_s * along;
  return motion;
}

void add_objects(const ObjectsConfig& config, const Terrain& terrain, const Route& route,
                 std::uint64_t seed, Stand& stand) {
  Random random(hash_numbers(seed, stream_of(NoiseStream::kObjects)));
  const std::array<std::pair<ObjectKind, int>, 6> wanted = {
      {{ObjectKind::kWall, config.houses},
       {ObjectKind::kVehicle, config.vehicles},
       {ObjectKind::kFence, config.fences},
       {ObjectKind::kWalker, config.walkers},
       {ObjectKind::kPerson, config.people},
       {ObjectKind::kPost, config.posts}}};
  for (const auto& [kind, count] : wanted) {
    for (int i = 0; i < count; ++i) {
      StandObject object = new_object(kind, random);
      if (!find_room({config, terrain, route}, stand.objects, random, object)) continue;
      if (kind == ObjectKind::kFence) make_fence(object, terrain, random);
      if (kind == ObjectKind::kWalker) level_walk(object, terrain);
      stand.objects.push_back(object);
      make_room(object, stand);
      if (kind != ObjectKind::kWall) continue;
      stand.objects.push_back(second_wall(object, route, random));
      make_room(stand.objects.back(), stand);
    }
  }
}

}  // namespace understory
