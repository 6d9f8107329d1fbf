#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "understory/simulation/carrier/route.h"
#include "understory/simulation/scene/terrain.h"
#include "understory/simulation/site.h"
#include "understory/simulation/stand/stand.h"
#include "understory/util/random.h"

// Things among the trees that are none: a map that lists one of them as a tree is wrong.
namespace understory {

// Binds the keys of objects.* to `config`.
void describe_objects(ConfigTable& table, ObjectsConfig& config);

// The name of a kind in objects.csv.
[[nodiscard]] std::string object_name(ObjectKind kind);

// Where a thing is at a time (seconds since the path's zero), and how fast it moves: world frame,
// metres and metres per second. A walker moves to and fro along a straight line, a follower along
// its track; all others stand.
struct ObjectMotion {
  Eigen::Vector3d foot = Eigen::Vector3d::Zero();
  Eigen::Vector2d velocity = Eigen::Vector2d::Zero();
};
[[nodiscard]] ObjectMotion motion_at(const StandObject& object, double time_s);

// Gives a person its limbs; its height is drawn. One who walks or follows is in mid-step.
void shape_person(StandObject& person, Random& random);

// Places the things that `config` asks for beside the route, no two at one place. Trees, plants,
// dead wood and boulders make room. A thing that finds no place in 300 draws is left out. The same
// seed gives the same things.
void add_objects(const ObjectsConfig& config, const Terrain& terrain, const Route& route,
                 std::uint64_t seed, Stand& stand);

}  // namespace understory
