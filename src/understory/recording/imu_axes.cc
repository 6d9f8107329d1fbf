#include "understory/recording/imu_axes.h"

#include <algorithm>
#include <cmath>

#include "understory/recording/recording_constants.h"

namespace understory {
namespace {

using namespace recording_constants::imu_axes;

}  // namespace

ImuAxisCheck::ImuAxisCheck() {
  const char* names[] = {"x", "y", "z"};
  int order[] = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Candidate candidate;
      candidate.axes.setZero();
      for (int row = 0; row < 3; ++row) {
        const bool negative = ((signs >> row) & 1) != 0;
        candidate.axes(row, order[row]) = negative ? -1.0 : 1.0;
        candidate.name +=
            (row > 0 ? " " : "") + std::string(negative ? "-" : "") + names[order[row]];
      }
      candidates_.push_back(candidate);
    }
  } while (std::next_permutation(std::begin(order), std::end(order)));
}

void ImuAxisCheck::add(const ImuSample& sample) {
  const TimeNs step = sample.stamp - last_;
  last_ = sample.stamp;
  if (step <= 0 || step > kLongestSampleStep) {  // a gap, or the first one
    window_ = {};
    windows_.clear();
    window_.start = sample.stamp;
    return;
  }
  window_.turn += sample.angular_rate * to_seconds(step);
  window_.force += sample.specific_force;
  ++window_.samples;
  if (sample.stamp - window_.start >= kTiltWindow) close_window();
}

// The mean force of a window stands for its middle. From the middle of the first to that of the
// third the turn is half of the outer windows' and all of the middle one's.
void ImuAxisCheck::close_window() {
  windows_.push_back(window_);
  const TimeNs end = last_;
  window_ = {};
  window_.start = end;
  if (windows_.size() < 3) return;
  const Window a = windows_[0];
  const Window c = windows_[2];
  const Eigen::Vector3d turn = 0.5 * a.turn + windows_[1].turn + 0.5 * c.turn;
  const Eigen::Vector3d up_a = a.force.normalized();
  const Eigen::Vector3d up_c = c.force.normalized();
  windows_.pop_front();
  const double tilt = (up_c - up_a).norm();
  if (!up_a.allFinite() || !up_c.allFinite() || tilt < kLeastTilt || tilt > kMostTilt) return;
  // Accelerations of the carrier change the length of the force as well.
  if (std::abs(a.force.norm() / a.samples - c.force.norm() / c.samples) >
      kSameForce * a.force.norm() / a.samples)
    return;
  const Eigen::Vector3d seen = up_c - up_a;
  const Eigen::Vector3d middle = (up_a + up_c).normalized();
  seen_ += seen.squaredNorm();
  for (Candidate& candidate : candidates_) {
    const Eigen::Vector3d predicted = -(candidate.axes * turn).cross(middle);
    candidate.residual += (seen - predicted).squaredNorm();
    candidate.product += seen.dot(predicted);
    candidate.predicted += predicted.squaredNorm();
  }
}

// The candidate that explains the tilts best at a scale of its own.
const ImuAxisCheck::Candidate* ImuAxisCheck::best() const {
  if (seen_ < kEnoughTilt) return nullptr;
  const auto explained = [](const Candidate& c) {
    return c.product > 0.0 && c.predicted > 0.0 ? c.product * c.product / c.predicted : 0.0;
  };
  const Candidate* best = &candidates_.front();  // the axes as they are
  // Others only if they are far better: turns about the vertical leave several equally good.
  for (const Candidate& candidate : candidates_) {
    const double left = seen_ - explained(candidate);
    const double left_best = seen_ - explained(*best);
    const double factor = best == &candidates_.front() ? kFarBetter : kBetter;
    if (left < factor * left_best && left < kGoodFit * seen_) best = &candidate;
  }
  return seen_ - explained(*best) < kGoodFit * seen_ ? best : nullptr;
}

std::string ImuAxisCheck::result() const {
  const Candidate* candidate = best();
  return candidate == nullptr ? "" : candidate->name;
}

double ImuAxisCheck::rate_scale() const {
  const Candidate* candidate = best();
  return candidate == nullptr ? 0.0 : candidate->product / candidate->predicted;
}

}  // namespace understory
