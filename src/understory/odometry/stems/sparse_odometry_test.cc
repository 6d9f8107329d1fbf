#include "understory/odometry/stems/sparse_odometry.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace understory {
namespace {

struct Stand {
  std::vector<Eigen::Vector3d> feet;
  std::vector<Eigen::Vector3d> axes;
};

Stand make_stand(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> along(-30.0, 150.0);
  std::uniform_real_distribution<double> across(-30.0, 30.0);
  std::normal_distribution<double> lean(0.0, 0.06);
  Stand stand;
  for (int i = 0; i < 500; ++i) {
    const double x = along(random);
    const double y = across(random);
    stand.feet.emplace_back(x, y, 0.5 * std::sin(0.05 * x));
    stand.axes.push_back(Eigen::Vector3d(lean(random), lean(random), 1.0).normalized());
  }
  return stand;
}

StemView view_of_stand(const Stand& stand, const Pose& world_from_body, int frame,
                       std::mt19937& random, double noise_m = 0.03) {
  std::normal_distribution<double> noise(0.0, noise_m);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  StemView view;
  view.frame = frame;
  view.stamp = frame * kNsPerSecond;
  for (std::size_t i = 0; i < stand.feet.size(); ++i) {
    if ((stand.feet[i] - world_from_body.translation()).head<2>().norm() > 28.0) continue;
    if (unit(random) < 0.15) continue;
    const Eigen::Vector3d seen =
        stand.feet[i] + Eigen::Vector3d(noise(random), noise(random), noise(random));
    Stem stem;
    stem.point = (world_from_body.inverse() * seen).cast<float>();
    stem.axis = (world_from_body.rotation().conjugate() * stand.axes[i]).cast<float>();
    view.stems.push_back(stem);
  }
  return view;
}

TEST(StemUp, LeansOfTreesAverageOut) {
  const Stand stand = make_stand(2);
  std::mt19937 random(3);
  const Pose pose(so3_exp({0.25, -0.1, 1.0}), {60.0, 0.0, 1.0});
  const StemUp up = stem_up(view_of_stand(stand, pose, 0, random), Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d truth = pose.rotation().conjugate() * Eigen::Vector3d::UnitZ();
  EXPECT_LT(std::acos(up.up_in_body.dot(truth)), 1.0 * M_PI / 180.0);
  EXPECT_NEAR(up.spread_rad, 0.06, 0.02);
  EXPECT_EQ(stem_up(StemView(), Eigen::Vector3d::UnitZ()).stems, 0);
}

// Each body axis up and down in turn: what is up comes from the axes, and the heights' variance
// lies along it.
TEST(StemUp, AnyAxisOfTheBodyMayBeUp) {
  const Stand stand = make_stand(2);
  for (int k = 0; k < 6; ++k) {
    Eigen::Vector3d up_in_body = Eigen::Vector3d::Zero();
    up_in_body[k / 2] = k % 2 == 0 ? 1.0 : -1.0;
    std::mt19937 random(3);
    const Pose pose(Eigen::Quaterniond::FromTwoVectors(up_in_body, Eigen::Vector3d::UnitZ()),
                    {60.0, 0.0, 1.0});
    StemView view = view_of_stand(stand, pose, 0, random);
    EXPECT_GT(up_of_axes(view).dot(up_in_body), std::cos(0.02)) << k;
    EXPECT_GT(stem_up(view, up_of_axes(view)).up_in_body.dot(up_in_body), std::cos(0.02)) << k;
    for (Stem& stem : view.stems)
      stem.xx = 0.01F, stem.yy = 0.04F, stem.zz = 0.09F;
    EXPECT_NEAR(height_sds(view, up_in_body).front(), 0.1 * (k / 2 + 1), 1e-6) << k;
    EXPECT_NEAR(plane_range_m(view.stems.front(), up_in_body),
                (pose.rotation() * view.stems.front().point.cast<double>()).head<2>().norm(), 1e-5)
        << k;
    EXPECT_EQ(stem_up(StemView(), up_in_body).up_in_body, up_in_body);
    // Axes of both ends tell nothing.
    for (std::size_t i = 0; i < view.stems.size(); i += 2)
      view.stems[i].axis = -view.stems[i].axis;
    EXPECT_EQ(up_of_axes(view), Eigen::Vector3d::UnitZ());
  }
}

// A little tilt turns the heading of the level frame by as little, wherever up is. The smallest
// turn from an axis that points down would turn it by up to half a turn.
TEST(StemUp, HeadingOfTheLevelFrameIsSteady) {
  for (const Eigen::Vector3d& about :
       {Eigen::Vector3d(0.0, 0.0, 1.0), Eigen::Vector3d(0.0, 0.0, -1.0),
        Eigen::Vector3d(1.0, 0.0, 0.0), Eigen::Vector3d(0.0, -1.0, 0.0)}) {
    StemUp up;
    up.up_in_body = about;
    const Eigen::Quaterniond straight = level_from_body(up);
    EXPECT_LT((straight * about - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
    for (int k = 0; k < 8; ++k) {
      const double angle = k * M_PI / 4.0;
      const Eigen::Vector3d tilt = 0.05 * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0);
      up.up_in_body = straight.conjugate() * so3_exp(tilt) * Eigen::Vector3d::UnitZ();
      const Eigen::Quaterniond turn = level_from_body(up);
      EXPECT_LT((turn * up.up_in_body - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
      EXPECT_LT(turn.angularDistance(straight), 0.08) << k;
    }
  }
}

// Steps of 2 m, each with a turn of any size: no constant velocity would guess them.
TEST(SparseOdometry, FollowsATiltedSensorThroughLargeTurns) {
  for (const auto target :
       {SparseOdometryConfig::Target::kFrame, SparseOdometryConfig::Target::kMap}) {
    const Stand stand = make_stand(4);
    std::mt19937 random(5);
    std::uniform_real_distribution<double> turn(-2.5, 2.5);
    SparseOdometryConfig config;
    config.target = target;
    SparseOdometry odometry(config);
    Pose first_truth;
    Pose first_found;
    for (int i = 0; i < 60; ++i) {
      const Pose truth(so3_exp({0.0, 0.0, i == 0 ? 0.0 : turn(random)}) * so3_exp({0.2, 0.1, 0.0}),
                       {2.0 * i, 0.3 * std::sin(i), 1.5});
      const SparseStep step = odometry.add(view_of_stand(stand, truth, i, random));
      if (i == 0) {
        EXPECT_EQ(step.status, SparseStepStatus::kFirst);
        first_truth = truth;
        first_found = step.world_from_body;
        continue;
      }
      ASSERT_TRUE(step.status == SparseStepStatus::kTracked ||
                  step.status == SparseStepStatus::kSearched)
          << i;
      const Eigen::Vector3d moved = (first_truth.inverse() * truth).translation();
      const Eigen::Vector3d found = (first_found.inverse() * step.world_from_body).translation();
      // A degree of tilt in the first view lifts the far end; the plane stays.
      EXPECT_NEAR(found.norm(), moved.norm(), 0.3) << i;
    }
  }
}

// 0.26 m off after 120 m; with the newest sights alone 0.51 m.
TEST(SparseOdometry, StemsThatScatterAreAveraged) {
  const Stand stand = make_stand(10);
  double squares = 0.0;
  for (unsigned seed = 1; seed <= 16; ++seed) {
    std::mt19937 random(seed);
    SparseOdometry odometry({});
    Pose found;
    for (int i = 0; i <= 120; ++i)
      found =
          odometry
              .add(view_of_stand(stand, Pose(Eigen::Quaterniond::Identity(), {1.0 * i, 0.0, 1.5}),
                                 i, random, 0.2))
              .world_from_body;
    squares += (found.translation().head<2>() - Eigen::Vector2d(120.0, 0.0)).squaredNorm();
  }
  EXPECT_LT(std::sqrt(squares / 16.0), 0.38);
}

TEST(SparseOdometry, AnEmptyViewIsUnmatchedAndKeepsThePose) {
  const Stand stand = make_stand(6);
  std::mt19937 random(7);
  SparseOdometry odometry({});
  (void)odometry.add(view_of_stand(stand, Pose(), 0, random));
  StemView empty;
  empty.frame = 1;
  EXPECT_EQ(odometry.add(empty).status, SparseStepStatus::kUnmatched);
  EXPECT_NE(odometry.add(view_of_stand(stand, Pose(), 2, random)).status,
            SparseStepStatus::kUnmatched);
}

// A cabin 3 m above the feet goes straight on and looks ahead. Feet look higher the farther they
// are, so that each match pitches it by a little. Turned back about its own place at each view, it
// came 0.5 % too short.
TEST(SparseOdometry, HoldingTheTiltCostsNoWay) {
  const Stand stand = make_stand(8);
  std::mt19937 random(9);
  SparseOdometry odometry({});
  Pose first;
  Pose last;
  for (int i = 0; i <= 200; ++i) {
    StemView view =
        view_of_stand(stand, Pose(Eigen::Quaterniond::Identity(), {0.4 * i, 0.0, 3.0}), i, random);
    std::erase_if(view.stems, [](const Stem& stem) { return stem.point.x() < 0.0F; });
    for (Stem& stem : view.stems)
      stem.point.z() += 0.0008F * stem.point.x() * stem.point.x();
    last = odometry.add(view).world_from_body;
    if (i == 0) first = last;
  }
  const Eigen::Vector3d moved = last.translation() - first.translation();
  EXPECT_NEAR(moved.head<2>().norm(), 80.0, 0.16);
}

}  // namespace
}  // namespace understory
