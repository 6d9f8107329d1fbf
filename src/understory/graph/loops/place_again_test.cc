#include "understory/graph/loops/place_again.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "understory/geometry/pose.h"
#include "understory/graph/loops/test_bumpy_stand.h"
#include "understory/registration/test_stand.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

using test::bumpy_stand;

Pose leaning_pose_at(double x, double y, double heading_deg) {
  return {so3_exp({0.0, 0.0, heading_deg * kDegree}) * so3_exp({0.06, -0.04, 0.0}),
          Eigen::Vector3d(x, y, 1.6)};
}

UnplacedCloud seen_from(const testing::Stand& made, const Pose& world_from_body,
                        std::uint64_t seed) {
  testing::Pattern pattern = testing::os0_128();
  pattern.rings = 64;
  pattern.columns = 512;
  pattern.range_m = 40.0;
  return make_unplaced(testing::scan_stand(made, world_from_body, pattern, seed),
                       world_from_body.rotation().conjugate() * Eigen::Vector3d::UnitZ());
}

// Facing another way and 9 m away: no guess helps.
TEST(PlaceAgain, IsFoundFacingTheOtherWay) {
  const testing::Stand made = bumpy_stand(45.0, 700.0, 1);
  const Pose first = leaning_pose_at(0, 0, 20);
  const Pose second = leaning_pose_at(8, -4, 205);
  const LoopVerification found =
      verify_place_again(seen_from(made, first, 1), seen_from(made, second, 2), {});
  ASSERT_TRUE(found.accepted) << found.reason;
  const Vector6d error = right_difference(found.target_from_source, first.inverse() * second);
  EXPECT_LT(error.tail<3>().norm(), 0.1);
  EXPECT_LT(error.head<3>().norm(), 0.5 * kDegree);
}

TEST(PlaceAgain, AnotherStandIsRefused) {
  const LoopVerification found =
      verify_place_again(seen_from(bumpy_stand(45.0, 700.0, 1), leaning_pose_at(0, 0, 0), 1),
                         seen_from(bumpy_stand(45.0, 700.0, 2), leaning_pose_at(3, 1, 60), 2), {});
  EXPECT_FALSE(found.accepted);
  EXPECT_FALSE(found.reason.empty());
}

TEST(PlaceAgain, TooFewPointsAreRefusedWithTheReason) {
  const LoopVerification found =
      verify_place_again(make_unplaced({{1.0F, 2.0F, 0.0F}}, Eigen::Vector3d::UnitZ()),
                         seen_from(bumpy_stand(45.0, 700.0, 1), leaning_pose_at(0, 0, 0), 1), {});
  EXPECT_FALSE(found.accepted);
  EXPECT_NE(found.reason.find("target cannot be judged"), std::string::npos) << found.reason;
}

}  // namespace
}  // namespace understory
