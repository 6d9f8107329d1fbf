#include "understory/simulation/carrier/carrier.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>

#include "understory/simulation/sensors/inertial.h"
#include "understory/simulation/stand/stand.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

struct Walk {
  explicit Walk(const SiteConfig& config)
      : route(config.carrier, static_cast<std::uint64_t>(config.seed)),
        terrain(config.terrain, 80.0, 80.0, static_cast<std::uint64_t>(config.seed)),
        plan(plan_carrier(config, route, terrain, {})) {}
  Route route;
  Terrain terrain;
  CarrierPlan plan;
};

TEST(QuinticSpline, DerivativesAgreeWithDifferences) {
  std::vector<Eigen::Matrix<double, 1, 1>> controls;
  for (int i = 0; i < 40; ++i)
    controls.emplace_back(std::sin(0.7 * i) + 0.01 * i * i);
  const QuinticSpline<1> spline(controls, 0.25);
  const double h = 1e-4;
  for (double t = 0.6; t < 9.0; t += 0.173) {
    const auto sample = spline.sample(t);
    const double before = spline.value(t - h)[0];
    const double after = spline.value(t + h)[0];
    EXPECT_NEAR(sample.value[0], spline.value(t)[0], 1e-13);
    EXPECT_NEAR(sample.rate[0], (after - before) / (2.0 * h), 1e-5);
    EXPECT_NEAR(sample.acceleration[0], (after - 2.0 * sample.value[0] + before) / (h * h), 1e-4);
  }
}

TEST(QuinticSpline, IsSmoothAcrossKnots) {
  std::vector<Eigen::Matrix<double, 1, 1>> controls;
  for (int i = 0; i < 20; ++i)
    controls.emplace_back(std::cos(2.1 * i));
  const QuinticSpline<1> spline(controls, 1.0);
  for (int knot = 3; knot < 16; ++knot) {
    EXPECT_NEAR(spline.sample(knot - 1e-9).acceleration[0],
                spline.sample(knot + 1e-9).acceleration[0], 1e-6);
  }
}

TEST(CarrierPath, RatesAgreeWithDifferencesOfPoses) {
  for (const char* kind : {"walk", "harvester"}) {
    SiteConfig config;
    config.carrier.kind = kind;
    config.duration_s = 40.0;
    const Walk walk(config);
    const CarrierPath& path = walk.plan.path;
    const double h = 1e-4;
    for (double t = 1.0; t < 39.0; t += 0.377) {
      const CarrierState state = path.state(t);
      const Pose before = path.pose(t - h);
      const Pose after = path.pose(t + h);
      const Eigen::Vector3d rate =
          so3_log(before.rotation().conjugate() * after.rotation()) / (2.0 * h);
      EXPECT_LT((state.angular_rate - rate).norm(), 1e-5);
      EXPECT_LT((state.velocity - (after.translation() - before.translation()) / (2.0 * h)).norm(),
                1e-5);
      const Eigen::Vector3d angular_acceleration =
          (path.state(t + h).angular_rate - path.state(t - h).angular_rate) / (2.0 * h);
      EXPECT_LT((state.angular_acceleration - angular_acceleration).norm(), 1e-4);
    }
  }
}

TEST(CarrierPath, WalkStandsStillThenTurnsQuicklyAndComesBack) {
  SiteConfig config;
  const Walk walk(config);
  const CarrierPath& path = walk.plan.path;
  for (double t = 0.0; t < 2.5; t += 0.1)
    EXPECT_LT(path.state(t).velocity.norm(), 0.02);
  double fastest = 0.0;
  double length = 0.0;
  for (double t = 0.0; t < path.duration_s(); t += 0.05) {
    fastest = std::max(fastest, std::abs(path.state(t).angular_rate.z()));
    length += 0.05 * path.state(t).velocity.head<2>().norm();
  }
  EXPECT_GT(fastest, 1.5);  // rad/s
  EXPECT_LT(fastest, 5.0);
  EXPECT_GT(length, 245.0);
  EXPECT_LT(length, 275.0);
  const Eigen::Vector3d gap =
      path.pose(path.duration_s()).translation() - path.pose(0.0).translation();
  EXPECT_LT(gap.norm(), 0.3);
  EXPECT_GT(path.duration_s(), 190.0);
  EXPECT_LT(path.duration_s(), 270.0);
}

// Seconds at which the body turns at the even rate, and its heading against the end of the turn at
// the start, degrees.
struct FirstTurn {
  double even_s = 0.0;
  double heading_deg = 0.0;
  double farthest_m = 0.0;  // from where it stood
};

FirstTurn first_turn_of(const std::string& kind, double turn_deg) {
  SiteConfig config;
  config.carrier.kind = kind;
  config.carrier.still_s = 6.0;
  config.carrier.first_turn_deg = turn_deg;
  config.carrier.first_turn_rate_deg_s = 20.0;
  config.carrier.begins_aloft = kind == "uav";
  config.duration_s = 12.0;
  const Walk walk(config);
  const CarrierPath& path = walk.plan.path;
  FirstTurn found;
  const Pose start = path.pose(0.0);
  for (double t = 0.0; t < 5.9; t += 0.01) {
    const double rate = path.state(t).angular_rate.z() / kDegree;
    if (std::abs(rate - std::copysign(20.0, turn_deg)) < 0.3) found.even_s += 0.01;
    found.farthest_m =
        std::max(found.farthest_m, (path.pose(t).translation() - start.translation()).norm());
  }
  found.heading_deg =
      so3_log(start.rotation().conjugate() * path.pose(5.9).rotation()).z() / kDegree;
  return found;
}

TEST(Route, RoundsLieOnEachOther) {
  CarrierConfig once;
  once.length_m = 80.0;
  once.laps = 2;
  CarrierConfig thrice = once;
  thrice.rounds = 3;
  const Route one(once, 5);
  const Route three(thrice, 5);
  EXPECT_NEAR(three.length_m(), 240.0, 1e-9);
  for (double at = 0.3; at < 80.0; at += 3.7) {
    EXPECT_EQ(three.place(at), one.place(at));
    for (const double later : {80.0, 160.0}) {
      EXPECT_LT((three.place(at + later) - one.place(at)).norm(), 1e-6);
      const double turns = (three.heading(at + later) - one.heading(at)) / kTau;
      EXPECT_NEAR(turns, later / 40.0, 1e-6) << "two laps a round";
    }
    const Eigen::Vector2d beside = one.place(at) + Eigen::Vector2d(3.0, 1.0);
    EXPECT_EQ(three.distance_to(beside), one.distance_to(beside));
  }
}

TEST(Route, DistanceIsThatOfTheNearestPoint) {
  for (const char* site : {"handheld", "skidoo", "harvester"}) {
    const SiteConfig config = load_site(site, {});
    const Route route(config.carrier, 7);
    for (double x = -130.0; x < 130.0; x += 37.0) {
      for (double y = -120.0; y < 120.0; y += 31.0) {
        double least = 1e300;
        for (double along = 0.0; along <= route.length_m() + 1e-6; along += 0.25)
          least = std::min(least, (route.place(along) - Eigen::Vector2d(x, y)).norm());
        EXPECT_NEAR(route.distance_to({x, y}, 0.0, 1.0), least, 1e-6) << site;
        EXPECT_EQ(route.near({x, y}, least + 0.1), true) << site;
        EXPECT_EQ(route.near({x, y}, least - 0.1), false) << site;
      }
    }
  }
}

TEST(CarrierPath, TurnsOnTheSpotBeforeItLeaves) {
  for (const std::string kind : {"walk", "harvester", "uav"}) {
    for (const double turn_deg : {60.0, -60.0}) {
      const FirstTurn found = first_turn_of(kind, turn_deg);
      EXPECT_NEAR(found.heading_deg, turn_deg, 0.6) << kind;
      EXPECT_NEAR(found.even_s, 60.0 / 20.0 - 0.5, 0.3) << kind;
      EXPECT_LT(found.farthest_m, 0.03) << kind;
    }
  }
}

TEST(CarrierPath, KeepsClearOfStems) {
  for (int seed = 1; seed <= 4; ++seed) {
    SiteConfig config;
    config.seed = seed;
    const Walk walk(config);
    const Stand stand = grow_stand(config.stand, config.carrier, walk.terrain, walk.route,
                                   static_cast<std::uint64_t>(seed));
    EXPECT_GT(stand.trees.size(), 1000U);
    double nearest = 1e9;
    for (double t = 0.0; t < walk.plan.path.duration_s(); t += 0.2) {
      const Eigen::Vector3d place = walk.plan.path.pose(t).translation();
      for (const GrownTree& tree : stand.trees) {
        const double up = place.z() - tree.foot.z();
        const double side = (tree.centre(up) - place).head<2>().norm();
        nearest = std::min(nearest, side - 0.5 * tree.diameter(up));
      }
    }
    EXPECT_GT(nearest, 0.5) << "seed " << seed;
  }
}

TEST(InertialSensor, IntegratedFromTheTrueStartGivesThePathBack) {
  SiteConfig config;
  config.carrier.kind = "walk";
  config.duration_s = 30.0;
  config.imu.rate_hz = 1000.0;
  config.imu.gyro_noise = config.imu.accel_noise = 0.0;
  config.imu.gyro_bias_sd = config.imu.accel_bias_sd = 0.0;
  config.imu.gyro_bias_walk = config.imu.accel_bias_walk = 0.0;
  config.imu.scale_sd = 0.0;
  config.imu.vibration_m_s2 = 0.0;
  config.imu.mount_m = {0.3, -0.2, 0.5};
  config.imu.mount_rpy_deg = {20.0, -10.0, 70.0};
  const Walk walk(config);
  const CarrierPath& path = walk.plan.path;
  InertialSensor imu(config, path, 0);
  const Eigen::Vector3d gravity(
      0.0, 0.0, -normal_gravity(config.origin.latitude_deg, config.origin.height_m));
  Pose world_from_imu = path.pose(0.0) * imu.body_from_imu();
  const CarrierState start = path.state(0.0);
  Eigen::Vector3d velocity =
      start.velocity + start.world_from_body.rotation() *
                           start.angular_rate.cross(imu.body_from_imu().translation());
  ImuSample last = imu.next();
  double worst_m = 0.0;
  double worst_rad = 0.0;
  while (to_seconds(last.stamp) < 25.0) {
    const ImuSample now = imu.next();
    const double dt = to_seconds(now.stamp - last.stamp);
    const Eigen::Quaterniond before = world_from_imu.rotation();
    const Eigen::Quaterniond after =
        before * so3_exp(0.5 * dt * (last.angular_rate + now.angular_rate));
    const Eigen::Vector3d acceleration =
        gravity + 0.5 * (before * last.specific_force + after * now.specific_force);
    world_from_imu =
        Pose(after, world_from_imu.translation() + dt * velocity + 0.5 * dt * dt * acceleration);
    velocity += dt * acceleration;
    const Pose truth = path.pose(to_seconds(now.stamp)) * imu.body_from_imu();
    worst_m = std::max(worst_m, (truth.translation() - world_from_imu.translation()).norm());
    worst_rad = std::max(worst_rad, (truth.inverse() * world_from_imu).angle());
    last = now;
  }
  EXPECT_LT(worst_m, 0.01);
  EXPECT_LT(worst_rad, 1e-4);
}

TEST(InertialSensor, NoiseAndBiasHaveTheGivenSize) {
  SiteConfig config;
  config.carrier.still_s = 200.0;
  config.duration_s = 190.0;
  config.imu.scale_sd = 0.0;
  config.imu.vibration_m_s2 = 0.0;
  config.imu.gyro_bias_walk = config.imu.accel_bias_walk = 0.0;
  const Walk walk(config);
  InertialSensor imu(config, walk.plan.path, 0);
  const Eigen::Vector3d bias = imu.gyro_bias();
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  const int count = 30000;
  for (int i = 0; i < count; ++i) {
    const ImuSample sample = imu.next();
    squares += (sample.angular_rate - bias).cwiseAbs2();
  }
  const double expected = config.imu.gyro_noise * std::sqrt(config.imu.rate_hz);
  for (int axis = 0; axis < 3; ++axis)
    EXPECT_NEAR(std::sqrt(squares[axis] / count), expected, 0.02 * expected);
}

TEST(Gravity, AgreesWithTheEllipsoidsTables) {
  EXPECT_NEAR(normal_gravity(0.0, 0.0), 9.780325, 1e-6);
  EXPECT_NEAR(normal_gravity(45.0, 0.0), 9.8061978, 1e-6);
  EXPECT_NEAR(normal_gravity(90.0, 0.0), 9.832185, 1e-6);
}

}  // namespace
}  // namespace understory
