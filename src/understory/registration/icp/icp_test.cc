#include "understory/registration/icp/icp.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/registration/icp/icp_match.h"
#include "understory/registration/test_stand.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using testing::make_stand;
using testing::scan_stand;
using testing::small_os0;
using testing::thin;
using testing::upright;

struct ScanPair {
  Points target;
  Points source;
  Pose truth;  // target_from_source
};

ScanPair make_scan_pair(std::uint64_t seed) {
  const testing::Stand stand = make_stand({.half_width_m = 20.0, .crowns = false}, seed);
  const Pose a = upright(0, 0, 1.6);
  const Pose b = upright(0.3, 0.1, 1.65, 0.04);
  return {thin(scan_stand(stand, a, small_os0(), 1), 0.25F),
          thin(scan_stand(stand, b, small_os0(), 2), 0.25F), a.inverse() * b};
}

TEST(Icp, RecoversKnownMotionsWithBothMetrics) {
  const ScanPair pair = make_scan_pair(3);
  const Pose guess =
      pair.truth * Pose::exp((Vector6d() << 0.01, -0.01, 0.02, 0.1, -0.1, 0.05).finished());
  for (const auto metric : {IcpConfig::Metric::kPointToPlane, IcpConfig::Metric::kPointToPoint}) {
    IcpConfig config;
    config.metric = metric;
    const bool planes = metric == IcpConfig::Metric::kPointToPlane;
    const IcpTarget target(pair.target, config);
    const RegistrationResult result = register_icp(target, pair.source, guess, {}, config);
    EXPECT_TRUE(result.usable());
    const Vector6d d = right_difference(result.target_from_source, pair.truth);
    EXPECT_LT(d.tail<3>().norm(), planes ? 0.025 : 0.05);
    EXPECT_LT(d.head<3>().norm(), planes ? 0.002 : 0.005);
    EXPECT_GT(result.inlier_ratio, 0.8);
    EXPECT_GT(result.information(5, 5), 0.0);
  }
}

TEST(Icp, FlatGroundIsUndetermined) {
  const testing::Stand flat;
  const Pose a = upright(0, 0, 2.0);
  const IcpConfig config;
  const IcpTarget target(thin(scan_stand(flat, a, small_os0(), 1), 0.25F), config);
  const RegistrationResult result =
      register_icp(target, thin(scan_stand(flat, a, small_os0(), 2), 0.25F), Pose(), {}, config);
  ASSERT_TRUE(result.usable());
  EXPECT_EQ(result.degenerate_directions.cols(), 3);
}

TEST(Icp, SaysWhyItCannot) {
  const ScanPair pair = make_scan_pair(4);
  const IcpConfig config;
  const IcpTarget target(pair.target, config);
  EXPECT_EQ(register_icp(target, Points(5), Pose(), {}, config).status,
            RegistrationStatus::kTooFewPoints);
  EXPECT_EQ(register_icp(IcpTarget({}, config), pair.source, Pose(), {}, config).status,
            RegistrationStatus::kTooFewPoints);
  EXPECT_EQ(register_icp(target, pair.source, upright(300, 0, 0), {}, config).status,
            RegistrationStatus::kTooFewMatches);
}

TEST(Icp, SameBitsForAnyNumberOfThreads) {
  const ScanPair pair = make_scan_pair(5);
  RegistrationResult results[2];
  for (int i = 0; i < 2; ++i) {
    with_threads(i + 1, [&] {
      const IcpConfig config;
      results[i] = register_icp(IcpTarget(pair.target, config), pair.source, Pose(), {}, config);
    });
  }
  EXPECT_EQ(results[0].target_from_source.matrix(), results[1].target_from_source.matrix());
  EXPECT_EQ(results[0].information, results[1].information);
}

// Every metric with every kernel finds the motion, with the scale set or estimated.
TEST(Icp, RecoversKnownMotionsWithAllMetricsAndKernels) {
  const ScanPair pair = make_scan_pair(3);
  const Pose guess =
      pair.truth * Pose::exp((Vector6d() << 0.01, -0.01, 0.02, 0.1, -0.1, 0.05).finished());
  const IcpTarget planes(pair.target, IcpConfig());
  const auto expect_found = [&](const IcpConfig& config, double max_error_m) {
    const RegistrationResult result =
        config.metric == IcpConfig::Metric::kTrimmed
            ? register_icp(IcpTarget(pair.target, config), pair.source, guess, {}, config)
            : register_icp(planes, pair.source, guess, {}, config);
    ASSERT_TRUE(result.usable()) << result.reason;
    EXPECT_LT(right_difference(result.target_from_source, pair.truth).tail<3>().norm(), max_error_m)
        << static_cast<int>(config.metric) << " " << static_cast<int>(config.loss.kind);
  };
  for (const auto metric : {IcpConfig::Metric::kSymmetric, IcpConfig::Metric::kTrimmed}) {
    IcpConfig config;
    config.metric = metric;
    expect_found(config, metric == IcpConfig::Metric::kTrimmed ? 0.06 : 0.02);
  }
  for (int kind = 0; kind <= static_cast<int>(LossKind::kVarTrimmed); ++kind) {
    for (const bool estimate : {false, true}) {
      IcpConfig config;
      config.max_distance_m = 0.5;
      config.loss.kind = static_cast<LossKind>(kind);
      config.loss.estimate_scale = estimate;
      // Least squares take every match for right.
      expect_found(config, config.loss.kind == LossKind::kNone ? 0.1 : 0.03);
    }
  }
}

// Rusinkiewicz 2019 (9): the residual is e^T (n_p + n_q) / 2, and both its sides turn.
TEST(Icp, TheSymmetricMetricAgreesWithItsEquationAndWithDifferences) {
  struct OnePlane {
    struct Known {};
    [[nodiscard]] std::size_t size() const { return 1; }
    bool nearest(const Eigen::Vector3d& at, double, IcpPair& pair, Known&) const {
      pair.offset = at - Eigen::Vector3d(1.0, 2.0, 0.5);
      pair.patch = {SurfaceKind::kPlane, Eigen::Vector3f(0.0F, 0.6F, 0.8F)};
      pair.squared_m2 = static_cast<float>(pair.offset.squaredNorm());
      return true;
    }
  };
  const OnePlane target;
  const Points source = {{1.02F, 1.9F, 0.6F}};
  const std::vector<SurfacePatch> surfaces = {
      {SurfaceKind::kPlane, -Eigen::Vector3f(0.1F, 0.5F, 0.8F).normalized()}};
  IcpConfig config;
  config.metric = IcpConfig::Metric::kSymmetric;
  const auto sums = [&](const Pose& pose) {
    std::vector<OnePlane::Known> known(1);
    return internal::icp_sums(target, source, pose, config, surfaces, known);
  };
  const Pose pose = Pose::exp((Vector6d() << 0.05, -0.03, 0.02, 0.01, 0.03, -0.02).finished());
  const MatchSums here = sums(pose);
  const Eigen::Vector3d e = pose * source[0].cast<double>() - Eigen::Vector3d(1.0, 2.0, 0.5);
  const Eigen::Vector3d normals = Eigen::Vector3d(0.0, 0.6, 0.8) -
                                  pose.rotation_matrix() * surfaces[0].direction.cast<double>();
  const double squared = std::pow(0.5 * e.dot(normals), 2);
  EXPECT_NEAR(here.cost, 0.5 * 0.01 * squared / (0.01 + squared) / (0.03 * 0.03), 1e-5);
  const double h = 1e-6;
  for (int i = 0; i < 6; ++i) {
    const double slope = (sums(pose * Pose::exp(h * Vector6d::Unit(i))).cost -
                          sums(pose * Pose::exp(-h * Vector6d::Unit(i))).cost) /
                         (2.0 * h);
    EXPECT_NEAR(here.gradient[i], slope, 1e-4 * here.gradient.norm());
  }
}

}  // namespace
}  // namespace understory
