#include "understory/map/upright_views.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

constexpr double kDeg = M_PI / 180.0;

// Three views of three stems by a body that is mounted by `upright_from_body`.
struct MountedViews {
  std::vector<StemView> views;
  std::vector<Pose> world_from_body;
};

MountedViews mounted(const Eigen::Quaterniond& upright_from_body) {
  MountedViews result;
  for (int i = 0; i < 3; ++i) {
    const Pose world_from_body(
        Eigen::AngleAxisd(0.3 * i, Eigen::Vector3d::UnitZ()) * upright_from_body, {2.0 * i, 1, 0});
    StemView view;
    for (const Eigen::Vector3d& place :
         {Eigen::Vector3d(4, 1, 0), Eigen::Vector3d(-3, 7, 0), Eigen::Vector3d(9, -5, 1)}) {
      view.stems.emplace_back();
      view.stems.back().point = (world_from_body.inverse() * place).cast<float>();
    }
    result.views.push_back(view);
    result.world_from_body.push_back(world_from_body);
  }
  return result;
}

TEST(UprightViews, AnUprightBodyStaysAsItIsToTheBit) {
  const MountedViews given =
      mounted(Eigen::Quaterniond(Eigen::AngleAxisd(15.0 * kDeg, Eigen::Vector3d::UnitY())));
  const UprightViews result = upright_views(given.views, given.world_from_body);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(result.world_from_view[i].matrix(), given.world_from_body[i].matrix());
    EXPECT_EQ(result.points[i][2], given.views[i].stems[2].point.cast<double>());
  }
  EXPECT_TRUE(upright_views({}, {}).points.empty());
}

TEST(UprightViews, ABodyThatLiesOrHangsIsTurnedAndThePlacesStay) {
  for (const double tilt : {30.0, 90.0, 130.0, 180.0}) {
    for (const int k : {0, 1}) {
      const Eigen::Vector3d axis = Eigen::Vector3d::Unit(k);
      const MountedViews given = mounted(Eigen::Quaterniond(Eigen::AngleAxisd(tilt * kDeg, axis)));
      const UprightViews result = upright_views(given.views, given.world_from_body);
      for (std::size_t i = 0; i < 3; ++i) {
        const Eigen::Vector3d up =
            result.world_from_view[i].rotation().inverse() * Eigen::Vector3d::UnitZ();
        EXPECT_NEAR(up.z(), 1.0, 1e-9) << tilt;
        const Eigen::Vector3d place = result.world_from_view[i] * result.points[i][2];
        EXPECT_LT((place - Eigen::Vector3d(9, -5, 1)).norm(), 1e-5) << tilt;
      }
    }
  }
}

}  // namespace
}  // namespace understory
