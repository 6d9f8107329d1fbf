#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "understory/simulation/carrier/carrier.h"
#include "understory/simulation/scene/scene.h"
#include "understory/simulation/stand/harvest.h"

namespace understory {

// The carrier's own parts in the lidar's view, in the body frame: round bars (capsules), and what
// a harvester has in its head.
class Machine {
 public:
  // A walker has none; a harvester has wheels, a cabin, a boom that moves along the plan's and
  // trees to fell. `plan` and `stand` must outlive it.
  Machine(const CarrierConfig& config, const CarrierPlan& plan, const Stand& stand);

  // The parts at one moment, to be met by rays given in the body frame.
  struct Bar {
    Eigen::Vector3d from;
    Eigen::Vector3d to;
    double radius_m;
    Surface surface = Surface::kMachine;
  };
  struct Parts {
    std::vector<Bar> bars;
  };
  [[nodiscard]] bool empty() const { return !present_; }
  [[nodiscard]] Parts at(double time_s) const;
  // The tree in the head.
  [[nodiscard]] std::optional<HeldTree> held(double time_s) const;

  // Replaces `hit` where a part is nearer (or where nothing was hit).
  static void cast(const Parts& parts, const Eigen::Vector3d& origin,
                   const Eigen::Vector3d& direction, double near_m, double far_m, Hit& hit);

 private:
  bool present_ = false;
  const CarrierPlan& plan_;
  std::vector<const GrownTree*> trees_;  // of the plan's fellings
};

}  // namespace understory
