#pragma once

#include <Eigen/Core>
#include <limits>

namespace understory {

// An upright rectangle on the ground, metres, without its upper edges; by default the whole plane.
struct GroundArea {
  static constexpr double kEndless = std::numeric_limits<double>::infinity();

  Eigen::Vector2d low = Eigen::Vector2d::Constant(-kEndless);
  Eigen::Vector2d high = Eigen::Vector2d::Constant(kEndless);

  [[nodiscard]] bool contains(const Eigen::Vector2d& place) const {
    return place.x() >= low.x() && place.y() >= low.y() && place.x() < high.x() &&
           place.y() < high.y();
  }
  // Whether it shares a place with the rectangle between two corners.
  [[nodiscard]] bool touches(const Eigen::Vector2d& from, const Eigen::Vector2d& to) const {
    return (from.array() < high.array()).all() && (to.array() >= low.array()).all();
  }
  // The same with a border of so many metres around it.
  [[nodiscard]] GroundArea grown(double by_m) const {
    return {low.array() - by_m, high.array() + by_m};
  }
  [[nodiscard]] GroundArea moved(const Eigen::Vector2d& by) const { return {low + by, high + by}; }
};

}  // namespace understory
