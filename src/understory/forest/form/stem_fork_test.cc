#include "understory/forest/form/stem_fork.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

constexpr double kBark = 0.11;

// A straight upright stem, seen from the south, and things beside it.
class ForkedStem {
 public:
  ForkedStem() { add_cone(Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero(), kBark, 0.3, 9.0); }

  // From `from_m` on upwards its centre line is `foot` + `slope` times the height over `from_m`.
  void add_cone(const Eigen::Vector2d& foot, const Eigen::Vector2d& slope, double radius_m,
                double from_m, double to_m) {
    for (int i = 0; i < static_cast<int>(400.0 * (to_m - from_m)); ++i) {
      const double height = random_.uniform(from_m, to_m);
      const double turn = random_.uniform(-M_PI, 0.0);
      const double r = radius_m + random_.normal(0.0, 0.006);
      const Eigen::Vector2d centre = foot + (height - from_m) * slope;
      add(centre.x() + r * std::cos(turn), centre.y() + r * std::sin(turn), height);
    }
  }
  void add_foliage(double from_m, double to_m, int count) {
    for (int i = 0; i < count; ++i)
      add(random_.normal(0.0, 0.35), random_.normal(0.0, 0.35), random_.uniform(from_m, to_m));
  }
  [[nodiscard]] std::optional<StemFork> fork() {
    StemCurve curve;
    for (int i = 0; i <= 90; ++i)
      curve.sections.push_back({0.1 * i, Eigen::Vector2d::Zero(), 2.0 * kBark, 0.005, true});
    curve.measured_to_m = 9.0;
    std::sort(points_.begin(), points_.end(),
              [](const SlicePoint& a, const SlicePoint& b) { return a.height_m < b.height_m; });
    return find_fork(points_, curve);
  }

 private:
  void add(double x, double y, double height) {
    points_.push_back(
        {static_cast<float>(x), static_cast<float>(y), static_cast<float>(height), 1});
  }

  Random random_{4};
  std::vector<SlicePoint> points_;
};

TEST(StemFork, IsWhereTheSecondStemLeavesTheBark) {
  for (const double height : {1.5, 4.0, 7.0}) {
    ForkedStem scene;
    scene.add_cone({kBark, 0.0}, {0.35, 0.1}, 0.08, height, height + 3.0);
    const std::optional<StemFork> fork = scene.fork();
    ASSERT_TRUE(fork.has_value()) << height;
    EXPECT_NEAR(fork->height_m, height, 0.15);
    EXPECT_GT(fork->from_m, height);
  }
}

TEST(StemFork, AStraightStemHasNone) {
  ForkedStem scene;
  EXPECT_FALSE(scene.fork().has_value());
}

// Foliage is dense enough for chance circles.
TEST(StemFork, FoliageIsNone) {
  ForkedStem scene;
  scene.add_foliage(2.0, 9.0, 4000);
  EXPECT_FALSE(scene.fork().has_value());
}

TEST(StemFork, ABranchIsNone) {
  ForkedStem scene;
  scene.add_cone({kBark, 0.0}, {0.35, 0.0}, 0.025, 3.0, 6.0);
  EXPECT_FALSE(scene.fork().has_value()) << "it is thin";
  ForkedStem level;
  level.add_cone({kBark, 0.0}, {1.5, 0.0}, 0.08, 3.0, 3.6);
  EXPECT_FALSE(level.fork().has_value()) << "it is nearly level";
}

// Its own stem stands beside this one from the ground on.
TEST(StemFork, ANeighbourIsNone) {
  ForkedStem upright;
  upright.add_cone({0.45, 0.0}, Eigen::Vector2d::Zero(), 0.1, 0.3, 9.0);
  EXPECT_FALSE(upright.fork().has_value());
  ForkedStem leaning;
  leaning.add_cone({0.3, 0.0}, {0.1, 0.0}, 0.1, 0.3, 6.0);
  EXPECT_FALSE(leaning.fork().has_value());
  // Its line meets the stem at 1 m, and it is seen from 4 m on.
  ForkedStem hidden;
  hidden.add_cone({0.41, 0.0}, {0.1, 0.0}, 0.1, 4.0, 7.0);
  EXPECT_FALSE(hidden.fork().has_value());
}

}  // namespace
}  // namespace understory
