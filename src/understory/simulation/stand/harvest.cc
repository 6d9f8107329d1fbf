#include "understory/simulation/stand/harvest.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "understory/simulation/carrier/carrier.h"
#include "understory/simulation/carrier/motion.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr double kGrip = kStumpHeight + 0.6;  // where the head takes a standing stem
constexpr double kLog = 4.3;
constexpr double kThinnest = 0.07;   // of a log's upper end, diameter
constexpr double kDrop = 0.45;       // seconds that a log falls
constexpr double kLift = 1.0;        // seconds in which the head draws the stem to itself
constexpr double kBoomSide = -0.75;  // the boom stands to the right of the body's middle
constexpr double kPillar = 0.9;      // and so far ahead
constexpr double kHeadBelowTip = 0.75;

Eigen::Vector3d head_at(const CarrierPlan& plan, double time_s) {
  return plan.path.pose(time_s) * head_in_body(plan.boom.value(time_s));
}

double yaw_at(const CarrierPlan& plan, double time_s) {
  const Eigen::Matrix3d rotation = plan.path.pose(time_s).rotation_matrix();
  return std::atan2(rotation(1, 0), rotation(0, 0));
}

const GrownTree& tree_of(const Stand& stand, int id) {
  const auto found = std::find_if(stand.trees.begin(), stand.trees.end(),
                                  [&](const GrownTree& tree) { return tree.id == id; });
  UNDERSTORY_CHECK(found != stand.trees.end());
  return *found;
}

// The piece of wood on the ground below where it was let go.
Wood on_ground(const Wood& piece, const Terrain& terrain) {
  Wood lying = piece;
  for (auto [end, radius] :
       {std::pair(&lying.from, lying.radius_from_m), std::pair(&lying.to, lying.radius_to_m)}) {
    end->z() = terrain.smooth_height(end->x(), end->y(), 0.3) + radius;
  }
  return lying;
}

}  // namespace

double Felling::cut_s(std::size_t log) const {
  return feed_s +
         (drop_s - feed_s) * static_cast<double>(log + 1) / static_cast<double>(cuts_m.size());
}

double Felling::held_m(double time_s) const {
  double held = kGrip;
  const double part = (drop_s - feed_s) / static_cast<double>(cuts_m.size());
  for (std::size_t i = 0; i < cuts_m.size(); ++i) {
    const double begin = feed_s + part * static_cast<double>(i);
    if (time_s <= begin) break;
    // Fed in a good half of the time, then the saw comes round.
    held += (cuts_m[i] - held) * motion::ease((time_s - begin) / (0.6 * part));
  }
  return held;
}

double Felling::rest_m(double time_s) const {
  double rest = kStumpHeight;
  for (std::size_t i = 0; i < cuts_m.size() && time_s >= cut_s(i); ++i)
    rest = cuts_m[i];
  return rest;
}

Wood FallenLog::at(double time_s) const {
  const double share = std::clamp((time_s - cut_s) / (lies_s - cut_s), 0.0, 1.0);
  Wood wood = lying;
  wood.from = held.from + share * share * (lying.from - held.from);
  wood.to = held.to + share * share * (lying.to - held.to);
  return wood;
}

std::vector<double> cuts_of(const GrownTree& tree) {
  const double end = tree.broken_m > 0.0 ? tree.broken_m : tree.height_m;
  std::vector<double> cuts;
  for (double at = kStumpHeight + kLog; at < end; at += kLog) {
    if (tree.diameter(at) < kThinnest) break;
    cuts.push_back(at);
  }
  if (cuts.empty()) cuts.push_back(std::max(kGrip + 0.5, 0.6 * end));
  return cuts;
}

Eigen::Vector3d head_in_body(const Eigen::Vector2d& boom) {
  return {kPillar + boom[0], kBoomSide, boom[1] - kHeadBelowTip};
}

HeldTree held_tree(const CarrierPlan& plan, const Felling& felling, const GrownTree& tree,
                   double time_s) {
  const auto turn = [](double angle, const Eigen::Vector3d& axis) {
    return Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis));
  };
  const auto origin = [&](double time, const Eigen::Quaterniond& rotation) -> Eigen::Vector3d {
    return head_at(plan, time) - rotation * (tree.centre(felling.held_m(time)) - tree.foot);
  };
  const double fallen =
      std::clamp((time_s - felling.fall_s) / (felling.level_s - felling.fall_s), 0.0, 1.0);
  const double tilt = 0.48 * std::numbers::pi * fallen * fallen;
  const Eigen::Quaterniond rotation = turn(yaw_at(plan, time_s), Eigen::Vector3d::UnitZ()) *
                                      turn(-felling.side * tilt, Eigen::Vector3d::UnitX()) *
                                      turn(-yaw_at(plan, felling.grab_s), Eigen::Vector3d::UnitZ());
  // At first it stands where it grew, whatever the head's place; then the head draws it in.
  const Eigen::Vector3d apart = tree.foot - origin(felling.grab_s, Eigen::Quaterniond::Identity());
  const double left = 1.0 - motion::ease((time_s - felling.grab_s) / kLift);
  HeldTree held;
  held.tree = felling.tree;
  held.world_from_tree = Pose(rotation, origin(time_s, rotation) + left * apart);
  held.stem_from_m = felling.rest_m(time_s);
  held.crown_from_m = time_s < felling.feed_s ? 0.0 : felling.held_m(time_s);
  return held;
}

void lay_out_logs(CarrierPlan& plan, const Stand& stand, const Terrain& terrain) {
  Harvest& harvest = plan.harvest;
  for (const Felling& felling : harvest.fellings) {
    const GrownTree& tree = tree_of(stand, felling.tree);
    const auto piece = [&](double time_s, double low_m, double high_m) {
      const HeldTree held = held_tree(plan, felling, tree, time_s - 1e-6);
      const auto at = [&](double height) -> Eigen::Vector3d {
        return held.world_from_tree * (tree.centre(height) - tree.foot);
      };
      return Wood{at(low_m), at(high_m), 0.5 * tree.diameter(low_m), 0.5 * tree.diameter(high_m)};
    };
    double low = kStumpHeight;
    for (std::size_t i = 0; i < felling.cuts_m.size(); ++i) {
      const double cut = felling.cut_s(i);
      const Wood held = piece(cut, low, felling.cuts_m[i]);
      harvest.logs.push_back({cut, cut + kDrop, held, on_ground(held, terrain)});
      low = felling.cuts_m[i];
    }
    // The top falls with the last log, and its branches and those stripped off lie about it.
    const double end = tree.broken_m > 0.0 ? tree.broken_m : tree.height_m;
    const Wood top = piece(felling.drop_s, low, std::max(low + 0.2, end));
    harvest.logs.push_back({felling.drop_s, felling.drop_s + kDrop, top, on_ground(top, terrain)});
    for (const double share : {-0.2, 0.3, 0.7}) {
      const Eigen::Vector3d place = top.from + share * (top.to - top.from);
      Plant plant{PlantKind::kShrub, place, 0.5, 2.0 * share};
      plant.foot.z() = terrain.height(place.x(), place.y());
      harvest.brash.push_back({felling.drop_s + kDrop, plant});
    }
  }
}

}  // namespace understory
