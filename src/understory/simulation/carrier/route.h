#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "understory/simulation/site.h"
#include "understory/util/random.h"

namespace understory {

// Where the carrier goes, seen from above: a smooth curve through the stand, by its length.
// Immutable, thread-safe.
class Route {
 public:
  // A loop: a closed curve of config.length_m that winds config.laps times around the middle of the
  // stand, and that config.rounds times on the same way. A strip road: of config.length_m if it is
  // driven one way, else of half that length. Beside it the other roads of the stand, on which
  // nobody drives today. Roads of even numbers are driven westwards.
  Route(const CarrierConfig& config, std::uint64_t seed);

  [[nodiscard]] double length_m() const {
    return step_m_ * static_cast<double>(points_.size() - 1);
  }
  // Place and direction (radians from east, unwrapped) at a distance from the start; clamped.
  [[nodiscard]] Eigen::Vector2d place(double distance_m) const;
  [[nodiscard]] double heading(double distance_m) const;
  // Smallest distance of a place to the curve (where the stand has several roads: to any of them).
  [[nodiscard]] double distance_to(const Eigen::Vector2d& place) const;
  // Whether a place lies within a distance of the curve.
  [[nodiscard]] bool near(const Eigen::Vector2d& place, double distance_m) const;
  // Smallest distance to a stretch of the curve, given by shares of its length.
  [[nodiscard]] double distance_to(const Eigen::Vector2d& place, double from, double to) const;

 private:
  void make_points(const CarrierConfig& config, std::uint64_t seed);
  void resample(const std::vector<Eigen::Vector2d>& dense, double length_m);
  void repeat(int rounds);
  void make_roads(const CarrierConfig& config, Random& random);

  // Points that follow each other, and a circle around them. A search skips whole circles.
  struct Stretch {
    Eigen::Vector2d middle;
    double radius_m = 0.0;
    std::size_t first = 0;
    std::size_t end = 0;
  };
  static std::vector<Stretch> stretches_of(const std::vector<Eigen::Vector2d>& points);
  static double least_distance(const std::vector<Eigen::Vector2d>& points,
                               const std::vector<Stretch>& stretches, const Eigen::Vector2d& place);

  double step_m_ = 0.25;
  std::vector<Eigen::Vector2d> points_;  // step_m_ apart
  std::vector<Stretch> stretches_;       // of points_
  std::vector<double> headings_;
  // Points along all roads of the stand where there are several: the same whichever is driven, so
  // that the trees beside them are. Those of one round where there are several.
  std::vector<Eigen::Vector2d> roads_;
  std::vector<Stretch> road_stretches_;  // of roads_
};

}  // namespace understory
