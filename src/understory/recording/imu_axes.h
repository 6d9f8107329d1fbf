#pragma once

#include <Eigen/Core>
#include <array>
#include <deque>
#include <string>
#include <vector>

#include "understory/sensor/imu_sample.h"

namespace understory {

// Finds out whether an IMU's gyroscope and accelerometer use the same axes. While the IMU tilts,
// the direction of gravity turns against the angular rate: d up / dt = -omega x up. Each of the 48
// ways to take the gyroscope's axes is tried on windows of half a second. Constant memory. Not
// thread-safe.
class ImuAxisCheck {
 public:
  ImuAxisCheck();
  void add(const ImuSample& sample);
  // "x y z" where the axes agree, "y -x z" and so on where another way fits far better. Empty if
  // there was too little tilting to tell.
  [[nodiscard]] std::string result() const;
  // The factor that makes angular rates fit the tilts, with the axes of `result`. It is 1 in a
  // consistent IMU, 0.017 if the rates are in degrees. 0 if unknown.
  [[nodiscard]] double rate_scale() const;

 private:
  struct Window {
    TimeNs start = 0;
    Eigen::Vector3d force = Eigen::Vector3d::Zero();
    Eigen::Vector3d turn = Eigen::Vector3d::Zero();  // integral of the angular rate, rad
    int samples = 0;
  };
  struct Candidate {
    Eigen::Matrix3d axes;
    std::string name;
    double residual = 0.0;   // of the tilts by this candidate at scale 1
    double product = 0.0;    // of predicted and seen tilts
    double predicted = 0.0;  // squared
  };
  void close_window();
  [[nodiscard]] const Candidate* best() const;

  std::vector<Candidate> candidates_;
  Window window_;
  std::deque<Window> windows_;
  TimeNs last_ = 0;
  double seen_ = 0.0;  // squared tilts
};

}  // namespace understory
