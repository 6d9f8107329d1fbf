#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "understory/simulation/carrier/route.h"
#include "understory/simulation/scene/terrain.h"
#include "understory/simulation/site.h"

namespace understory {

// Species that differ in crown, bark and branches.
enum class Species { kPine, kSpruce, kBirch };
// The name of a species in lists of trees and in the truth.
[[nodiscard]] std::string species_name(Species species);

// One standing tree, in the world frame. (sensor/tree.h has the Tree that is measured; two types of
// one name in a namespace would share the code of their containers.)
struct GrownTree {
  static constexpr double kBreastHeight = 1.3;  // metres

  int id = 0;                                      // 1, 2, ...
  Eigen::Vector3d foot = Eigen::Vector3d::Zero();  // centre of the stem on the ground
  Species species = Species::kPine;
  double dbh_m = 0.0;  // diameter 1.3 m above the foot, whatever the slope
  double height_m = 0.0;
  double crown_base_m = 0.0;  // above the foot
  double crown_radius_m = 0.0;
  Eigen::Vector2d lean = Eigen::Vector2d::Zero();   // metres sideways per metre of height
  Eigen::Vector2d sweep = Eigen::Vector2d::Zero();  // bow of the stem at half its height, metres
  double yaw_rad = 0.0;                             // turns its crown
  double bark_reflectivity = 0.3;
  double fork_m = 0.0;    // height above the foot where a second stem leaves, 0 = none
  double broken_m = 0.0;  // height above the foot where the top is broken off, 0 = whole
  std::string cloud;      // file of a scanned tree that stands here instead of a grown one

  // Diameter of the stem at a height above the foot, metres; 0 at the top.
  [[nodiscard]] double diameter(double height_m_above_foot) const;
  // Centre of the stem at that height, world frame.
  [[nodiscard]] Eigen::Vector3d centre(double height_m_above_foot) const;
  // Heights above the foot at which the stem is measured off into cones; the first lies below the
  // ground, the last is the top.
  [[nodiscard]] std::vector<double> joints() const;
  // Centre and radius of the stem at a joint.
  struct Joint {
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    double radius_m = 0.0;
  };
  [[nodiscard]] Joint joint(double height_m_above_foot) const;
  // The same of the second stem of a fork, from fork_m up.
  [[nodiscard]] Joint fork_joint(double height_m_above_foot) const;
  // Tilt of the stem's lowest 3 m against the vertical.
  [[nodiscard]] double lean_deg() const;
};

// A piece of dead wood: a cone from one end to the other.
struct Wood {
  Eigen::Vector3d from = Eigen::Vector3d::Zero();
  Eigen::Vector3d to = Eigen::Vector3d::Zero();
  double radius_from_m = 0.1;
  double radius_to_m = 0.1;
};

// Kinds of undergrowth.
enum class PlantKind { kSeedling, kShrub, kGroundPlants };
// A plant of the undergrowth, world frame.
struct Plant {
  PlantKind kind = PlantKind::kShrub;
  Eigen::Vector3d foot = Eigen::Vector3d::Zero();
  double height_m = 1.0;
  double yaw_rad = 0.0;
};

// A house: a box with a pitched roof, its floor's middle on the ground.
struct Building {
  Eigen::Vector3d foot = Eigen::Vector3d::Zero();
  double yaw_rad = 0.0;
  Eigen::Vector3d size_m = Eigen::Vector3d(9.0, 6.0, 3.0);  // length, width, height of the walls
};

// Kinds of things that are no trees. A wall is one side of a building.
enum class ObjectKind { kWall, kPost, kFence, kVehicle, kPerson, kWalker, kFollower };

// A thing that is no tree, made of boards and rods. Its own frame has the origin at its foot on the
// ground, x along its length, z up.
struct StandObject {
  // A box with its edges along the axes.
  struct Board {
    Eigen::Vector3d low = Eigen::Vector3d::Zero();
    Eigen::Vector3d high = Eigen::Vector3d::Zero();
  };

  ObjectKind kind = ObjectKind::kPost;
  Eigen::Vector3d foot = Eigen::Vector3d::Zero();    // world frame; of a walker: middle of its line
  double yaw_rad = 0.0;                              // of its length, from east to north
  Eigen::Vector3d size_m = Eigen::Vector3d::Zero();  // length, width, height above the foot
  std::vector<Board> boards;
  std::vector<Wood> rods;
  // A walker goes to and fro over this length along its yaw; 0: it stands.
  double walk_m = 0.0;
  double speed_m_s = 0.0;
  double start_m = 0.0;          // how far it has come at time zero
  std::vector<double> ground_m;  // along its line, evenly apart, over the foot
  // Places of a follower's foot, world frame, from the path's zero on; empty: it does not follow.
  std::vector<Eigen::Vector3d> track;
  double track_step_s = 0.05;  // from one to the next
};

// All that grows and lies in a site.
struct Stand {
  std::vector<GrownTree> trees;
  std::vector<Wood> dead_wood;  // stumps and logs
  std::vector<Plant> plants;
  std::vector<Wood> boulders;
  std::vector<Building> buildings;
  std::vector<StandObject> objects;
};

// Places trees and undergrowth at random in the stand's rectangle, clear of the route; or the trees
// of the list config.trees as they are. Throws InputError for a bad list.
[[nodiscard]] Stand grow_stand(const StandConfig& config, const CarrierConfig& carrier,
                               const Terrain& terrain, const Route& route, std::uint64_t seed);

// Reads a list of trees: a CSV with a head line of column names. Needed are x, y (metres in the
// world frame) and dbh_m. Used where given and not empty: id, height_m, lean_deg, species (pine,
// spruce, birch), cloud. A cloud is the file of a scanned tree, beside the list if its path is
// relative, stretched to height_m where that is given. Others are passed over, z too: trees stand
// on the terrain. What the list leaves open is drawn as for random trees. Throws InputError with
// file, line and what was expected.
[[nodiscard]] std::vector<GrownTree> read_trees(const std::string& path, const StandConfig& config,
                                                const Terrain& terrain, std::uint64_t seed);
// Paths of the clouds that a list of trees names in its column `cloud`, each once; none if there is
// no such list.
[[nodiscard]] std::vector<std::string> tree_cloud_files(const std::string& list);

}  // namespace understory
