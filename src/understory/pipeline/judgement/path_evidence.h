#pragma once

#include <cstddef>
#include <vector>

#include "understory/geometry/stamped_pose.h"
#include "understory/pipeline/judgement/run_evidence.h"
#include "understory/util/config/config.h"

namespace understory {

// Motions that no carrier of a scanner makes: not a walker, a harvester, a sleigh, an aircraft that
// flies among trees, or a car. Beyond them the path, or the times of its scans, cannot be right.
struct MotionLimits {
  double speed_m_s = 50.0;
  double acceleration_m_s2 = 30.0;  // a stumble of a walker reaches 15
  double turn_rate_deg_s = 720.0;   // a quick turn on foot reaches 200
  // An acceleration counts only where it moves a scan by more than this off the line between its
  // neighbours: what remains is noise of matching.
  double min_bend_m = 0.1;
};
void describe(ConfigTable& table, MotionLimits& config);

// Gathers speeds, accelerations and turn rates of a path, pose by pose in order of time. Memory: 36
// bytes a pose. Not thread-safe.
class PathEvidence {
 public:
  explicit PathEvidence(const MotionLimits& limits) : limits_(limits) {}

  void add(const StampedPose& pose);
  [[nodiscard]] MotionEvidence evidence() const;

 private:
  // Where the path was; `impossible`: the step to here, or the bend at the pose before.
  struct Place {
    TimeNs stamp = 0;
    Eigen::Vector3f position = Eigen::Vector3f::Zero();  // m, from the first pose
    bool impossible = false;
  };

  // The largest jump of the path that stays.
  void find_jump(MotionEvidence& motion) const;
  [[nodiscard]] double jump_m(std::size_t first, std::size_t last) const;

  MotionLimits limits_;
  std::vector<StampedPose> last_;  // at most two
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  std::vector<Place> places_;
  std::vector<float> speeds_;
  std::vector<float> accelerations_;
  std::vector<float> turn_rates_;
  std::uint64_t impossible_ = 0;
  double longest_step_s_ = 0.0;
};

}  // namespace understory
