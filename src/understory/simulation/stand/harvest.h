#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/simulation/stand/stand.h"

// What a harvester does to the stand. Times count from the path's zero, heights along a stem from
// the tree's foot, metres.
namespace understory {

struct CarrierPlan;

// A tree that is cut. It is gripped where it stands, felled to one side of the boom, fed through
// the head (which strips its branches) and cut into logs.
struct Felling {
  int tree = 0;
  double grab_s = 0.0;         // cut off its stump: from here on it hangs in the head
  double fall_s = 0.0;         // when it begins to fall
  double level_s = 0.0;        // when it lies level: the moment of the shock
  double feed_s = 0.0;         // when it begins to be fed through the head
  double drop_s = 0.0;         // when the last log and the top fall
  double side = 1.0;           // the way it falls: 1 to the left of the boom, -1 to the right
  std::vector<double> cuts_m;  // upwards, one for each log, evenly apart in time

  // When a log, by its number, is cut off.
  [[nodiscard]] double cut_s(std::size_t log) const;
  // Where along the stem the head holds it.
  [[nodiscard]] double held_m(double time_s) const;
  // What is left of the stem begins here.
  [[nodiscard]] double rest_m(double time_s) const;
};
constexpr double kStumpHeight = 0.15;

// Where a cut tree is at one moment. Its frame has the world's axes while it stands and its origin
// at the foot.
struct HeldTree {
  int tree = 0;
  Pose world_from_tree;
  double stem_from_m = 0.0;   // what is left of the stem begins here
  double crown_from_m = 0.0;  // and its branches here
};

// A log that falls out of the head and then lies where it fell.
struct FallenLog {
  double cut_s = 0.0;
  double lies_s = 0.0;
  Wood held;  // at the moment of the cut
  Wood lying;
  [[nodiscard]] Wood at(double time_s) const;  // from cut_s to lies_s
};

// Branches and tops on the ground.
struct Brash {
  double from_s = 0.0;
  Plant plant;
};

// All that a thinning cuts and leaves behind.
struct Harvest {
  std::vector<Felling> fellings;  // one after another
  std::vector<FallenLog> logs;    // by their time
  std::vector<Brash> brash;
};

// The cuts of a stem: logs of about 4.3 m up to a diameter of 7 cm; one at least.
[[nodiscard]] std::vector<double> cuts_of(const GrownTree& tree);

// Middle of the harvester head in the body frame, for the reach and the height of the boom's tip.
[[nodiscard]] Eigen::Vector3d head_in_body(const Eigen::Vector2d& boom);

// The tree in the head at a time, if there is one. `tree` is the one that `felling` names.
[[nodiscard]] HeldTree held_tree(const CarrierPlan& plan, const Felling& felling,
                                 const GrownTree& tree, double time_s);

// Works out where the logs and branches of the plan's fellings come to lie.
void lay_out_logs(CarrierPlan& plan, const Stand& stand, const Terrain& terrain);

}  // namespace understory
