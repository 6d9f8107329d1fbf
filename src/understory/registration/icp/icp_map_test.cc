#include "understory/registration/icp/icp_map.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "understory/util/random.h"

namespace understory {
namespace {

constexpr double kCube = 0.25;

Points points_in_cube(Random& random, std::size_t n, double half_m) {
  Points points(n);
  for (Eigen::Vector3f& p : points) {
    for (int k = 0; k < 3; ++k)
      p[k] = static_cast<float>(random.uniform(-half_m, half_m));
  }
  return points;
}

// The mean of the points of each cube, as the map has them.
std::vector<Eigen::Vector3d> means_of(const Points& points, const Pose& pose) {
  std::map<std::array<long, 3>, std::pair<Eigen::Vector3d, int>> cubes;
  for (const Eigen::Vector3f& point : points) {
    const Eigen::Vector3d p = pose * point.cast<double>();
    auto& [sum, n] = cubes
                         .try_emplace({std::lround(std::floor(p.x() / kCube)),
                                       std::lround(std::floor(p.y() / kCube)),
                                       std::lround(std::floor(p.z() / kCube))},
                                      Eigen::Vector3d::Zero(), 0)
                         .first->second;
    sum += p;
    ++n;
  }
  std::vector<Eigen::Vector3d> means;
  for (const auto& [cube, mean] : cubes)
    means.push_back(mean.first / mean.second);
  return means;
}

// Also far from the origin, and where neither the own cube nor its surroundings have a point.
TEST(IcpMap, FindsTheNearestMean) {
  Random random(3);
  const Pose pose(Eigen::Quaterniond::Identity(), {3000.0, -200.0, 40.0});
  const Points points = points_in_cube(random, 600, 2.0);
  IcpMapBuilder builder({.cube_m = kCube, .growth = 0.0, .moved_m = 0.0});
  builder.insert(points, pose);
  const IcpMapPtr map = builder.snapshot();
  const std::vector<Eigen::Vector3d> means = means_of(points, pose);
  ASSERT_EQ(map->size(), means.size());
  int far = 0;
  int none = 0;
  int spared = 0;  // searches
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d at =
        pose * Eigen::Vector3d(random.uniform(-3.0, 3.0), random.uniform(-3.0, 3.0),
                               random.uniform(-3.0, 3.0));
    double best = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& mean : means)
      best = std::min(best, (at - mean).squaredNorm());
    IcpPair pair;
    const double most = i % 2 == 0 ? 0.5 : 1.0;
    // Searched near here before: what is known of that must not mislead.
    IcpMap::Known known;
    const double step_m = random.uniform(0.0, 0.08);
    static_cast<void>(map->nearest(at + Eigen::Vector3d(step_m, 0.0, 0.0), most, pair, known));
    if (step_m < known.slack_m) ++spared;
    const bool found = map->nearest(at, most, pair, known);
    EXPECT_EQ(found, best <= most * most);
    if (!found) {
      ++none;
      continue;
    }
    EXPECT_NEAR(static_cast<double>(pair.squared_m2), best, 1e-4);
    EXPECT_NEAR(pair.offset.squaredNorm(), best, 1e-4);
    if (best > kCube * kCube) ++far;
  }
  EXPECT_GT(far, 200);
  EXPECT_GT(none, 200);
  EXPECT_GT(spared, 200);
}

// A floor, a pole and a ring's trace, each metres from the others.
Points scene(Random& random) {
  Points points;
  const auto noise = [&] { return static_cast<float>(random.normal(0.0, 0.005)); };
  for (int i = 0; i < 4000; ++i)
    points.emplace_back(static_cast<float>(random.uniform(-2.0, 2.0)),
                        static_cast<float>(random.uniform(-2.0, 2.0)), noise());
  for (int i = 0; i < 400; ++i)
    points.emplace_back(10.0F + noise(), noise(), static_cast<float>(random.uniform(1.0, 4.0)));
  for (int i = 0; i < 400; ++i)
    points.emplace_back(static_cast<float>(random.uniform(-2.0, 2.0)), 20.0F + noise(), noise());
  return points;
}

void expect_surfaces(const IcpMap& map, const Eigen::Matrix3d& turned) {
  int planes = 0;
  int poles = 0;
  map.for_each([&](const Eigen::Vector3d& at, const SurfacePatch& patch) {
    const Eigen::Vector3d place = turned.transpose() * at;
    const Eigen::Vector3d direction = turned.transpose() * patch.direction.cast<double>();
    if (place.y() > 15.0) {
      EXPECT_EQ(patch.surface, SurfaceKind::kNothing);
    } else if (place.x() > 5.0) {
      EXPECT_EQ(patch.surface, SurfaceKind::kPole);
      EXPECT_GT(std::abs(direction.z()), 0.99);
      ++poles;
    } else {
      EXPECT_EQ(patch.surface, SurfaceKind::kPlane);
      EXPECT_GT(std::abs(direction.z()), 0.99);
      ++planes;
    }
  });
  EXPECT_GT(planes, 200);
  EXPECT_GT(poles, 8);
}

TEST(IcpMap, KnowsTheSurfaceAroundEachPoint) {
  Random random(4);
  IcpMapBuilder builder({.cube_m = kCube});
  const Pose pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.6, Eigen::Vector3d::UnitZ())),
                  Eigen::Vector3d::Zero());
  builder.insert(scene(random), pose);
  expect_surfaces(*builder.snapshot(), pose.rotation_matrix());
}

// What changes step by step ends up as if it were made at once. Surfaces near a change are worked
// out again, and removed cubes leave no trace.
TEST(IcpMap, IsTheSameMadeInStepsOrAtOnce) {
  Random random(5);
  const Points floor = points_in_cube(random, 3000, 3.0);
  const Points far = points_in_cube(random, 500, 2.0);
  const Pose away(Eigen::Quaterniond::Identity(), {50.0, 0.0, 0.0});
  const IcpMapConfig config{.cube_m = kCube, .growth = 0.0, .moved_m = 0.0};
  IcpMapBuilder at_once(config);
  at_once.insert(floor, Pose());
  IcpMapBuilder in_steps(config);
  in_steps.insert(far, away);
  IcpMapPtr held = in_steps.snapshot();
  const std::size_t size = held->size();
  for (std::size_t i = 0; i < 3; ++i) {
    in_steps.insert({floor.begin() + static_cast<std::ptrdiff_t>(1000 * i),
                     floor.begin() + static_cast<std::ptrdiff_t>(1000 * (i + 1))},
                    Pose());
    if (i == 1) in_steps.remove_beyond(Eigen::Vector3d::Zero(), 20.0);
    static_cast<void>(in_steps.snapshot());
  }
  EXPECT_EQ(held->size(), size);
  std::map<std::array<double, 3>, SurfacePatch> expected;
  at_once.snapshot()->for_each([&](const Eigen::Vector3d& at, const SurfacePatch& patch) {
    expected[{at.x(), at.y(), at.z()}] = patch;
  });
  std::size_t same = 0;
  in_steps.snapshot()->for_each([&](const Eigen::Vector3d& at, const SurfacePatch& patch) {
    const auto found = expected.find({at.x(), at.y(), at.z()});
    ASSERT_NE(found, expected.end());
    EXPECT_EQ(found->second.surface, patch.surface);
    EXPECT_LT((found->second.direction - patch.direction).norm(), 1e-3F);
    ++same;
  });
  EXPECT_EQ(same, expected.size());
}

// Those of the points, in their order, that are farther than epsilon from all taken before.
std::vector<Eigen::Vector3d> points_apart(const Points& points, const Pose& pose, double epsilon_m,
                                          std::vector<Eigen::Vector3d> taken) {
  for (const Eigen::Vector3f& point : points) {
    const Eigen::Vector3d p = pose * point.cast<double>();
    bool alone = true;
    for (const Eigen::Vector3d& other : taken)
      alone = alone && (p - other).norm() > epsilon_m;
    if (alone) taken.push_back(p);
  }
  return taken;
}

std::vector<Eigen::Vector3d> points_of(const IcpMap& map) {
  std::vector<Eigen::Vector3d> points;
  map.for_each([&](const Eigen::Vector3d& point, const SurfacePatch&) { points.push_back(point); });
  return points;
}

double farthest_from(const std::vector<Eigen::Vector3d>& some,
                     const std::vector<Eigen::Vector3d>& others) {
  double farthest = 0.0;
  for (const Eigen::Vector3d& point : some) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& other : others)
      nearest = std::min(nearest, (point - other).norm());
    farthest = std::max(farthest, nearest);
  }
  return farthest;
}

// P3 section 3.3.
TEST(IcpMap, WithEpsilonPointsEnterThatAreFartherFromAllOthers) {
  Random random(8);
  const Pose pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY())),
                  {40.0, -3.0, 2.0});
  IcpMapBuilder builder({.cube_m = kCube, .epsilon_m = 0.1});
  std::vector<Eigen::Vector3d> expected;
  for (int cloud = 0; cloud < 3; ++cloud) {
    const Points points = points_in_cube(random, 1500, 0.8);
    builder.insert(points, pose);
    expected = points_apart(points, pose, 0.1, expected);
    const IcpMapPtr map = builder.snapshot();
    EXPECT_EQ(map->size(), expected.size());
    EXPECT_LT(farthest_from(expected, points_of(*map)), 1e-5);
  }
  EXPECT_LT(expected.size(), 3500U);
  const IcpMapPtr map = builder.snapshot();
  int spared = 0;  // searches
  for (int i = 0; i < 1500; ++i) {
    const Eigen::Vector3d at =
        pose * Eigen::Vector3d(random.uniform(-1.5, 1.5), random.uniform(-1.5, 1.5),
                               random.uniform(-1.5, 1.5));
    IcpPair pair;
    // Searched near here before: what is known of that must not mislead.
    IcpMap::Known known;
    const Eigen::Vector3d before(random.uniform(0.0, 0.03), 0.0, 0.0);
    static_cast<void>(map->nearest(at + before, 0.8, pair, known));
    if (before.x() < known.slack_m) ++spared;
    const double nearest = farthest_from({at}, expected);
    ASSERT_EQ(map->nearest(at, 0.8, pair, known), nearest <= 0.8) << nearest;
    if (nearest <= 0.8) {
      EXPECT_NEAR(pair.offset.norm(), nearest, 1e-5);
    }
  }
  EXPECT_GT(spared, 100);
}

TEST(IcpMap, WithEpsilonWhatIsFarIsForgottenAndMayComeAgain) {
  Random random(9);
  IcpMapBuilder builder({.cube_m = kCube, .epsilon_m = 0.1});
  const Points points = points_in_cube(random, 2000, 2.0);
  builder.insert(points, Pose());
  const std::size_t all = builder.snapshot()->size();
  const Eigen::Vector3d corner(2.0, 2.0, 2.0);
  builder.remove_beyond(corner, 2.0);
  const IcpMapPtr cut = builder.snapshot();
  EXPECT_GT(cut->size(), 100U);
  EXPECT_LT(cut->size(), all / 2);
  for (const Eigen::Vector3d& point : points_of(*cut))
    EXPECT_LT((point - corner).norm(), 2.0 + kCube);
  builder.insert(points, Pose());
  EXPECT_EQ(builder.snapshot()->size(), all);
}

// Also beside the forgotten ones: no surface remembers them.
TEST(IcpMap, WithEpsilonIsTheSameMadeInStepsOrAtOnce) {
  Random random(10);
  const Points near = points_in_cube(random, 6000, 2.0);
  const Points far = points_in_cube(random, 2000, 2.0);
  const Pose away(Eigen::Quaterniond::Identity(), {30.0, 0.0, 0.0});
  const Pose beside(Eigen::Quaterniond::Identity(), {4.2, 0.0, 0.0});  // 0.2 m away
  IcpMapConfig config{.cube_m = kCube, .epsilon_m = 0.08, .growth = 0.0, .max_planarity = 0.99};
  config.covariances = true;
  IcpMapBuilder at_once(config);
  at_once.insert(near, Pose());
  IcpMapBuilder in_steps(config);
  in_steps.insert(far, away);
  IcpMapPtr held = in_steps.snapshot();
  const std::size_t size = held->size();
  for (std::size_t i = 0; i < 3; ++i) {
    in_steps.insert({near.begin() + static_cast<std::ptrdiff_t>(2000 * i),
                     near.begin() + static_cast<std::ptrdiff_t>(2000 * (i + 1))},
                    Pose());
    if (i == 0) in_steps.insert(far, beside);
    static_cast<void>(in_steps.snapshot());
    // From there nearly a plane, between the points of both clouds.
    if (i == 2) in_steps.remove_beyond({-50.0, 0.0, 0.0}, 52.1);
  }
  EXPECT_EQ(held->size(), size);
  const IcpMapPtr expected = at_once.snapshot();
  const IcpMapPtr stepwise = in_steps.snapshot();
  ASSERT_EQ(stepwise->size(), expected->size());
  int compared = 0;
  int told = 0;
  for (const Eigen::Vector3d& point : points_of(*expected)) {
    IcpPair a;
    IcpPair b;
    IcpMap::Known in_expected;
    IcpMap::Known in_stepwise;
    ASSERT_TRUE(expected->nearest(point, 0.5, a, in_expected));
    ASSERT_TRUE(stepwise->nearest(point, 0.5, b, in_stepwise));
    EXPECT_EQ(b.squared_m2, 0.0F);
    EXPECT_EQ(a.patch.surface, b.patch.surface);
    const Eigen::Matrix3f* covariance = expected->covariance(in_expected.spot);
    const Eigen::Matrix3f* other = stepwise->covariance(in_stepwise.spot);
    ASSERT_EQ(covariance == nullptr, other == nullptr);
    ++compared;
    if (covariance == nullptr) continue;
    EXPECT_LT((*covariance - *other).norm(), 1e-4F);
    ++told;
  }
  EXPECT_GT(compared, 500);
  EXPECT_GT(told, 500);
}

// The covariance of a cube is that of all points up to two cubes away, here taken one by one.
TEST(IcpMap, WithEpsilonTheCovarianceIsThatOfTheSurroundings) {
  Random random(11);
  const Points points = points_in_cube(random, 3000, 1.2);
  IcpMapBuilder builder({.cube_m = kCube, .epsilon_m = 0.05, .growth = 0.0, .covariances = true});
  builder.insert(points, Pose());
  const IcpMapPtr map = builder.snapshot();
  const std::vector<Eigen::Vector3d> all = points_of(*map);
  const auto cube_of = [](const Eigen::Vector3d& p, Eigen::Index axis) {
    return std::lround(std::floor(p[axis] / kCube));
  };
  for (std::size_t i = 0; i < all.size(); i += 40) {
    SurfaceSums sums;
    for (const Eigen::Vector3d& other : all) {
      bool near = true;
      for (Eigen::Index axis = 0; axis < 3; ++axis)
        near = near && std::abs(cube_of(other, axis) - cube_of(all[i], axis)) <= 2;
      if (near) sums.add((other - all[i]).cast<float>());
    }
    IcpPair pair;
    IcpMap::Known known;
    ASSERT_TRUE(map->nearest(all[i], 0.5, pair, known));
    const std::optional<Eigen::Matrix3f> expected = covariance_of(sums);
    const Eigen::Matrix3f* covariance = map->covariance(known.spot);
    ASSERT_EQ(expected.has_value(), covariance != nullptr);
    if (expected) {
      EXPECT_LT((*expected - *covariance).norm(), 1e-4F);
    }
  }
}

// Of a dense local map a point takes little over the six bytes of its place.
TEST(IcpMap, WithEpsilonAPointTakesFewBytes) {
  Random random(12);
  Points ground;
  for (int i = 0; i < 60'000; ++i)
    ground.emplace_back(static_cast<float>(random.uniform(-6.0, 6.0)),
                        static_cast<float>(random.uniform(-6.0, 6.0)),
                        static_cast<float>(random.normal(0.1, 0.01)));
  IcpMapBuilder builder({.cube_m = kCube, .epsilon_m = 0.05});
  builder.insert(ground, Pose());
  const auto points = static_cast<double>(builder.snapshot()->size());
  EXPECT_GT(points, 20'000.0);
  EXPECT_LT(builder.bytes(), 12.0 * points);
  EXPECT_GT(builder.bytes(), 6.0 * points);
}

}  // namespace
}  // namespace understory
