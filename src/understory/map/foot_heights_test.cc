#include "understory/map/foot_heights.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

namespace understory {
namespace {

struct TiltedWalk {
  std::vector<StemView> views;
  std::vector<Pose> poses;
};

// 100 views from 1.5 m above a slope of 10 %, tilted by 6 degrees. `lift_m(view)` moves all feet of
// a view down, as a terrain model below the ground does.
template <typename Lift>
TiltedWalk tilted_walk(const Lift& lift_m, int feet = 6) {
  TiltedWalk result;
  for (int i = 0; i < 100; ++i) {
    const Pose pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX())),
                    {1.0 * i, 0.0, 0.1 * i + 1.5});
    StemView view;
    for (int k = 0; k < feet; ++k) {
      const double angle = 0.5 * M_PI + 0.2 * (k - 2.5);  // all on the side that the tilt lifts
      Eigen::Vector3d foot =
          pose.translation() + Eigen::Vector3d(3.0 * std::cos(angle), 3.0 * std::sin(angle), 0.0);
      foot.z() = 0.1 * foot.x() - lift_m(i);
      Stem stem;
      stem.point = (pose.inverse() * foot).cast<float>();
      view.stems.push_back(stem);
    }
    // A stem far away, whose foot tells nothing of how the body is carried.
    Stem far;
    far.point = {20.0F, 0.0F, 9.0F};
    view.stems.push_back(far);
    result.views.push_back(view);
    result.poses.push_back(pose);
  }
  return result;
}

TEST(CarriedHeight, IsThatAboveTheFeetOnASlope) {
  const TiltedWalk level = tilted_walk([](int) { return 0.0; });
  const auto carried = carried_height(level.views, level.poses);
  ASSERT_TRUE(carried.has_value());
  EXPECT_EQ(carried->views, 100);
  EXPECT_NEAR(carried->middle_m, 1.5, 0.2);  // the upper of the two middle ones of six feet
  EXPECT_LT(carried->high_m - carried->low_m, 1e-4);
  EXPECT_FALSE(feet_leave_the_ground(*carried));
}

TEST(CarriedHeight, FeetBelowAHilltopAreNoFeet) {
  const TiltedWalk hill = tilted_walk([](int i) { return i < 50 ? 0.0 : 0.1 * (i - 50); });
  const auto carried = carried_height(hill.views, hill.poses);
  ASSERT_TRUE(carried.has_value());
  // 5 % of 100 views lie below the first height and above the last one.
  EXPECT_NEAR(carried->high_m - carried->low_m, 4.4, 0.1);
  EXPECT_TRUE(feet_leave_the_ground(*carried));
}

TEST(CarriedHeight, TellsNothingWhereFewStemsAreNear) {
  const TiltedWalk open = tilted_walk([](int) { return 0.0; }, 2);
  EXPECT_FALSE(carried_height(open.views, open.poses).has_value());
  EXPECT_FALSE(carried_height({}, {}).has_value());
}

}  // namespace
}  // namespace understory
