#include "understory/evaluation/prism_errors.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

const Eigen::Vector3d kPrism(-0.4, 0.3, 2.8);

// A body that drives along a bend, swinging its cabin to and fro.
Trajectory swinging_path() {
  Trajectory path;
  for (int i = 0; i < 400; ++i) {
    const double t = 0.1 * i;
    const Eigen::Quaterniond turn(
        Eigen::AngleAxisd(0.8 * std::sin(0.3 * t), Eigen::Vector3d::UnitZ()) *
        Eigen::AngleAxisd(0.05 * std::sin(0.9 * t), Eigen::Vector3d::UnitX()));
    path.push_back({from_seconds(t), Pose(turn, {0.5 * t, 0.02 * t * t, 0.1 * std::sin(t)})});
  }
  return path;
}

std::vector<StampedPoint> seen(const Trajectory& path, const Pose& truth_from_estimate) {
  std::vector<StampedPoint> points;
  for (std::size_t i = 0; i < path.size(); i += 3)
    points.push_back(
        {path[i].stamp + 2'000'000, truth_from_estimate * (path[i].world_from_body * kPrism)});
  return points;
}

TEST(PrismErrors, LeverArmMakesTheDifference) {
  const Trajectory path = swinging_path();
  const auto points = seen(path, Pose());
  const auto with_arm = evaluate_prism(path, points, kPrism, Alignment::kNone, 0.01);
  ASSERT_TRUE(with_arm);
  EXPECT_EQ(with_arm->pairs, points.size());
  EXPECT_LT(with_arm->ape_max_m, 1e-9);
  const auto without = evaluate_prism(path, points, Eigen::Vector3d::Zero(), Alignment::kSe3, 0.01);
  EXPECT_GT(without->ape_rmse_m, 0.1);
}

TEST(PrismErrors, AlignmentIsFoundFromThePlacesAndErrorsAreWhatTheyAre) {
  const Trajectory path = swinging_path();
  const Pose moved(Eigen::Quaterniond(Eigen::AngleAxisd(2.0, Eigen::Vector3d::UnitZ())),
                   {100.0, -7.0, 3.0});
  auto points = seen(path, moved);
  for (const Alignment alignment : {Alignment::kYaw, Alignment::kSe3}) {
    const auto errors = evaluate_prism(path, points, kPrism, alignment, 0.01);
    EXPECT_LT(errors->ape_rmse_m, 1e-6);
    EXPECT_TRUE(errors->alignment_determined);
  }
  // One place in two a centimetre too high: half of it is taken by the alignment.
  for (std::size_t i = 0; i < points.size(); i += 2)
    points[i].point.z() += 0.01;
  const auto errors = evaluate_prism(path, points, kPrism, Alignment::kYaw, 0.01);
  EXPECT_NEAR(errors->ape_rmse_m, 0.005, 1e-4);
  EXPECT_LT(errors->ape_plane_rmse_m, 1e-6);
  EXPECT_NEAR(errors->ape_max_m, 0.005, 1e-4);
}

TEST(PrismErrors, NoTimesInCommonIsNothingAndAFirstPoseIsNoAlignment) {
  const Trajectory path = swinging_path();
  auto points = seen(path, Pose());
  EXPECT_FALSE(evaluate_prism(path, points, kPrism, Alignment::kNone, 0.001));
  EXPECT_THROW((void)evaluate_prism(path, points, kPrism, Alignment::kFirst, 0.01), ConfigError);
}

TEST(PrismErrors, PlacesAreReadInTheOrderOfTheirTimes) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "prism.csv";
  std::ofstream(path) << "timestamp,x,y,z\n2.5,1,2,3\n1.000000001,4,5,6\n";
  const auto points = read_points(path);
  ASSERT_EQ(points.size(), 2U);
  EXPECT_EQ(points[0].stamp, 1'000'000'001);
  EXPECT_EQ(points[1].point, Eigen::Vector3d(1, 2, 3));
  std::ofstream(path) << "timestamp,x,y,z\n2.5,1,,3\n";
  EXPECT_THROW((void)read_points(path), InputError);
}

}  // namespace
}  // namespace understory
