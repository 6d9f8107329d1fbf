#include "understory/calibration/imu_noise/standing_watch.h"

#include <cmath>

#include "understory/calibration/calibration_constants.h"

namespace understory {

using namespace calibration_constants::standing_watch;

void StandingWatch::begin_window(TimeNs stamp) {
  window_from_ = stamp;
  count_ = 0;
  sum_.setZero();
  squares_.setZero();
}

void StandingWatch::end_stretch() {
  if (standing_) done_.push_back(stretch_);
  standing_ = false;
}

bool StandingWatch::is_quiet(const Vector6d& mean) const {
  const auto count = static_cast<double>(count_);
  const Vector6d of_first = sum_ / count;
  const Vector6d variance = squares_ / count - of_first.cwiseAbs2();
  if (!(variance.head<3>().sum() < kMostTurning * kMostTurning)) return false;
  if (!(variance.tail<3>().sum() < kMostShaking * kMostShaking)) return false;
  if (!standing_) return true;
  return (mean - stretch_mean_).head<3>().norm() < kMostTurn &&
         (mean - stretch_mean_).tail<3>().norm() < kMostTilt;
}

void StandingWatch::close_window() {
  const Vector6d mean = first_ + sum_ / static_cast<double>(count_);
  if (!is_quiet(mean)) {
    end_stretch();
    return;
  }
  if (!standing_) {
    standing_ = true;
    stretch_.from = window_from_;
    stretch_mean_ = mean;
  }
  stretch_.to = last_;
  stretch_mean_ += kFollow * (mean - stretch_mean_);
}

void StandingWatch::add(const ImuSample& sample) {
  Vector6d value;
  value << sample.angular_rate, sample.specific_force;
  if (count_ > 0 && to_seconds(sample.stamp - last_) > kLongestGapS) {
    close_window();
    end_stretch();
    begin_window(sample.stamp);
  } else if (count_ > 0 && to_seconds(sample.stamp - window_from_) >= kWindowS) {
    close_window();
    begin_window(sample.stamp);
  } else if (count_ == 0) {
    begin_window(sample.stamp);
  }
  if (count_ == 0) first_ = value;
  ++count_;
  last_ = sample.stamp;
  sum_ += value - first_;
  squares_ += (value - first_).cwiseAbs2();
}

std::vector<StandingStretch> StandingWatch::stretches() const {
  StandingWatch copy = *this;
  // A window that has hardly begun tells nothing: its mean is that of a few samples.
  const bool hardly_begun = to_seconds(copy.last_ - copy.window_from_) < 0.5 * kWindowS;
  if (copy.standing_ && hardly_begun) {
    copy.stretch_.to = copy.last_;
  } else if (copy.count_ > 0) {
    copy.close_window();
  }
  copy.end_stretch();
  return copy.done_;
}

}  // namespace understory
