#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

namespace understory {

// Where the ground is in one frame: the lowest return of each cell, and planes through those near a
// place. Level frame, metres. Keeps the planes that were asked for: not thread-safe.
class GroundGuess {
 public:
  explicit GroundGuess(const std::vector<Eigen::Vector3f>& points);

  struct Height {
    double height_m = 0.0;
    double sd_m = 0.0;  // 0.1 where the ground shows all around, up to 1 where it hides
  };
  // Height of the ground at a place; nothing where too little was seen near it.
  [[nodiscard]] std::optional<Height> at(const Eigen::Vector2d& place);

 private:
  struct Plane {
    bool known = false;
    Eigen::Vector3d height_and_slope = Eigen::Vector3d::Zero();  // at the middle of the patch
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  };
  // A cell's lowest return, from the middle of a patch.
  struct Low {
    double x, y, z;
    double sharpness;  // 1 / spread
  };
  [[nodiscard]] std::vector<Low> lows_near(const Eigen::Vector2d& middle) const;
  [[nodiscard]] Plane fit(const Eigen::Vector2d& middle) const;

  int columns_ = 0;
  int rows_ = 0;
  int column0_ = 0;
  int row0_ = 0;
  std::vector<Eigen::Vector3f> lowest_;  // row by row; NaN where there is no return
  std::unordered_map<std::int64_t, Plane> planes_;
};

}  // namespace understory
