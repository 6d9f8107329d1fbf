#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "understory/forest/point_blocks.h"
#include "understory/sensor/tree.h"
#include "understory/util/random.h"

namespace understory {

// Metres, z up.
using Cloud = std::vector<Eigen::Vector3d>;

// The whole cloud as one block; it outlives them.
inline PointBlocks blocks_of(const Cloud& cloud) {
  return [&cloud](const PointVisitor& visit) { visit(cloud); };
}

// A plot with a known terrain and known stems.
class TestPlot {
 public:
  explicit TestPlot(std::uint64_t seed) : random_(seed) {}

  double slope_x = 0.0;
  double bump_m = 0.0;

  [[nodiscard]] double ground(double x, double y) const {
    return 100.0 + slope_x * x + bump_m * std::sin(0.4 * x) * std::cos(0.3 * y);
  }
  void add_ground(double side, int per_m2) {
    const int count = static_cast<int>(side * side) * per_m2;
    for (int i = 0; i < count; ++i) {
      const double x = random_.uniform(0.0, side);
      const double y = random_.uniform(0.0, side);
      cloud.emplace_back(x, y, ground(x, y) + random_.normal(0.0, 0.02));
    }
  }
  // More of it in a square around a place.
  void add_ground_at(double x, double y, double half_m, int count) {
    for (int i = 0; i < count; ++i) {
      const double px = x + random_.uniform(-half_m, half_m);
      const double py = y + random_.uniform(-half_m, half_m);
      cloud.emplace_back(px, py, ground(px, py) + random_.normal(0.0, 0.02));
    }
  }
  struct Stem {
    double x, y, dbh;
    double lean_x = 0.0;     // metres per metre
    double arc_deg = 360.0;  // of the circumference that is seen
    int points = 900;        // between the ground and 4 m
    double noise_m = 0.008;
  };
  void add_stem(const Stem& stem) {
    for (int i = 0; i < stem.points; ++i) {
      const double h = random_.uniform(0.1, 4.0);
      const double turn = random_.uniform(0.0, stem.arc_deg * M_PI / 180.0);
      const double r = 0.5 * stem.dbh - 0.008 * (h - 1.3) + random_.normal(0.0, stem.noise_m);
      cloud.emplace_back(stem.x + stem.lean_x * h + r * std::cos(turn), stem.y + r * std::sin(turn),
                         ground(stem.x, stem.y) + h);
    }
    for (int i = 0; i < 300; ++i) {  // a crown to take a height from
      cloud.emplace_back(stem.x + random_.normal(0.0, 0.6), stem.y + random_.normal(0.0, 0.6),
                         ground(stem.x, stem.y) + random_.uniform(4.0, 15.0));
    }
  }
  // A young tree that is green to the ground: its stem is hidden among the points of its branches.
  void add_young_tree(double x, double y, double dbh, double height, int points = 3'000) {
    for (int i = 0; i < points; ++i) {
      const double h = random_.uniform(0.1, height);
      const double turn = random_.uniform(0.0, 2.0 * M_PI);
      const bool on_stem = i % 8 == 0;
      const double crown = 0.7 * (1.0 - h / height) + 0.1;
      const double r = on_stem ? 0.5 * dbh : crown * random_.uniform();
      const double noise = on_stem ? 0.01 : 0.0;
      cloud.emplace_back(x + r * std::cos(turn) + random_.normal(0.0, noise),
                         y + r * std::sin(turn) + random_.normal(0.0, noise), ground(x, y) + h);
    }
  }
  // A bush: points all through a ball.
  void add_bush(double x, double y, double radius, int points) {
    for (int i = 0; i < points;) {
      const Eigen::Vector3d p(random_.uniform(-1, 1), random_.uniform(-1, 1),
                              random_.uniform(-1, 1));
      if (p.norm() > 1.0) continue;
      cloud.emplace_back(x + radius * p.x(), y + radius * p.y(),
                         ground(x, y) + radius + 1.2 * radius * p.z());
      ++i;
    }
  }
  Cloud cloud;

 private:
  Random random_;
};

// The tree within 30 cm of a place, or null.
inline const Tree* nearest(const std::vector<Tree>& trees, double x, double y) {
  const Tree* best = nullptr;
  double least = 0.3;
  for (const Tree& tree : trees) {
    const double distance = std::hypot(tree.x - x, tree.y - y);
    if (distance < least) best = &tree;
    least = std::min(least, distance);
  }
  return best;
}

}  // namespace understory
