#include "understory/registration/stems/go_icp.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "understory/registration/stems/go_icp_bounds.h"
#include "understory/registration/stems/test_stems.h"

namespace understory {
namespace {

using testing::make_pair;
using testing::Pair;
using testing::yaw_pose;

// Trimmed error, computed the plain way: heights weigh 0 in the plane and 1 in space.
double plain_error(const Pair& pair, const Pose& pose, double outlier_ratio, double height = 0.0) {
  std::vector<double> squared;
  for (const auto& point : pair.source) {
    double best = 1e300;
    for (const auto& other : pair.target) {
      const Eigen::Vector3d d = other - pose * point;
      best = std::min(best, d.head<2>().squaredNorm() + height * d.z() * d.z());
    }
    squared.push_back(best);
  }
  std::sort(squared.begin(), squared.end());
  const auto keep = static_cast<std::size_t>(
      std::lround((1.0 - outlier_ratio) * static_cast<double>(squared.size())));
  double sum = 0.0;
  for (std::size_t i = 0; i < keep; ++i)
    sum += squared[i];
  return std::sqrt(sum / static_cast<double>(keep));
}

GoIcpBox random_box(std::mt19937& random, bool space) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const double scale = std::exp(3.0 * unit(random) - 2.0);
  GoIcpBox::Sides reach;
  reach << 3.0, 0.5, 0.5, 4.0, 4.0, 2.0;
  GoIcpBox box;
  for (std::size_t side = 0; side < GoIcpBox::kSides; ++side) {
    if (!space && side != GoIcpBox::kYaw && side != GoIcpBox::kX && side != GoIcpBox::kY) continue;
    box.middle[side] = reach[side] * unit(random);
    box.half[side] = scale * reach[side] * std::abs(unit(random));
  }
  return box;
}

// P0 (22): whatever motion is taken from a box, its error is not below the box's bound; and the
// bounds of small boxes say something.
TEST(GoIcpBounds, NoMotionOfABoxHasASmallerError) {
  constexpr double kOutliers = 0.4;
  for (const bool space : {false, true}) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    const Pose guess =
        yaw_pose(0.3, 1.0, -2.0, 0.5) *
        (space ? Pose::exp((Vector6d() << 0.1, -0.07, 0.0, 0.0, 0.0, 0.0).finished()) : Pose());
    const Pair pair = make_pair(4, 60, 0.1, 0.3, guess);
    const SparseTarget target(pair.target);
    GoIcpBounds bounds(target, pair.source, guess,
                       space ? GoIcpBounds::Metric::kSpace : GoIcpBounds::Metric::kPlane, kOutliers,
                       5.0);
    int telling = 0;
    for (int k = 0; k < 400; ++k) {
      const GoIcpBox box = random_box(random, space);
      const GoIcpErrors errors = bounds.of(box);
      telling += errors.bound_m > 0.2 ? 1 : 0;
      ASSERT_NEAR(errors.at_middle_m,
                  plain_error(pair, box.target_from_source(guess), kOutliers, space ? 1.0 : 0.0),
                  1e-9);
      for (int l = 0; l < 30; ++l) {
        GoIcpBox motion = box;
        for (std::size_t side = 0; side < GoIcpBox::kSides; ++side)
          motion.middle[side] += box.half[side] * (l % 2 == 0           ? unit(random)
                                                   : unit(random) > 0.0 ? 1.0
                                                                        : -1.0);
        const Pose pose = motion.target_from_source(guess);
        ASSERT_GE(plain_error(pair, pose, kOutliers, space ? 1.0 : 0.0), errors.bound_m - 1e-9);
      }
    }
    EXPECT_GT(telling, 60);
  }
}

// One place each, so that nothing averages a bound that promises too much. The target lies where a
// part of the box's motions leads, and only some kinds of motion have any room.
TEST(GoIcpBounds, HoldForASinglePointWhereverItCanGo) {
  std::mt19937 random(8);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const std::vector<std::vector<GoIcpBox::Side>> kinds = {
      {GoIcpBox::kYaw},
      {GoIcpBox::kTiltX, GoIcpBox::kTiltY},
      {GoIcpBox::kX, GoIcpBox::kY},
      {GoIcpBox::kZ},
      {GoIcpBox::kTiltX},
      {GoIcpBox::kYaw, GoIcpBox::kTiltY, GoIcpBox::kZ}};
  std::vector<double> tightest(kinds.size(), 0.0);
  for (int k = 0; k < 3000; ++k) {
    const std::size_t kind = static_cast<std::size_t>(k) % kinds.size();
    GoIcpBox box;
    for (std::size_t side = 0; side < GoIcpBox::kX; ++side)
      box.middle[side] = 0.4 * unit(random);
    for (const GoIcpBox::Side side : kinds[kind])
      box.half[side] = side < GoIcpBox::kX ? 0.2 : 2.0;
    const SparsePoints source(kFewestStems,
                              {30.0 * unit(random), 30.0 * unit(random), 8.0 * unit(random)});
    GoIcpBox end = box;  // motions go this way, and the target lies beyond
    for (const GoIcpBox::Side side : kinds[kind])
      end.middle[side] += box.half[side] * (unit(random) > 0.0 ? 1.0 : -1.0);
    const Eigen::Vector3d from = box.target_from_source(Pose()) * source[0];
    const Eigen::Vector3d way = end.target_from_source(Pose()) * source[0] - from;
    const SparseTarget target(SparsePoints{from + 1.3 * way});
    GoIcpBounds bounds(target, source, Pose(), GoIcpBounds::Metric::kSpace, 0.0, 5.0);
    const double bound = bounds.of(box).bound_m;
    double nearest = 1e300;
    for (int l = 0; l <= 40; ++l) {
      GoIcpBox motion = box;
      motion.middle += l / 40.0 * (end.middle - box.middle);
      const Eigen::Vector3d at = motion.target_from_source(Pose()) * source[0];
      nearest = std::min(nearest, (at - target.grid.points()[0]).norm());
    }
    ASSERT_GE(nearest, bound - 1e-9) << "kind " << kind;
    tightest[kind] = std::max(tightest[kind], bound / nearest);
  }
  for (std::size_t kind = 0; kind < kinds.size(); ++kind)
    EXPECT_GT(tightest[kind], 0.5) << "kind " << kind;
}

TEST(GoIcpBox, SidesAreThoseOfTheMotion) {
  std::mt19937 random(6);
  const Pose guess = Pose::exp((Vector6d() << 0.2, -0.1, 0.7, 1.0, 2.0, 3.0).finished());
  for (int k = 0; k < 200; ++k) {
    const GoIcpBox box = random_box(random, true);
    const auto sides = GoIcpBox::sides_of(box.target_from_source(guess), guess);
    EXPECT_LT((sides - box.middle).norm(), 1e-9);
  }
}

// The certificate against an exhaustive grid. No place of the grid beats the answer by more than
// the gap, on stands that match and on two that do not.
TEST(GoIcp, NoPlaceOfAnExhaustiveGridIsBetter) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    Pair pair = make_pair(seed, 40, 0.1, 0.4, yaw_pose(0.15, 0.9, -0.7, 0.2));
    if (seed % 2 == 0) pair.source = make_pair(seed + 50, 40, 0.0, 0.3, Pose()).source;
    GoIcpConfig config;
    config.yaw_range_deg = 20.0;
    config.shift_range_m = 1.5;
    const auto result = register_go_icp(SparseTarget(pair.target), pair.source, Pose(), config);
    ASSERT_EQ(result.status, GoIcpStatus::kCertified);
    EXPECT_LE(result.gap_m, config.gap_m);
    EXPECT_NEAR(plain_error(pair, result.optimum, config.outlier_ratio), result.error_rms_m, 1e-9);
    double best = 1e300;
    for (int a = -20; a <= 20; ++a) {
      for (int x = -15; x <= 15; ++x) {
        for (int y = -15; y <= 15; ++y) {
          const Pose pose = yaw_pose(a * M_PI / 180.0, 0.1 * x, 0.1 * y, 0.0);
          best = std::min(best, plain_error(pair, pose, config.outlier_ratio));
        }
      }
    }
    EXPECT_GE(best, result.error_rms_m - result.gap_m);
    EXPECT_LE(result.error_rms_m, best + 1e-9 + config.gap_m);
  }
}

// The same in space: tilt and height are searched, and count in the error.
TEST(GoIcp, NoMotionOfAGridInSpaceIsBetter) {
  for (unsigned seed = 1; seed <= 2; ++seed) {
    const Pose truth = yaw_pose(0.06, 0.4, -0.3, 0.2) *
                       Pose::exp((Vector6d() << 0.05, -0.04, 0.0, 0.0, 0.0, 0.0).finished());
    Pair pair = make_pair(seed, 40, 0.1, 0.4, truth);
    if (seed == 2) pair.source = make_pair(52, 40, 0.0, 0.3, Pose()).source;
    GoIcpConfig config;
    config.motion = GoIcpConfig::Motion::kSpace;
    config.yaw_range_deg = 8.0;
    config.shift_range_m = 0.6;
    config.tilt_range_deg = 6.0;
    config.height_range_m = 0.4;
    config.gap_m = 0.1;
    const auto result = register_go_icp(SparseTarget(pair.target), pair.source, Pose(), config);
    ASSERT_EQ(result.status, GoIcpStatus::kCertified);
    EXPECT_LE(result.gap_m, config.gap_m);
    EXPECT_NEAR(plain_error(pair, result.optimum, config.outlier_ratio, 1.0), result.error_rms_m,
                1e-9);
    double best = 1e300;
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    GoIcpBox box;
    for (int k = 0; k < 60000; ++k) {
      box.middle << 8.0 * M_PI / 180.0 * unit(random), 6.0 * M_PI / 180.0 * unit(random),
          6.0 * M_PI / 180.0 * unit(random), 0.6 * unit(random), 0.6 * unit(random),
          0.4 * unit(random);
      best = std::min(best,
                      plain_error(pair, box.target_from_source(Pose()), config.outlier_ratio, 1.0));
    }
    EXPECT_GE(best, result.error_rms_m - result.gap_m);
  }
}

// A sensor that leans by ten degrees and stands 0.8 m lower, turned by any angle. The search in the
// plane cannot make it level; that of all six degrees of freedom does.
TEST(GoIcp, FindsATiltedViewInSpace) {
  const Pose truth = yaw_pose(2.2, -1.5, 2.4, 0.8) *
                     Pose::exp((Vector6d() << 0.12, -0.13, 0.0, 0.0, 0.0, 0.0).finished());
  const Pair pair = make_pair(9, 130, 0.05, 0.3, truth);
  const SparseTarget target(pair.target);
  GoIcpConfig config;
  config.mode = GoIcpConfig::Mode::kPaper;
  config.motion = GoIcpConfig::Motion::kSpace;
  config.shift_range_m = 3.0;
  const auto result = register_go_icp(target, pair.source, Pose(), config);
  EXPECT_EQ(result.status, GoIcpStatus::kConverged);
  const Pose error = truth.inverse() * result.target_from_source;
  EXPECT_LT(error.translation().norm(), 0.05);
  EXPECT_LT(error.angle(), 0.005);
}

TEST(GoIcp, FindsAnyTurnWithoutAGuessInBothModes) {
  for (const auto mode : {GoIcpConfig::Mode::kCertified, GoIcpConfig::Mode::kPaper}) {
    const Pose truth = yaw_pose(2.6, -3.5, 4.1, 0.5);
    const Pair pair = make_pair(9, 130, 0.05, 0.3, truth);
    GoIcpConfig config;
    config.mode = mode;
    const auto result = register_go_icp(SparseTarget(pair.target), pair.source, Pose(), config);
    const Pose error = truth.inverse() * result.target_from_source;
    EXPECT_LT(error.translation().norm(), 0.05);
    EXPECT_LT(error.angle(), 0.005);
    EXPECT_EQ(to_string(result.status),
              mode == GoIcpConfig::Mode::kCertified ? "certified" : "converged");
    EXPECT_GT(result.overlap, 0.6);
  }
}

// P0 table 3: the shape of the boxes and where they stop changes the work, not the answer.
TEST(GoIcp, ElongatedBoxesFindTheSameWithFewerNodes) {
  std::int64_t elongated_nodes = 0;
  std::int64_t cube_nodes = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const Pair pair = make_pair(seed, 100, 0.1, 0.3, yaw_pose(0.4, 1.9, -1.2, 0.0));
    GoIcpConfig config;
    config.yaw_range_deg = 60.0;
    const SparseTarget target(pair.target);
    const GoIcpResult elongated = register_go_icp(target, pair.source, Pose(), config);
    config.boxes = GoIcpConfig::Boxes::kCubes;
    const GoIcpResult cubes = register_go_icp(target, pair.source, Pose(), config);
    ASSERT_EQ(cubes.status, GoIcpStatus::kCertified);
    EXPECT_NEAR(cubes.error_rms_m, elongated.error_rms_m, config.gap_m);
    elongated_nodes += elongated.nodes;
    cube_nodes += cubes.nodes;
  }
  EXPECT_LT(3 * elongated_nodes, 2 * cube_nodes);
}

TEST(GoIcp, CountsTheCellsOfTheFinestSize) {
  const Pair pair = make_pair(3, 100, 0.1, 0.3, Pose());
  GoIcpConfig config;
  config.mode = GoIcpConfig::Mode::kPaper;
  config.yaw_range_deg = 30.0;
  config.shift_range_m = 2.0;
  config.finest_yaw_deg = 2.0;
  config.finest_shift_m = 0.5;
  const GoIcpResult fine = register_go_icp(SparseTarget(pair.target), pair.source, Pose(), config);
  EXPECT_NEAR(fine.cells, 60.0 / 2.0 * 8.0 * 8.0, 1e-6);
}

TEST(GoIcp, SaysWhenItGivesUp) {
  const Pair pair = make_pair(11, 60, 0.3, 1.2, yaw_pose(0.1, 0.5, 0.5, 0.0));
  GoIcpConfig config;
  config.max_nodes = 10;
  config.gap_m = 0.001;
  const auto result = register_go_icp(SparseTarget(pair.target), pair.source, Pose(), config);
  EXPECT_EQ(result.status, GoIcpStatus::kNodeLimit);
  EXPECT_GT(result.gap_m, config.gap_m);
  EXPECT_FALSE(result.reason.empty());
}

}  // namespace
}  // namespace understory
