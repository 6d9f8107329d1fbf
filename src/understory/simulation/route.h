#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "understory/simulation/site.h"

namespace understory {

// Where the carrier goes, seen from above: a smooth curve through the stand, by its length.
// Immutable, thread-safe.
class Route {
 public:
  // `walk`: a closed loop of config.length_m around the middle of the stand. `harvester`: a strip
  // road of half that length, driven out and back.
  Route(const CarrierConfig& config, std::uint64_t seed);

  [[nodiscard]] double length_m() const {
    return step_m_ * static_cast<double>(points_.size() - 1);
  }
  // Place and direction (radians from east, unwrapped) at a distance from the start; clamped.
  [[nodiscard]] Eigen::Vector2d place(double distance_m) const;
  [[nodiscard]] double heading(double distance_m) const;
  // Smallest distance of a place to the curve.
  [[nodiscard]] double distance_to(const Eigen::Vector2d& place) const;

 private:
  void resample(const std::vector<Eigen::Vector2d>& dense, double length_m);

  double step_m_ = 0.25;
  std::vector<Eigen::Vector2d> points_;  // step_m_ apart
  std::vector<double> headings_;
};

}  // namespace understory
