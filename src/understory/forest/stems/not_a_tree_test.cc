#include "understory/forest/stems/not_a_tree.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "understory/util/random.h"

namespace understory {
namespace {

// A place with things in it.
class Scene {
 public:
  // A round column; only the side that faces -y shows.
  void add_column(double x, double y, double radius, double low, double high) {
    for (double height = low; height < high; height += 0.02) {
      for (double turn = -150.0; turn < -30.0; turn += 15.0) {
        const double angle = turn * M_PI / 180.0;
        add(x + radius * std::cos(angle), y + radius * std::sin(angle), height);
      }
    }
  }
  // A wall from one place to another.
  void add_wall(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    const double length = (to - from).norm();
    for (double height = 0.5; height < 3.5; height += 0.05) {
      for (double along = 0.0; along < length; along += 0.03) {
        const Eigen::Vector2d place = from + along / length * (to - from);
        add(place.x(), place.y(), height);
      }
    }
  }
  void add_thicket(double half_m, double low, double high, int points) {
    for (int i = 0; i < points; ++i)
      add(random_.uniform(-half_m, half_m), random_.uniform(-half_m, half_m),
          random_.uniform(low, high));
  }
  [[nodiscard]] TreeDoubt doubt(double radius, double low, double high,
                                bool in_foliage = false) const {
    StemFit stem;
    stem.in_foliage = in_foliage;
    stem.radius_m = radius;
    stem.lowest_m = low;
    stem.highest_m = high;
    const PointsNear near = [&](const Eigen::Vector2d& centre, double reach,
                                const std::function<void(const SlicePoint&)>& visit) {
      for (const SlicePoint& point : points_) {
        if (std::abs(point.x - centre.x()) <= reach && std::abs(point.y - centre.y()) <= reach)
          visit(point);
      }
    };
    return doubt_of(stem, near, {});
  }

 private:
  void add(double x, double y, double height) {
    points_.push_back({static_cast<float>(x + random_.normal(0.0, 0.006)),
                       static_cast<float>(y + random_.normal(0.0, 0.006)),
                       static_cast<float>(height)});
  }
  std::vector<SlicePoint> points_;
  Random random_{3};
};

TEST(NotATree, APostEndsWhereItsNeighboursGoOn) {
  Scene scene;
  scene.add_column(0.0, 0.0, 0.07, 0.5, 1.6);
  EXPECT_EQ(scene.doubt(0.07, 0.5, 1.6), TreeDoubt::kNone);  // nothing shows that more was in view
  scene.add_column(1.5, 0.5, 0.1, 0.5, 3.5);
  EXPECT_EQ(scene.doubt(0.07, 0.5, 1.6), TreeDoubt::kEndsLow);
}

TEST(NotATree, AStemThatIsHiddenFurtherUpIsATree) {
  Scene scene;
  scene.add_column(0.0, 0.0, 0.07, 0.5, 1.6);
  scene.add_column(0.0, 0.0, 0.06, 2.6, 3.5);  // its fit ended below a branch
  scene.add_column(1.5, 0.5, 0.1, 0.5, 3.5);
  EXPECT_EQ(scene.doubt(0.07, 0.5, 1.6), TreeDoubt::kNone);
}

// A post that ends at 1.6 m, seen from -y. The tree 4.5 m behind it is in view, but too far away
// for the test of what stands around.
Scene post_before_a_tree() {
  Scene scene;
  scene.add_column(0.0, 0.0, 0.07, 0.5, 1.6);
  scene.add_column(0.3, 4.5, 0.1, 0.5, 3.5);
  return scene;
}

TEST(NotATree, APostEndsSuddenlyBeforeWhatWasSeenBehindIt) {
  Scene alone;
  alone.add_column(0.0, 0.0, 0.07, 0.5, 1.6);
  EXPECT_EQ(alone.doubt(0.07, 0.5, 1.6), TreeDoubt::kNone);
  EXPECT_EQ(post_before_a_tree().doubt(0.07, 0.5, 1.6), TreeDoubt::kEndsLow);
}

TEST(NotATree, BranchesThatHangOverAPostMakeItNoTree) {
  Scene scene = post_before_a_tree();
  scene.add_thicket(0.3, 2.5, 3.5, 500);
  EXPECT_EQ(scene.doubt(0.07, 0.5, 1.6), TreeDoubt::kEndsLow);
}

TEST(NotATree, AStemWhoseUpperPartIsHiddenIsATree) {
  // What hides it hides what stands behind it as well; at its sides others are seen.
  Scene scene;
  scene.add_column(0.0, 0.0, 0.07, 0.5, 1.6);
  scene.add_column(4.0, 0.0, 0.1, 0.5, 3.5);
  scene.add_column(-4.0, 1.0, 0.1, 0.5, 3.5);
  scene.add_column(0.0, -4.0, 0.1, 0.5, 3.5);
  EXPECT_EQ(scene.doubt(0.07, 0.5, 1.6), TreeDoubt::kNone);
}

TEST(NotATree, AStemThatThinsOutUpwardsMayGoOn) {
  // Ever fewer beams look up to it.
  Scene scene;
  scene.add_column(0.0, 0.0, 0.07, 0.5, 1.0);
  scene.add_column(0.0, 0.0, 0.07, 1.58, 1.6);
  scene.add_column(0.3, 4.5, 0.1, 0.5, 3.5);
  EXPECT_EQ(scene.doubt(0.07, 0.5, 1.6), TreeDoubt::kNone);
}

TEST(NotATree, AnEndRightBelowFoliageMayBeHiddenByIt) {
  Scene scene = post_before_a_tree();
  scene.add_column(0.0, 0.0, 0.2, 1.7, 2.3);  // it hides what stands within
  EXPECT_EQ(scene.doubt(0.07, 0.5, 1.6), TreeDoubt::kNone);
}

TEST(NotATree, AStemThatGoesOnBehindAGapIsATree) {
  Scene scene = post_before_a_tree();
  scene.add_column(0.0, 0.0, 0.07, 1.8, 3.5);
  EXPECT_EQ(scene.doubt(0.07, 0.5, 1.6), TreeDoubt::kNone);
}

TEST(NotATree, AStemThatGoesOnShiftedIsATree) {
  Scene scene = post_before_a_tree();
  scene.add_column(0.2, 0.0, 0.06, 1.6, 3.5);
  EXPECT_EQ(scene.doubt(0.07, 0.5, 1.6), TreeDoubt::kNone);
}

TEST(NotATree, APostWithinFoliageEndsWhereTheFoliageGoesOn) {
  Scene scene = post_before_a_tree();
  scene.add_column(0.0, 0.0, 0.2, 0.5, 3.5);
  EXPECT_EQ(scene.doubt(0.07, 0.5, 1.6), TreeDoubt::kEndsLow);
}

TEST(NotATree, AYoungTreeWithinFoliageMayEndLow) {
  EXPECT_EQ(post_before_a_tree().doubt(0.07, 0.5, 1.6, true), TreeDoubt::kNone);
}

TEST(NotATree, ACornerOfWallsIsPartOfPlanes) {
  Scene scene;
  scene.add_wall({0.0, 0.0}, {3.0, 0.6});
  scene.add_wall({0.0, 0.0}, {-0.8, 4.0});
  EXPECT_EQ(scene.doubt(0.12, 0.5, 3.5), TreeDoubt::kPartOfPlane);
}

TEST(NotATree, AWallThatATouchingCircleFitsIsAPlane) {
  Scene scene;
  scene.add_wall({-3.0, -0.2}, {3.0, -0.2});
  EXPECT_EQ(scene.doubt(0.2, 0.5, 3.5), TreeDoubt::kPartOfPlane);
}

TEST(NotATree, ATreeBesideAWallIsATree) {
  Scene scene;
  scene.add_wall({-3.0, 0.5}, {3.0, 0.5});
  scene.add_column(0.0, 0.0, 0.12, 0.5, 3.5);
  EXPECT_EQ(scene.doubt(0.12, 0.5, 3.5), TreeDoubt::kNone);
}

TEST(NotATree, AStemInAThicketIsATree) {
  Scene scene;
  scene.add_column(0.0, 0.0, 0.1, 0.5, 3.5);
  scene.add_thicket(1.5, 0.5, 3.5, 30000);
  EXPECT_EQ(scene.doubt(0.1, 0.5, 3.5), TreeDoubt::kNone);
}

}  // namespace
}  // namespace understory
