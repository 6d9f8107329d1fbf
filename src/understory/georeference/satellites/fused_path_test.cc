#include "understory/georeference/satellites/fused_path.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "understory/georeference/satellites/gnss_fit.h"
#include "understory/georeference/satellites/test_mast.h"
#include "understory/util/angles.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using Eigen::Vector3d;
using test::kArm;
using test::kPlace;

const Pose kEnuFromWorld(Eigen::Quaterniond(Eigen::AngleAxisd(2.2, Vector3d::UnitZ())),
                         Vector3d(4.0, -3.0, 1.0));

// A walk of `n` keyframes, a metre and a second apart, along bends. The map's steps are too long by
// `scale_error`, and its edges say that they err ten times as much as they do otherwise.
struct MappedWalk {
  std::vector<Pose> truth;  // world frame
  SolvedRun run;

  MappedWalk(int n, double scale_error, std::uint64_t seed) {
    Random random(seed);
    Pose at;
    Pose mapped;
    Matrix6d covariance = Matrix6d::Zero();
    covariance.diagonal() << Vector3d::Constant(std::pow(0.02 * kDegree, 2)),
        Vector3d::Constant(1e-4);
    for (int k = 0; k < n; ++k) {
      Vector6d step = Vector6d::Zero();
      step[2] = 0.04 * std::sin(0.03 * k);
      step[3] = 1.0;
      if (k > 0) {
        at = at * Pose::exp(step);
        step[3] *= 1.0 + scale_error;
        for (int i = 0; i < 3; ++i)
          step[i + 3] += 0.001 * random.normal();
        const Pose odometry = Pose::exp(step);
        mapped = mapped * odometry;
        run.graph.odometry.push_back({k - 1, k, odometry, covariance});
      }
      truth.push_back(at);
      run.graph.world_from_keyframe.push_back(mapped);
      run.stamps.push_back(from_seconds(1000.0 + k));
      run.trajectory.push_back({run.stamps.back(), mapped});
    }
  }
};

struct FixErrors {
  double slow_m = 0.0;
  double fast_m = 0.01;
  double correlation_s = 60.0;
  double stated_m = 1.0;
};

std::vector<GnssFix> fixes_on_walk(const MappedWalk& walk, const FixErrors& receiver,
                                   std::uint64_t seed) {
  Random random(seed);
  const EastNorthUp frame(kPlace);
  const auto normal = [&] { return Vector3d(random.normal(), random.normal(), random.normal()); };
  const double kept = std::exp(-1.0 / receiver.correlation_s);
  Vector3d slow = normal();
  std::vector<GnssFix> fixes;
  for (std::size_t k = 0; k < walk.truth.size(); ++k) {
    slow = kept * slow + std::sqrt(1.0 - kept * kept) * normal();
    const Vector3d error = receiver.slow_m * slow + receiver.fast_m * normal();
    const GeodeticPlace place = frame.to_place(kEnuFromWorld * (walk.truth[k] * kArm) + error);
    GnssFix fix;
    fix.stamp = walk.run.stamps[k];
    fix.latitude_deg = place.latitude_deg;
    fix.longitude_deg = place.longitude_deg;
    fix.height_m = place.height_m;
    fix.covariance = receiver.stated_m * receiver.stated_m * Eigen::Matrix3d::Identity();
    fixes.push_back(fix);
  }
  return fixes;
}

PairingConfig with_arm() {
  PairingConfig pairing;
  pairing.antenna_in_body = kArm;
  pairing.most_pairs = 60;  // quick
  return pairing;
}

// The rigid fit to the same pairs, as the callers have it.
Pose first_guess(const MappedWalk& walk, const std::vector<GnssFix>& fixes) {
  return fit_split(pair_by_time(walk.run.trajectory, fixes, with_arm()).pairs, {}).enu_from_world;
}

// Root mean square of how far keyframes lie off their true places, in the frame of the truth.
double place_error_m(const MappedWalk& walk, const std::vector<GnssFix>& fixes,
                     const FusedPath& path) {
  const GeodeticPlace origin{fixes.front().latitude_deg, fixes.front().longitude_deg,
                             fixes.front().height_m};
  const EastNorthUp from(origin);
  const EastNorthUp to(kPlace);
  double squares = 0.0;
  for (std::size_t k = 0; k < walk.truth.size(); ++k)
    squares += (to.from_place(from.to_place(path.enu_from_keyframe[k].translation())) -
                kEnuFromWorld * walk.truth[k].translation())
                   .squaredNorm();
  return std::sqrt(squares / static_cast<double>(walk.truth.size()));
}

FusedPath unbent(const MappedWalk& walk, const Pose& motion) {
  FusedPath path;
  for (const Pose& pose : walk.run.graph.world_from_keyframe)
    path.enu_from_keyframe.push_back(motion * pose);
  return path;
}

TEST(FusedPath, GoodPositionsTakeAScaleErrorOut) {
  const MappedWalk walk(300, 0.005, 1);
  const auto fixes = fixes_on_walk(walk, {0.0, 0.01, 60.0, 0.02}, 2);
  const Pose guess = first_guess(walk, fixes);
  const FusedPath fused = fuse_path(walk.run, fixes, guess, with_arm(), {}, {});
  ASSERT_TRUE(fused.found) << fused.reason;
  EXPECT_GT(place_error_m(walk, fixes, unbent(walk, guess)), 0.15);
  EXPECT_LT(place_error_m(walk, fixes, fused), 0.03);
  EXPECT_GT(fused.odometry_scale, 0.25);  // the positions show that the map errs more
  EXPECT_GT(fused.bent_m, 0.1);
}

// A short way under a bad receiver: the headings tell how it lies, in the graph, too.
TEST(FusedPath, HeadingsOfASecondAntennaTurnThePath) {
  const MappedWalk walk(60, 0.0, 1);
  auto fixes = fixes_on_walk(walk, {4.0, 0.3, 60.0, 3.0}, 2);
  PairingConfig pairing = with_arm();
  pairing.second_antenna_in_body = kArm + Vector3d(0.0, 1.0, 0.0);
  const auto heading_error_deg = [&](const FusedPath& path) {
    const Pose motion =
        path.enu_from_keyframe[30] * walk.run.graph.world_from_keyframe[30].inverse();
    return std::abs(std::remainder(yaw_of(motion) - yaw_of(kEnuFromWorld), 2.0 * M_PI)) / kDegree;
  };
  const FusedPath without = fuse_path(walk.run, fixes, first_guess(walk, fixes), pairing, {}, {});
  for (std::size_t k = 0; k < fixes.size(); ++k) {
    const Vector3d line = kEnuFromWorld.rotation() * (walk.truth[k].rotation() * Vector3d::UnitY());
    fixes[k].heading_deg = std::fmod(std::atan2(line.x(), line.y()) / kDegree + 360.0, 360.0);
    fixes[k].heading_sd_deg = 0.5;
  }
  const FusedPath with = fuse_path(walk.run, fixes, first_guess(walk, fixes), pairing, {}, {});
  ASSERT_TRUE(without.found && with.found) << with.reason;
  EXPECT_GT(heading_error_deg(without), 1.0);
  EXPECT_LT(heading_error_deg(with), 0.5);
}

TEST(FusedPath, AReceiverUnderTreesLeavesTheShape) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const MappedWalk walk(300, 0.0, seed);
    const auto fixes = fixes_on_walk(walk, {3.0, 0.5, 80.0, 0.8}, 100 + seed);
    const FusedPath fused =
        fuse_path(walk.run, fixes, first_guess(walk, fixes), with_arm(), {}, {});
    ASSERT_TRUE(fused.found) << fused.reason;
    EXPECT_LT(fused.bent_m, 0.02);
    EXPECT_GT(fused.expected_error_m, 0.5);
    EXPECT_LT(place_error_m(walk, fixes, fused), 4.0 * fused.expected_error_m);
  }
}

// Half a minute far off: the slow error must not follow it and draw its neighbours along.
TEST(FusedPath, ARunawayDoesNotDrawThePathAlong) {
  const MappedWalk walk(300, 0.0, 4);
  const auto clean = fixes_on_walk(walk, {1.0, 0.3, 60.0, 1.0}, 11);
  auto away = clean;
  for (std::size_t k = 120; k < 150; ++k)
    away[k].latitude_deg += 40.0 / 111'450.0;
  const Pose guess = first_guess(walk, clean);
  const FusedPath before = fuse_path(walk.run, clean, guess, with_arm(), {}, {});
  const FusedPath after = fuse_path(walk.run, away, guess, with_arm(), {}, {});
  ASSERT_TRUE(before.found && after.found);
  EXPECT_LT(place_error_m(walk, away, after), place_error_m(walk, clean, before) + 0.5);
}

TEST(FusedPath, FewFixesWithoutAHeightAreLeftOut) {
  const MappedWalk walk(200, 0.0, 3);
  auto fixes = fixes_on_walk(walk, {0.0, 0.02, 60.0, 0.5}, 7);
  for (const std::size_t k : {20U, 90U, 150U})
    fixes[k].height_m = std::nan("");
  const FusedPath path = fuse_path(walk.run, fixes, first_guess(walk, fixes), with_arm(), {}, {});
  ASSERT_TRUE(path.found) << path.reason;
  EXPECT_LT(path.positions, fixes.size());
  EXPECT_LT(path.errors.slow_height_m, 1.0);  // the default is 4
  EXPECT_LT(place_error_m(walk, fixes, path), 0.1);
}

TEST(FusedPath, FixesOfAnotherDayAreNamed) {
  const MappedWalk walk(50, 0.0, 1);
  auto fixes = fixes_on_walk(walk, {}, 2);
  for (GnssFix& fix : fixes)
    fix.stamp += from_seconds(86400.0);
  const FusedPath path = fuse_path(walk.run, fixes, kEnuFromWorld, with_arm(), {}, {});
  EXPECT_FALSE(path.found);
  EXPECT_FALSE(path.reason.empty());
}

}  // namespace
}  // namespace understory
