#include "understory/pipeline/judgement/path_evidence.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "understory/pipeline/pipeline_constants.h"

namespace understory {
namespace {

using namespace pipeline_constants::path_evidence;

// The value that this share of the values does not exceed; 0 where there are none.
double quantile(std::vector<float> values, double share) {
  if (values.empty()) return 0.0;
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return static_cast<double>(values[static_cast<std::size_t>(at)]);
}

double largest(const std::vector<float>& values) {
  return values.empty() ? 0.0
                        : static_cast<double>(*std::max_element(values.begin(), values.end()));
}

}  // namespace

void describe(ConfigTable& table, MotionLimits& config) {
  table.add("speed_m_s", config.speed_m_s, {0.1, 1000.0}, "m/s",
            "a faster step from scan to scan is one that no carrier makes");
  table.add("acceleration_m_s2", config.acceleration_m_s2, {0.1, 10000.0}, "m/s^2",
            "the same for the change of speed over two steps");
  table.add("turn_rate_deg_s", config.turn_rate_deg_s, {1.0, 100000.0}, "deg/s",
            "the same for the turn from scan to scan");
  table.add("min_bend_m", config.min_bend_m, {0.0, 10.0}, "m",
            "an acceleration counts where a scan lies farther than this off the line between its "
            "neighbours");
}

void PathEvidence::add(const StampedPose& pose) {
  if (!last_.empty()) {
    const StampedPose& before = last_.back();
    const double step_s = to_seconds(pose.stamp - before.stamp);
    if (step_s < kShortestStepS) return;
    longest_step_s_ = std::max(longest_step_s_, step_s);
    const Pose step = before.world_from_body.inverse() * pose.world_from_body;
    const double speed = step.translation().norm() / step_s;
    const double turn_rate = step.angle() / step_s * 180.0 / std::numbers::pi;
    bool impossible = speed > limits_.speed_m_s || turn_rate > limits_.turn_rate_deg_s;
    speeds_.push_back(static_cast<float>(speed));
    turn_rates_.push_back(static_cast<float>(turn_rate));
    if (last_.size() == 2) {
      const double before_s = to_seconds(before.stamp - last_.front().stamp);
      const Eigen::Vector3d& first = last_.front().world_from_body.translation();
      const Eigen::Vector3d& third = pose.world_from_body.translation();
      const double share = before_s / (before_s + step_s);
      const double bend =
          (before.world_from_body.translation() - ((1.0 - share) * first + share * third)).norm();
      const double acceleration = 2.0 * bend / (before_s * step_s);
      accelerations_.push_back(static_cast<float>(acceleration));
      impossible =
          impossible || (bend > limits_.min_bend_m && acceleration > limits_.acceleration_m_s2);
      last_.erase(last_.begin());
    }
    impossible_ += impossible ? 1 : 0;
  }
  last_.push_back(pose);
}

MotionEvidence PathEvidence::evidence() const {
  MotionEvidence motion;
  motion.steps = speeds_.size();
  motion.speed_p99_m_s = quantile(speeds_, kUsual);
  motion.acceleration_p99_m_s2 = quantile(accelerations_, kUsual);
  motion.turn_rate_p99_deg_s = quantile(turn_rates_, kUsual);
  motion.fastest_m_s = largest(speeds_);
  motion.hardest_m_s2 = largest(accelerations_);
  motion.impossible = impossible_;
  motion.longest_step_s = longest_step_s_;
  return motion;
}

}  // namespace understory
