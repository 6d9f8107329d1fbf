#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "understory/georeference/satellites/fused_path.h"
#include "understory/georeference/systems/coordinate_system.h"
#include "understory/util/angles.h"
#include "understory/util/random.h"

// A real robot in a real forest (Foret Montmorency): wheel odometry of 316 m and every tenth
// position of its truth. That is made as bad as a receiver under trees. The truth is positions
// alone, in NAD83(CSRS) / MTM zone 7 (EPSG:2949).
namespace understory {
namespace {

using Eigen::Vector3d;

constexpr const char* kSystem = "EPSG:2949";
constexpr std::size_t kEvery = 10;

std::filesystem::path data_folder() {
  const char* given = std::getenv("UNDERSTORY_DATA");
  return (given != nullptr
              ? std::filesystem::path(given)
              : std::filesystem::path(UNDERSTORY_SOURCE_DIR) / ".." / "shared" / "data") /
         "fomo" / "red_2025-10-14";
}

struct Robot {
  std::vector<StampedPose> odometry;
  std::vector<TimeNs> stamps;    // of the truth
  std::vector<Vector3d> in_enu;  // truth: east, north, up at its first position
  std::vector<GeodeticPlace> places;
  GeodeticPlace origin;
};

bool read_odometry(Robot& robot) {
  std::ifstream file(data_folder() / "odom.csv");
  std::string line;
  std::getline(file, line);  // names
  while (std::getline(file, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream text(line);
    TimeNs us = 0;
    Vector3d p;
    Eigen::Quaterniond q;
    text >> us >> p.x() >> p.y() >> p.z() >> q.x() >> q.y() >> q.z() >> q.w();
    const TimeNs stamp = us * 1000;
    // Two streams in one file: what is nearer than 5 ms says the same again.
    if (!robot.odometry.empty() && stamp - robot.odometry.back().stamp < 5'000'000) continue;
    robot.odometry.push_back({stamp, Pose(q.normalized(), p)});
  }
  return !robot.odometry.empty();
}

bool read_truth(Robot& robot) {
  std::ifstream file(data_folder() / "gt.txt");
  const CoordinateSystem system(kSystem);
  std::string line;
  while (std::getline(file, line)) {
    std::istringstream text(line);
    double time = 0.0;
    Vector3d p;
    text >> time >> p.x() >> p.y() >> p.z();
    const auto place = system.to_place(p);
    if (!place) return false;
    robot.stamps.push_back(static_cast<TimeNs>(std::llround(time * 10.0)) * 100'000'000LL);
    robot.places.push_back(*place);
  }
  if (robot.places.empty()) return false;
  robot.origin = robot.places.front();
  const EastNorthUp frame(robot.origin);
  for (const GeodeticPlace& place : robot.places)
    robot.in_enu.push_back(frame.from_place(place));
  return true;
}

// A receiver under trees: an error that stays alike for 30 s, and one that does not. It says how
// large they are, but not that they stay.
struct Degraded {
  std::vector<GnssFix> fixes;
  std::vector<Vector3d> in_enu;
};

Degraded degrade(const Robot& robot, std::uint64_t seed) {
  constexpr double kSlowM = 2.0;
  constexpr double kFastM = 0.3;
  Random random(seed);
  const auto normal = [&] { return Vector3d(random.normal(), random.normal(), random.normal()); };
  const EastNorthUp frame(robot.origin);
  const double kept = std::exp(-1.0 / 30.0);
  Vector3d slow = normal();
  Degraded degraded;
  for (std::size_t i = 0; i < robot.places.size(); i += kEvery) {
    slow = kept * slow + std::sqrt(1.0 - kept * kept) * normal();
    const Vector3d at = robot.in_enu[i] + kSlowM * slow + kFastM * normal();
    const GeodeticPlace place = frame.to_place(at);
    GnssFix fix;
    fix.stamp = robot.stamps[i];
    fix.latitude_deg = place.latitude_deg;
    fix.longitude_deg = place.longitude_deg;
    fix.height_m = place.height_m;
    fix.covariance = (kSlowM * kSlowM + kFastM * kFastM) * Eigen::Matrix3d::Identity();
    fix.quality = 1;
    degraded.fixes.push_back(fix);
    degraded.in_enu.push_back(at);
  }
  return degraded;
}

// The odometry with its turns and ways multiplied: a robot that steers by skidding turns less than
// its wheels say, and goes less far.
std::vector<StampedPose> scaled(const std::vector<StampedPose>& odometry, double turns,
                                double ways) {
  std::vector<StampedPose> path = {odometry.front()};
  for (std::size_t i = 1; i < odometry.size(); ++i) {
    const Pose step = odometry[i - 1].world_from_body.inverse() * odometry[i].world_from_body;
    const Pose less(so3_exp(turns * so3_log(step.rotation())), ways * step.translation());
    path.push_back({odometry[i].stamp, path.back().world_from_body * less});
  }
  return path;
}

// A keyframe each half second. The odometry is that of a plane: it knows nothing of slopes, and
// wheels that skid turn by some degrees more or less.
SolvedRun run_of(const std::vector<StampedPose>& odometry) {
  SolvedRun run;
  run.trajectory = odometry;
  for (const StampedPose& pose : odometry) {
    if (!run.stamps.empty() && pose.stamp - run.stamps.back() < 500'000'000) continue;
    if (!run.stamps.empty()) {
      const Pose step = run.graph.world_from_keyframe.back().inverse() * pose.world_from_body;
      const double way = step.translation().norm();
      const double turn = 0.001 + 0.02 * way + 0.05 * step.angle();
      Matrix6d covariance = Matrix6d::Zero();
      covariance.diagonal() << Eigen::Vector2d::Constant(std::pow(0.001 + 0.03 * way, 2.0)),
          turn * turn, Vector3d::Constant(std::pow(0.002 + 0.05 * way, 2.0));
      const int to = static_cast<int>(run.stamps.size());
      run.graph.odometry.push_back({to - 1, to, step, covariance});
    }
    run.graph.world_from_keyframe.push_back(pose.world_from_body);
    run.stamps.push_back(pose.stamp);
  }
  return run;
}

Vector3d place_at(const std::vector<StampedPose>& path, TimeNs stamp) {
  const auto after = std::find_if(path.begin(), path.end(),
                                  [&](const StampedPose& pose) { return pose.stamp >= stamp; });
  if (after == path.begin()) return path.front().world_from_body.translation();
  if (after == path.end()) return path.back().world_from_body.translation();
  const StampedPose& before = *(after - 1);
  const double share =
      static_cast<double>(stamp - before.stamp) / static_cast<double>(after->stamp - before.stamp);
  return (1.0 - share) * before.world_from_body.translation() +
         share * after->world_from_body.translation();
}

// Root mean square over the truth's times, in the plane and in height.
struct PathError {
  double plane_m = 0.0;
  double height_m = 0.0;
};

template <typename At>
PathError path_error_of(const Robot& robot, const At& at) {
  PathError error;
  const auto count = static_cast<double>(robot.stamps.size());
  for (std::size_t i = 0; i < robot.stamps.size(); ++i) {
    const Vector3d off = at(i) - robot.in_enu[i];
    error.plane_m += off.head<2>().squaredNorm() / count;
    error.height_m += off.z() * off.z() / count;
  }
  return {std::sqrt(error.plane_m), std::sqrt(error.height_m)};
}

// The best motion that lays a path on places of its times, with or without a scale.
Eigen::Matrix4d laid_on(const std::vector<StampedPose>& path, const std::vector<TimeNs>& stamps,
                        const std::vector<Vector3d>& places, bool with_scale) {
  Eigen::Matrix3Xd from(3, static_cast<Eigen::Index>(stamps.size()));
  Eigen::Matrix3Xd to = from;
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    from.col(static_cast<Eigen::Index>(i)) = place_at(path, stamps[i]);
    to.col(static_cast<Eigen::Index>(i)) = places[i];
  }
  return Eigen::umeyama(from, to, with_scale);
}

Vector3d moved(const Eigen::Matrix4d& motion, const Vector3d& point) {
  return (motion * point.homogeneous()).head<3>();
}

// The odometry whose turns and ways fit the bad positions best: nothing of the truth is used.
std::vector<StampedPose> calibrated(const Robot& robot, const Degraded& degraded) {
  std::vector<TimeNs> stamps;
  for (const GnssFix& fix : degraded.fixes)
    stamps.push_back(fix.stamp);
  std::vector<StampedPose> best;
  double least = std::numeric_limits<double>::infinity();
  for (double turns = 0.5; turns < 1.205; turns += 0.01) {
    const std::vector<StampedPose> path = scaled(robot.odometry, turns, 1.0);
    const Eigen::Matrix4d motion = laid_on(path, stamps, degraded.in_enu, true);
    double squares = 0.0;
    for (std::size_t i = 0; i < stamps.size(); ++i)
      squares += (moved(motion, place_at(path, stamps[i])) - degraded.in_enu[i]).squaredNorm();
    if (squares >= least) continue;
    least = squares;
    best = scaled(robot.odometry, turns, std::cbrt(motion.topLeftCorner<3, 3>().determinant()));
  }
  return best;
}

PathError positions_alone(const Robot& robot, const Degraded& degraded) {
  return path_error_of(robot, [&](std::size_t i) -> Vector3d {
    const std::size_t before = std::min(i / kEvery, degraded.in_enu.size() - 1);
    const std::size_t after = std::min(before + 1, degraded.in_enu.size() - 1);
    const double share = static_cast<double>(i - before * kEvery) / static_cast<double>(kEvery);
    return (1.0 - share) * degraded.in_enu[before] + share * degraded.in_enu[after];
  });
}

TEST(WheelOdometry, FusedWithBadPositionsIsBetterThanEither) {
  Robot robot;
  if (!read_odometry(robot)) GTEST_SKIP() << data_folder() << " is not there";
  ASSERT_TRUE(read_truth(robot));
  ASSERT_EQ(robot.stamps.size(), 1692U);
  // Foret Montmorency: the zone is right.
  EXPECT_NEAR(robot.origin.latitude_deg, 47.32, 0.03);
  EXPECT_NEAR(robot.origin.longitude_deg, -71.15, 0.05);
  // No start could do better than the best motion onto the truth.
  const Eigen::Matrix4d laid = laid_on(robot.odometry, robot.stamps, robot.in_enu, false);
  const PathError reckoned = path_error_of(
      robot, [&](std::size_t i) { return moved(laid, place_at(robot.odometry, robot.stamps[i])); });
  std::printf("wheel odometry alone, laid on the truth: %.2f m in the plane\n", reckoned.plane_m);
  SplitFitConfig split;
  split.tilt_sd_deg = tilt_sd_deg(LevelledBy::kNothing, 0.0);
  FusedPathConfig config;
  config.odometry_scale = 1.0;
  config.fusion.tilt_sd_deg = split.tilt_sd_deg;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const Degraded degraded = degrade(robot, seed);
    const SolvedRun run = run_of(calibrated(robot, degraded));
    const SplitFit guess = fit_split(pair_by_time(run.trajectory, degraded.fixes, {}).pairs, split);
    ASSERT_TRUE(guess.found) << guess.reason;
    const FusedPath fused = fuse_path(run, degraded.fixes, guess.enu_from_world, {}, split, config);
    ASSERT_TRUE(fused.found) << fused.reason;
    const GnssFix& first = degraded.fixes.front();
    const Pose into =
        change_of_frame({first.latitude_deg, first.longitude_deg, first.height_m}, robot.origin);
    const PathError error = path_error_of(robot, [&](std::size_t i) -> Vector3d {
      return into * place_at(fused.enu_from_body, robot.stamps[i]);
    });
    // The same odometry laid on the same positions as a whole.
    const PathError rigid = path_error_of(robot, [&](std::size_t i) -> Vector3d {
      return into * (guess.enu_from_world * place_at(run.trajectory, robot.stamps[i]));
    });
    const PathError alone = positions_alone(robot, degraded);
    std::printf(
        "seed %d: positions alone %.2f m, odometry laid on them %.2f m, fused %.2f m in the plane, "
        "%.2f m expected; heights %.2f m, %.2f m, %.2f m; odometry scale %.2f\n",
        static_cast<int>(seed), alone.plane_m, rigid.plane_m, error.plane_m, fused.expected_error_m,
        alone.height_m, rigid.height_m, error.height_m, fused.odometry_scale);
    EXPECT_LT(error.plane_m, alone.plane_m) << seed;
    EXPECT_LT(error.plane_m, rigid.plane_m) << seed;
    EXPECT_LT(error.plane_m, reckoned.plane_m) << seed;
  }
}

}  // namespace
}  // namespace understory
