#include "understory/registration/gicp/gicp.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "understory/util/random.h"

namespace understory {
namespace {

// Level ground at height 0, and a lone point of the source.
struct Ground {
  Ground() {
    Random random(2);
    Points points;
    for (int i = 0; i < 6000; ++i)
      points.emplace_back(static_cast<float>(random.uniform(-3.0, 3.0)),
                          static_cast<float>(random.uniform(-3.0, 3.0)), 0.0F);
    IcpMapBuilder builder({});
    builder.insert(points, Pose());
    map = builder.snapshot();
  }

  [[nodiscard]] MatchSums cost(const Pose& pose, const SurfacePatch& patch,
                               const GicpConfig& config) const {
    std::vector<IcpMap::Known> known(1);
    return gicp_cost(*map, source, {patch}, pose, config, known);
  }

  IcpMapPtr map;
  Points source = {{0.4F, -0.3F, 0.1F}};
};

// Segal et al. (2), with the kernel: share * d^T (C_target + R C_source R^T)^-1 d / 2.
TEST(Gicp, APairCountsInTheMetricOfBothSurfaces) {
  const Ground ground;
  const GicpConfig config;
  const Pose pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX())),
                  Eigen::Vector3d(0.05, 0.02, 0.04));
  const Eigen::Vector3d placed = pose * ground.source[0].cast<double>();
  IcpPair pair;
  IcpMap::Known known;
  ASSERT_TRUE(ground.map->nearest(placed, config.max_distance_m, pair, known));
  for (const SurfacePatch& patch :
       {SurfacePatch{SurfaceKind::kPlane, Eigen::Vector3f::UnitZ()},
        SurfacePatch{SurfaceKind::kPole, Eigen::Vector3f::UnitY()}, SurfacePatch{}}) {
    // Standard deviations along the axes of the body: across a surface 0.03 m, along it 1 m.
    Eigen::Vector3d sigma = Eigen::Vector3d::Ones();
    if (patch.surface == SurfaceKind::kPlane) sigma.z() = 0.03;
    if (patch.surface == SurfaceKind::kPole) sigma.x() = sigma.z() = 0.03;
    const Eigen::Matrix3d turned = pose.rotation_matrix() * sigma.asDiagonal();
    const Eigen::Matrix3d total =
        Eigen::Vector3d(1.0, 1.0, 0.03 * 0.03).asDiagonal().toDenseMatrix() +
        turned * turned.transpose();
    const double squared = pair.offset.dot(total.lu().solve(pair.offset));
    const double share = 9.0 / (9.0 + squared);
    EXPECT_NEAR(ground.cost(pose, patch, config).cost, 0.5 * share * squared, 1e-4 * squared);
  }
}

// Where the source's surface does not turn along (none is seen), the gradient is exact.
TEST(Gicp, TheGradientAgreesWithDifferences) {
  const Ground ground;
  const GicpConfig config;
  const Pose pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY())),
                  Eigen::Vector3d(0.03, -0.02, 0.05));
  const MatchSums at = ground.cost(pose, {}, config);
  const double h = 1e-4;
  for (int i = 0; i < 6; ++i) {
    const auto moved = [&](double by) {
      return ground.cost(pose * Pose::exp(by * Vector6d::Unit(i)), {}, config).cost;
    };
    EXPECT_NEAR(at.gradient[i], (moved(h) - moved(-h)) / (2.0 * h), 1e-3 * at.gradient.norm());
  }
}

}  // namespace
}  // namespace understory
