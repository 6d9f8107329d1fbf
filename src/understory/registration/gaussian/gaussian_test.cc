#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "understory/registration/gaussian/gaussian_matcher.h"
#include "understory/registration/gaussian/gaussian_voxels.h"
#include "understory/registration/icp/surface.h"
#include "understory/registration/ndt_d2d/ndt_d2d_matcher.h"
#include "understory/registration/vgicp/vgicp_matcher.h"
#include "understory/util/random.h"

namespace understory {
namespace {

Eigen::Matrix3d some_covariance(Random& random) {
  Eigen::Matrix3d root;
  for (int i = 0; i < 9; ++i)
    root(i / 3, i % 3) = random.normal();
  return 0.01 * root * root.transpose() + 1e-5 * Eigen::Matrix3d::Identity();
}

Eigen::Vector3d some_vector(Random& random) {
  return {random.normal(), random.normal(), random.normal()};
}

// A rough floor and a rough wall, as a map and as a grid.
Points floor_and_wall(std::uint64_t seed) {
  Random random(seed);
  Points points;
  for (int i = 0; i < 9000; ++i) {
    const auto a = static_cast<float>(random.uniform(-3.0, 3.0));
    const auto b = static_cast<float>(random.uniform(-3.0, 3.0));
    const auto rough = static_cast<float>(0.05 * random.normal());
    points.push_back(i % 2 == 0 ? Eigen::Vector3f(a, b, rough)
                                : Eigen::Vector3f(3.0F + rough, a, 3.0F + b));
  }
  return points;
}

IcpMapPtr covariance_map() {
  IcpMapConfig config;
  config.covariances = true;
  IcpMapBuilder builder(config);
  builder.insert(floor_and_wall(3), Pose());
  return builder.snapshot();
}

Pose small_turn() {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d(1.0, 2.0, -1.0).normalized())),
          Eigen::Vector3d(0.04, -0.03, 0.05)};
}

// P3 (3) and (5): e^T W^-1 e is the sum of three squared distances from planes, each over its
// eigenvalue.
TEST(PointToGaussian, ThreePlanesAreTheMahalanobisDistance) {
  Random random(4);
  for (int k = 0; k < 50; ++k) {
    const Eigen::Matrix3d w = some_covariance(random);
    const Eigen::Matrix3d rows = three_planes(w);
    const Eigen::Vector3d e = some_vector(random);
    const double direct = e.dot(w.fullPivLu().solve(e));
    EXPECT_NEAR((rows * e).squaredNorm(), direct, 1e-6 * direct);
    // Each row is a plane of its own: unit normals, perpendicular, the most certain one first.
    const Eigen::Matrix3d products = rows * w * rows.transpose();
    EXPECT_LT((products - Eigen::Matrix3d::Identity()).norm(), 1e-6);
    EXPECT_GE(rows.row(0).norm(), rows.row(1).norm());
    EXPECT_NEAR(rows.row(0).dot(rows.row(1)), 0.0, 1e-5 * rows.row(0).squaredNorm());
  }
}

// A thin covariance is point to plane: the special case that P3 section 3.1 names.
TEST(PointToGaussian, AThinCovarianceIsPointToPlane) {
  const Eigen::Vector3d normal = Eigen::Vector3d(1.0, 2.0, 2.0) / 3.0;
  const Eigen::Matrix3d w =
      100.0 * Eigen::Matrix3d::Identity() + (1e-4 - 100.0) * normal * normal.transpose();
  const Eigen::Vector3d e(0.3, -0.1, 0.2);
  EXPECT_NEAR((three_planes(w) * e).squaredNorm(), std::pow(normal.dot(e), 2) / 1e-4,
              1e-3 * std::pow(normal.dot(e), 2) / 1e-4);
}

// The cost of one point against (3), worked out with an inverse. For the Gaussian of the source, W
// is the sum with the source's turned one.
TEST(PointToGaussian, ThePairCountsInTheMetricOfTheMap) {
  const IcpMapPtr map = covariance_map();
  GaussianIcpConfig config;
  config.steps.loss.kind = LossKind::kNone;
  const Pose pose = small_turn();
  Random random(5);
  const Eigen::Matrix3f own = some_covariance(random).cast<float>();
  for (const bool source_too : {false, true}) {
    const GaussianIcpTarget target(map, config, source_too);
    GaussianSource source{{{0.4F, -0.3F, 0.1F}}, {}, {}};
    if (source_too) source.covariances = {own};
    IcpPair nearest;
    IcpMap::Known at;
    ASSERT_TRUE(map->nearest(pose * source.means[0].cast<double>(), 0.5, nearest, at));
    ASSERT_NE(map->covariance(at.spot), nullptr);
    Eigen::Matrix3d w = map->covariance(at.spot)->cast<double>() +
                        config.steps.sigma_m * config.steps.sigma_m * Eigen::Matrix3d::Identity();
    if (source_too)
      w += pose.rotation_matrix() * own.cast<double>() * pose.rotation_matrix().transpose();
    std::vector<GaussianIcpTarget::Known> known(1);
    const MatchSums sums = internal::gaussian_sums(target, source, pose, config.steps, known);
    const double direct = nearest.offset.dot(w.fullPivLu().solve(nearest.offset));
    EXPECT_NEAR(sums.cost, 0.5 * direct, 1e-5 * direct);
  }
}

// The covariance of a point of the map is that of the means of the cubes around it.
TEST(PointToGaussian, TheMapHasTheCovarianceOfTheSurroundings) {
  const IcpMapPtr map = covariance_map();
  Points spots;
  map->for_each([&](const Eigen::Vector3d& at, const SurfacePatch&) {
    spots.emplace_back(at.cast<float>());
  });
  IcpPair nearest;
  IcpMap::Known known;
  const Eigen::Vector3d middle(0.1, 0.1, 0.0);
  ASSERT_TRUE(map->nearest(middle, 0.5, nearest, known));
  const Eigen::Vector3d spot = middle - nearest.offset;
  const auto cube = [](double v) { return std::floor(v / 0.25); };
  std::vector<Eigen::Vector3d> around;
  for (const Eigen::Vector3f& p : spots) {
    double most = 0.0;
    for (int k = 0; k < 3; ++k)
      most = std::max(most, std::abs(cube(static_cast<double>(p[k])) - cube(spot[k])));
    if (most <= 2.0) around.push_back(p.cast<double>());
  }
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& p : around)
    mean += p / static_cast<double>(around.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const auto& p : around)
    covariance += (p - mean) * (p - mean).transpose() / static_cast<double>(around.size());
  EXPECT_LT((map->covariance(known.spot)->cast<double>() - covariance).norm(),
            1e-4 * covariance.norm());
}

// The gradient of every target against differences. `source`: its covariances do not turn where the
// method takes W as that of the step, so that its gradient is exact as well.
template <typename Target>
void expect_gradient(const Target& target, const GaussianSource& source,
                     const GaussianStepsConfig& steps, const Pose& pose) {
  const auto sums = [&](const Pose& at) {
    std::vector<typename Target::Known> known(source.means.size());
    return internal::gaussian_sums(target, source, at, steps, known);
  };
  const MatchSums here = sums(pose);
  ASSERT_GT(here.matched, 0U);
  const double h = 1e-5;
  for (int i = 0; i < 6; ++i) {
    const double slope = (sums(pose * Pose::exp(h * Vector6d::Unit(i))).cost -
                          sums(pose * Pose::exp(-h * Vector6d::Unit(i))).cost) /
                         (2.0 * h);
    EXPECT_NEAR(here.gradient[i], slope, 2e-3 * here.gradient.norm());
  }
}

TEST(PointToGaussian, TheGradientAgreesWithDifferences) {
  const GaussianIcpConfig config;
  expect_gradient(GaussianIcpTarget(covariance_map(), config, false),
                  {{{0.4F, -0.3F, 0.1F}}, {}, {}}, config.steps, small_turn());
}

GaussianVoxelsPtr grid(bool of_surfaces, double voxel_m) {
  GaussianVoxelsBuilder builder({voxel_m, 5, of_surfaces});
  const Points points = floor_and_wall(3);
  builder.insert(points, of_surfaces ? covariances_of(points, 12) : std::vector<Eigen::Matrix3f>(),
                 Pose());
  return builder.snapshot();
}

// Stoyanov et al. (5): the covariance of the source turns along, and its gradient (8) is exact.
TEST(NdtD2d, TheGradientAgreesWithDifferencesWhileTheSourceTurns) {
  const NdtD2dMatcherConfig config;
  Random random(6);
  for (const Eigen::Vector3f& mean :
       {Eigen::Vector3f(0.4F, -0.3F, 0.1F), Eigen::Vector3f(2.9F, 0.4F, 3.3F)}) {
    const GaussianSource source{{mean}, {some_covariance(random).cast<float>()}, {}};
    expect_gradient(NdtD2dTarget(grid(false, 1.0), config), source, config.steps, small_turn());
  }
}

// The cost of a pair of cells, by an inverse and the exponential as printed.
TEST(NdtD2d, APairCountsByTheExponentialOfItsDistance) {
  NdtD2dMatcherConfig config;
  const GaussianVoxelsPtr cells = grid(false, 1.0);
  Random random(7);
  const Pose pose = small_turn();
  const Eigen::Matrix3d own = some_covariance(random);
  const GaussianSource source{{{0.4F, -0.3F, 0.1F}}, {own.cast<float>()}, {}};
  Eigen::Vector3d offset;
  const GaussianVoxel* cell = cells->find(pose * source.means[0].cast<double>(), true, offset);
  ASSERT_NE(cell, nullptr);
  const double noise = 2.0 * config.steps.sigma_m * config.steps.sigma_m;
  const Eigen::Matrix3d w = cell->covariance.cast<double>() +
                            pose.rotation_matrix() * own * pose.rotation_matrix().transpose() +
                            noise * Eigen::Matrix3d::Identity();
  const double squared = offset.dot(w.inverse() * offset);
  std::vector<NdtD2dTarget::Known> known(1);
  const double cost =
      internal::gaussian_sums(NdtD2dTarget(cells, config), source, pose, config.steps, known).cost;
  EXPECT_NEAR(cost, 0.5 * 9.0 * (1.0 - std::exp(-squared / 9.0)), 1e-5);
}

// A cell holds the mean and the covariance of the points in it, P4 (40); a voxel of VGICP the mean
// of their covariances.
TEST(GaussianVoxels, HoldTheMeanAndTheCovarianceOfTheirPoints) {
  const Points points = floor_and_wall(3);
  const std::vector<Eigen::Matrix3f> covariances = covariances_of(points, 12);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d surfaces = Eigen::Matrix3d::Zero();
  double n = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d p = points[i].cast<double>();
    if (std::floor(p.x()) != 0.0 || std::floor(p.y()) != 0.0 || std::floor(p.z()) != 0.0) continue;
    ++n;
    sum += p;
    products += p * p.transpose();
    surfaces += covariances[i].cast<double>();
  }
  ASSERT_GT(n, 20.0);
  const Eigen::Vector3d mean = sum / n;
  for (const bool of_surfaces : {false, true}) {
    Eigen::Vector3d offset;
    const auto voxels = grid(of_surfaces, 1.0);
    const GaussianVoxel* voxel = voxels->find(Eigen::Vector3d(0.5, 0.5, 0.5), false, offset);
    ASSERT_NE(voxel, nullptr);
    EXPECT_LT((Eigen::Vector3d(0.5, 0.5, 0.5) - offset - mean).norm(), 1e-5);
    const Eigen::Matrix3d own = voxel->covariance.cast<double>();
    if (of_surfaces) {
      EXPECT_LT((own - surfaces / n).norm(), 1e-4 * own.norm());
      continue;
    }
    // Across the floor it is that of the points, and along it a metre, in the same axes.
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> points_alone(products / n -
                                                                      mean * mean.transpose());
    const Eigen::Matrix3d axes = points_alone.eigenvectors();
    const Eigen::Matrix3d turned = axes.transpose() * own * axes;
    EXPECT_NEAR(turned(0, 0), points_alone.eigenvalues()[0], 1e-4);
    EXPECT_NEAR(turned(1, 1), 1.0, 1e-3);
    EXPECT_NEAR(turned(2, 2), 1.0, 1e-3);
    EXPECT_LT(turned.row(0).tail<2>().norm(), 1e-3);
  }
}

TEST(GaussianVoxels, AreTheSameMadeInStepsOrAtOnce) {
  const Points points = floor_and_wall(8);
  const auto half = static_cast<std::ptrdiff_t>(points.size() / 2);
  GaussianVoxelsBuilder at_once({0.5, 3, false});
  GaussianVoxelsBuilder in_steps({0.5, 3, false});
  at_once.insert(points, {}, Pose());
  in_steps.insert({points.begin(), points.begin() + half}, {}, Pose());
  const GaussianVoxelsPtr held = in_steps.snapshot();
  in_steps.insert({points.begin() + half, points.end()}, {}, Pose());
  at_once.remove_beyond(Eigen::Vector3d::Zero(), 2.5);
  in_steps.remove_beyond(Eigen::Vector3d::Zero(), 2.5);
  const GaussianVoxelsPtr a = at_once.snapshot();
  const GaussianVoxelsPtr b = in_steps.snapshot();
  ASSERT_EQ(a->size(), b->size());
  std::vector<Eigen::Vector3d> means[2];
  a->for_each([&](const Eigen::Vector3d& mean, const GaussianVoxel&) { means[0].push_back(mean); });
  b->for_each([&](const Eigen::Vector3d& mean, const GaussianVoxel&) { means[1].push_back(mean); });
  EXPECT_EQ(means[0], means[1]);
  EXPECT_GT(held->size(), a->size());  // the one held keeps what was forgotten since
}

// Koide et al. (13): the point's own surface and the mean of the voxel's, added.
TEST(Vgicp, APairCountsInTheMetricOfItsSurfaceAndTheVoxels) {
  VgicpMatcherConfig config;
  config.steps.loss.kind = LossKind::kNone;
  const GaussianVoxelsPtr voxels = grid(true, 1.0);
  const Pose pose = small_turn();
  Random random(9);
  const Eigen::Matrix3d own = some_covariance(random);
  const GaussianSource source{{{0.4F, -0.3F, 0.1F}}, {own.cast<float>()}, {}};
  Eigen::Vector3d offset;
  const GaussianVoxel* voxel = voxels->find(pose * source.means[0].cast<double>(), true, offset);
  ASSERT_NE(voxel, nullptr);
  const Eigen::Matrix3d w = voxel->covariance.cast<double>() +
                            pose.rotation_matrix() * own * pose.rotation_matrix().transpose();
  std::vector<VgicpTarget::Known> known(1);
  const double cost =
      internal::gaussian_sums(VgicpTarget(voxels, config), source, pose, config.steps, known).cost;
  const double direct = offset.dot(w.fullPivLu().solve(offset));
  EXPECT_NEAR(cost, 0.5 * direct, 1e-3 * direct);
}

}  // namespace
}  // namespace understory
