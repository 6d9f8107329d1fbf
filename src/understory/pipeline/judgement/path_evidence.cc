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
            "a larger acceleration over two steps is one that no carrier makes");
  table.add("turn_rate_deg_s", config.turn_rate_deg_s, {1.0, 100000.0}, "deg/s",
            "a faster turn from scan to scan is one that no carrier makes");
  table.add("min_bend_m", config.min_bend_m, {0.0, 10.0}, "m",
            "an acceleration counts where a scan lies farther than this off the line between its "
            "neighbours");
}

void PathEvidence::add(const StampedPose& pose) {
  bool impossible = false;
  if (last_.empty()) {
    origin_ = pose.world_from_body.translation();
  } else {
    const StampedPose& before = last_.back();
    const double step_s = to_seconds(pose.stamp - before.stamp);
    if (step_s < kShortestStepS) return;
    longest_step_s_ = std::max(longest_step_s_, step_s);
    const Pose step = before.world_from_body.inverse() * pose.world_from_body;
    const double speed = step.translation().norm() / step_s;
    const double turn_rate = step.angle() / step_s * 180.0 / std::numbers::pi;
    impossible = speed > limits_.speed_m_s || turn_rate > limits_.turn_rate_deg_s;
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
  places_.push_back(
      {pose.stamp, (pose.world_from_body.translation() - origin_).cast<float>(), impossible});
}

// How far the path between two poses is longer or shorter than the speeds before and after it make
// one expect, metres.
double PathEvidence::jump_m(std::size_t first, std::size_t last) const {
  const auto speed_between = [&](std::size_t from, std::size_t to) -> Eigen::Vector3f {
    const double seconds = to_seconds(places_[to].stamp - places_[from].stamp);
    return (places_[to].position - places_[from].position) / static_cast<float>(seconds);
  };
  std::size_t before = first;
  while (before > 0 && places_[first].stamp - places_[before].stamp < kJumpBase)
    --before;
  std::size_t after = last;
  while (after + 1 < places_.size() && places_[after].stamp - places_[last].stamp < kJumpBase)
    ++after;
  if (before == first && after == last) return 0.0;  // nothing else is known of the path
  Eigen::Vector3f speed = Eigen::Vector3f::Zero();
  if (before < first) speed += speed_between(before, first);
  if (after > last) speed += speed_between(last, after);
  if (before < first && after > last) speed *= 0.5F;
  const auto seconds = static_cast<float>(to_seconds(places_[last].stamp - places_[first].stamp));
  return static_cast<double>(
      (places_[last].position - places_[first].position - speed * seconds).norm());
}

// Impossible steps that follow each other closely are one jump. It begins two poses before the
// first of them, where the motion was still a carrier's. A scan at a wrong place returns, and jumps
// by nothing.
void PathEvidence::find_jump(MotionEvidence& motion) const {
  for (std::size_t i = 0; i < places_.size(); ++i) {
    if (!places_[i].impossible) continue;
    std::size_t last = i;
    for (std::size_t k = i + 1;
         k < places_.size() && places_[k].stamp - places_[last].stamp <= kJumpGap; ++k) {
      if (places_[k].impossible) last = k;
    }
    const double jump = jump_m(i < 2 ? 0 : i - 2, last);
    if (jump > motion.jump_m) {
      motion.jump_m = jump;
      motion.jump_stamp = places_[last].stamp;
    }
    i = last;
  }
}

MotionEvidence PathEvidence::evidence() const {
  MotionEvidence motion;
  motion.steps = speeds_.size();
  motion.speed_p99_m_s = quantile(speeds_, kUsual);
  motion.acceleration_p95_m_s2 = quantile(accelerations_, kOften);
  motion.acceleration_p99_m_s2 = quantile(accelerations_, kUsual);
  motion.turn_rate_p99_deg_s = quantile(turn_rates_, kUsual);
  motion.fastest_m_s = largest(speeds_);
  motion.hardest_m_s2 = largest(accelerations_);
  motion.impossible = impossible_;
  motion.longest_step_s = longest_step_s_;
  find_jump(motion);
  return motion;
}

}  // namespace understory
