#include "understory/graph/gnss_fusion.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "understory/graph/test_covariance.h"
#include "understory/util/angles.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using Eigen::Vector3d;
using test::covariance;

const Vector3d kAntenna(0.1, -0.2, 1.4);

// A walk of `n` keyframes, a metre and a second apart, in bends, as the odometry has it. The world
// frame begins at the first keyframe and turns away from the truth with the way.
struct WalkWithGnss {
  std::vector<Pose> truth;  // east, north, up
  PoseGraphProblem problem;
  Pose enu_from_world;  // by the first keyframe

  WalkWithGnss(int n, double turn_per_m, double noise_per_m, std::uint64_t seed) {
    Random random(seed);
    Pose at(Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Vector3d::UnitZ())), Vector3d(30, -20, 4));
    enu_from_world = at;
    Pose drifted;
    for (int k = 0; k < n; ++k) {
      if (k > 0) {
        Vector6d step = Vector6d::Zero();
        step[2] = 0.05 * std::sin(0.06 * k);
        step[3] = 1.0;
        at = at * Pose::exp(step);
        step[2] += turn_per_m;
        for (int i = 0; i < 3; ++i)
          step[i + 3] += noise_per_m * random.normal();
        const Pose measured = Pose::exp(step);
        drifted = drifted * measured;
        problem.odometry.push_back(
            {k - 1, k, measured,
             covariance(std::max(turn_per_m, 0.02 * kDegree), std::max(0.01, noise_per_m))});
      }
      truth.push_back(at);
      problem.world_from_keyframe.push_back(drifted);
    }
  }
};

// Positions with errors of both kinds; `jump` in metres from `from` to `to`.
std::vector<GnssObservation> positions_of(const WalkWithGnss& walk, const GnssErrors& errors,
                                          std::uint64_t seed, double jump = 0.0, int from = 0,
                                          int to = 0) {
  Random random(seed);
  Vector3d slow = errors.slow_plane_m * Vector3d(random.normal(), random.normal(), 0.0);
  const double decay = std::exp(-1.0 / errors.correlation_s);
  std::vector<GnssObservation> observations;
  for (std::size_t k = 0; k < walk.truth.size(); ++k) {
    for (int i = 0; i < 3; ++i)
      slow[i] = decay * slow[i] + std::sqrt(1.0 - decay * decay) *
                                      (i < 2 ? errors.slow_plane_m : errors.slow_height_m) *
                                      random.normal();
    GnssObservation observation;
    observation.keyframe = static_cast<int>(k);
    observation.stamp = static_cast<TimeNs>(k) * 1'000'000'000;
    observation.antenna_in_keyframe = kAntenna;
    observation.position_in_enu = walk.truth[k] * kAntenna + slow;
    for (int i = 0; i < 3; ++i)
      observation.position_in_enu[i] +=
          (i < 2 ? errors.fast_plane_m : errors.fast_height_m) * random.normal();
    const int at = static_cast<int>(k);
    if (at >= from && at < to) observation.position_in_enu.x() += jump;
    observations.push_back(observation);
  }
  return observations;
}

double rms(const std::vector<Pose>& poses, const std::vector<Pose>& truth) {
  double sum = 0.0;
  for (std::size_t k = 0; k < truth.size(); ++k)
    sum += (poses[k].translation() - truth[k].translation()).squaredNorm();
  return std::sqrt(sum / static_cast<double>(truth.size()));
}

// Root mean square of how far steps of 10 keyframes differ from the truth: whether a path bends.
double bend(const std::vector<Pose>& poses, const std::vector<Pose>& truth) {
  double sum = 0.0;
  for (std::size_t k = 10; k < truth.size(); ++k) {
    sum += ((poses[k - 10].inverse() * poses[k]).translation() -
            (truth[k - 10].inverse() * truth[k]).translation())
               .squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(truth.size() - 10));
}

constexpr GnssErrors kGood{0.02, 0.03, 0.03, 0.05, 100.0};
constexpr GnssErrors kForest{2.0, 0.5, 4.0, 1.0, 100.0};

TEST(GnssFusion, GoodPositionsTakeTheDriftOut) {
  const WalkWithGnss walk(300, 0.03 * kDegree, 0.005, 1);
  const double before = rms(walk.problem.world_from_keyframe, walk.truth);
  const GnssFusionResult result =
      fuse_gnss(walk.problem, {}, positions_of(walk, kGood, 2), walk.enu_from_world, kGood, {});
  ASSERT_TRUE(result.converged) << result.reason;
  EXPECT_GT(before, 1.0);
  EXPECT_LT(rms(result.enu_from_keyframe, walk.truth), 0.06);
}

TEST(GnssFusion, TheLeverArmIsTakenOff) {
  const WalkWithGnss walk(100, 0.0, 0.0, 1);
  std::vector<GnssObservation> observations = positions_of(walk, kGood, 2);
  GnssFusionResult result =
      fuse_gnss(walk.problem, {}, observations, walk.enu_from_world, kGood, {});
  EXPECT_LT(rms(result.enu_from_keyframe, walk.truth), 0.06);
  for (GnssObservation& observation : observations)
    observation.antenna_in_keyframe.setZero();
  result = fuse_gnss(walk.problem, {}, observations, walk.enu_from_world, kGood, {});
  EXPECT_GT(rms(result.enu_from_keyframe, walk.truth), 1.0);
}

// The odometry turns away by 9 degrees, which positions under trees do not tell well.
TEST(GnssFusion, HeadingsOfASecondAntennaTakeATurnOut) {
  const WalkWithGnss walk(300, 0.03 * kDegree, 0.0, 1);
  std::vector<GnssObservation> observations = positions_of(walk, kForest, 2);
  const auto worst_deg = [&](const GnssFusionResult& result) {  // about up
    double worst = 0.0;
    for (std::size_t k = 0; k < walk.truth.size(); ++k) {
      const Vector3d off =
          so3_log(result.enu_from_keyframe[k].rotation() * walk.truth[k].rotation().conjugate());
      worst = std::max(worst, std::abs(off.z()) / kDegree);
    }
    return worst;
  };
  const GnssFusionResult without =
      fuse_gnss(walk.problem, {}, observations, walk.enu_from_world, kForest, {});
  for (GnssObservation& observation : observations) {
    const auto k = static_cast<std::size_t>(observation.keyframe);
    const Vector3d line(0.2, -0.9, 0.1);
    const Vector3d in_enu = walk.truth[k].rotation() * line;
    observation.direction_in_keyframe = line;
    observation.azimuth_rad = std::atan2(in_enu.y(), in_enu.x());
    observation.azimuth_sd_rad = 0.2 * kDegree;
  }
  const GnssFusionResult with =
      fuse_gnss(walk.problem, {}, observations, walk.enu_from_world, kForest, {});
  ASSERT_TRUE(with.converged) << with.reason;
  EXPECT_GT(worst_deg(without), 1.0);
  EXPECT_LT(worst_deg(with), 0.3);
}

TEST(GnssFusion, ErrorsUnderTreesDoNotBendThePath) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const WalkWithGnss walk(300, 0.0, 0.003, seed);
    const GnssFusionResult result =
        fuse_gnss(walk.problem, {}, positions_of(walk, kForest, 100 + seed), walk.enu_from_world,
                  kForest, {});
    ASSERT_TRUE(result.converged) << result.reason;
    EXPECT_LT(bend(result.enu_from_keyframe, walk.truth),
              1.05 * bend(walk.problem.world_from_keyframe, walk.truth) + 0.001)
        << seed;
  }
}

TEST(GnssFusion, AJumpOfMinutesNeitherBendsNorMovesThePath) {
  const WalkWithGnss walk(300, 0.0, 0.003, 3);
  const auto clean =
      fuse_gnss(walk.problem, {}, positions_of(walk, kForest, 5), walk.enu_from_world, kForest, {});
  const auto jumping = fuse_gnss(walk.problem, {}, positions_of(walk, kForest, 5, 10.0, 100, 160),
                                 walk.enu_from_world, kForest, {});
  ASSERT_TRUE(jumping.converged) << jumping.reason;
  EXPECT_LT(bend(jumping.enu_from_keyframe, walk.truth),
            1.1 * bend(clean.enu_from_keyframe, walk.truth) + 0.001);
  EXPECT_LT(rms(jumping.enu_from_keyframe, clean.enu_from_keyframe), 1.5);
}

TEST(GnssFusion, OutagesAndMissingHeightsAreNoObstacle) {
  const WalkWithGnss walk(200, 0.02 * kDegree, 0.005, 4);
  std::vector<GnssObservation> observations = positions_of(walk, kGood, 6);
  observations.erase(observations.begin() + 60, observations.begin() + 140);
  for (GnssObservation& observation : observations) {
    observation.has_height = false;
    observation.position_in_enu.z() = 1e3;
  }
  const GnssFusionResult result =
      fuse_gnss(walk.problem, {}, observations, walk.enu_from_world, kGood, {});
  ASSERT_TRUE(result.converged) << result.reason;
  double plane = 0.0;
  for (std::size_t k = 0; k < walk.truth.size(); ++k)
    plane = std::max(
        plane,
        (result.enu_from_keyframe[k].translation() - walk.truth[k].translation()).head<2>().norm());
  EXPECT_LT(plane, 0.4);
}

// Errors of the last place over their standard deviations, many walks.
TEST(GnssFusion, TheStatedCovarianceIsHonest) {
  double squares = 0.0;
  constexpr int kWalks = 60;
  for (int seed = 1; seed <= kWalks; ++seed) {
    const WalkWithGnss walk(150, 0.0, 0.01, static_cast<std::uint64_t>(seed));
    const GnssFusionResult result = fuse_gnss(
        walk.problem, {}, positions_of(walk, kForest, static_cast<std::uint64_t>(1000 + seed)),
        walk.enu_from_world, kForest, {});
    const Vector3d error =
        result.enu_from_keyframe.back().rotation().conjugate() *
        (walk.truth.back().translation() - result.enu_from_keyframe.back().translation());
    const Eigen::Matrix3d place = result.last_covariance.bottomRightCorner<3, 3>();
    squares += error.dot(place.inverse() * error) / (3.0 * kWalks);
  }
  EXPECT_GT(squares, 0.7);
  EXPECT_LT(squares, 1.4);
}

// Two moments that are far apart in time and say different places: the better one counts.
TEST(GnssFusion, SlowErrorsAreScaledAsTheReceiverStates) {
  const Vector3d apart(0.0, 100.0, 0.0);
  PoseGraphProblem pair;
  pair.world_from_keyframe = {Pose(), Pose(Eigen::Quaterniond::Identity(), apart)};
  pair.odometry.push_back({0, 1, pair.world_from_keyframe[1], covariance(1e-4, 1e-3)});
  std::vector<GnssObservation> observations(4);
  for (std::size_t i = 0; i < 4; ++i) {
    observations[i].keyframe = static_cast<int>(i % 2);
    if (i % 2 == 1) observations[i].position_in_enu = apart;
    if (i < 2) continue;
    observations[i].stamp = from_seconds(3600.0);
    observations[i].position_in_enu.x() += 5.0;
  }
  const auto east = [&] {
    const GnssFusionResult result = fuse_gnss(pair, {}, observations, Pose(), kForest, {});
    EXPECT_TRUE(result.converged) << result.reason;
    return result.enu_from_keyframe[0].translation().x();
  };
  EXPECT_NEAR(east(), 2.5, 0.1);
  for (std::size_t i = 0; i < 4; ++i)
    observations[i].plane_scale = i < 2 ? 0.5 : 2.0;
  EXPECT_NEAR(east(), 5.0 * 0.25 / (0.25 + 4.0), 0.1);
}

TEST(GnssFusion, WithoutPositionsThePathIsThatOfTheGuess) {
  const WalkWithGnss walk(20, 0.0, 0.0, 1);
  const GnssFusionResult result = fuse_gnss(walk.problem, {}, {}, walk.enu_from_world, kForest, {});
  EXPECT_FALSE(result.converged);
  EXPECT_LT(rms(result.enu_from_keyframe, walk.truth), 1e-6);
}

}  // namespace
}  // namespace understory
