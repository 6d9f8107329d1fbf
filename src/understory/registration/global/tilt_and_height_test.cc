#include "understory/registration/global/tilt_and_height.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "understory/registration/global/match_verdict.h"
#include "understory/registration/global/search_cloud.h"
#include "understory/util/random.h"

namespace understory {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

// Stems that lean at random on rolling ground, as a scan of few rings shows them. A stem has a few
// points, and the ground lies on circles around the lidar. Frame of a lidar at `world_from_lidar`.
struct LeaningStand {
  std::vector<Eigen::Vector2d> at;
  std::vector<Eigen::Vector2d> lean;

  explicit LeaningStand(std::uint64_t seed) {
    Random random(seed);
    for (int i = 0; i < 40; ++i) {
      at.emplace_back(random.uniform(-16.0, 16.0), random.uniform(-16.0, 16.0));
      lean.emplace_back(0.05 * random.normal(), 0.05 * random.normal());
    }
  }
  static double ground(const Eigen::Vector2d& p) {
    return 0.3 * std::sin(0.2 * p.x()) + 0.3 * std::cos(0.15 * p.y());
  }
  // What prepare_search would make of it, with the parts that the fit reads.
  [[nodiscard]] SearchCloud seen_from(const Pose& world_from_lidar, std::uint64_t seed,
                                      bool bushes = false) const {
    Random random(seed);
    SearchCloud cloud;
    cloud.few_rings = true;
    const Pose lidar_from_world = world_from_lidar.inverse();
    std::vector<Upright> uprights;
    const auto add = [&](const Eigen::Vector3d& place, double above) {
      cloud.points.push_back((lidar_from_world * place).cast<float>());
      cloud.above_m.push_back(static_cast<float>(above));
    };
    for (std::size_t i = 0; i < at.size(); ++i) {
      Upright upright;
      const double foot = ground(at[i]);
      for (double above = 0.7; above < 6.0; above += 0.5) {
        const Eigen::Vector2d middle = at[i] + above * lean[i];
        add({middle.x() + 0.02 * random.normal(), middle.y() + 0.02 * random.normal(),
             foot + above},
            above);
      }
      const Eigen::Vector2d chest = at[i] + 3.0 * lean[i];
      upright.at = (lidar_from_world * Eigen::Vector3d(chest.x(), chest.y(), foot + 3.0)).head<2>();
      uprights.push_back(upright);
    }
    for (int ring = 0; ring < 6; ++ring) {
      for (int k = 0; k < 120; ++k) {
        const double turn = 2.0 * std::numbers::pi * k / 120.0;
        const Eigen::Vector2d place =
            world_from_lidar.translation().head<2>() +
            (5.0 + 2.5 * ring) * Eigen::Vector2d(std::cos(turn), std::sin(turn));
        const double bush = bushes && k % 5 < 2 ? 0.9 : 0.0;  // taken for ground
        add({place.x(), place.y(), ground(place) + bush + 0.02 * random.normal()}, 0.0);
      }
    }
    cloud.axes = upright_axes(uprights, cloud.points, cloud.above_m);
    cloud.ground_means = ground_means(cloud.points, cloud.above_m);
    return cloud;
  }
};

Pose tilted(double x, double y, double z, double yaw, double tilt_x, double tilt_y) {
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
                                    Eigen::AngleAxisd(tilt_y, Eigen::Vector3d::UnitY()) *
                                    Eigen::AngleAxisd(tilt_x, Eigen::Vector3d::UnitX()));
  return {rotation, {x, y, z}};
}

struct Fitted {
  Vector6d off;  // of the fit, rotation first
  TiltAndHeight fit;
};

// The fit from the true place and heading, with a wrong tilt and height.
Fitted fitted(const Eigen::Vector2d& wrong_tilt_deg, double wrong_height_m, bool bushes = false) {
  const LeaningStand stand(3);
  const Pose a = tilted(0.0, 0.0, 2.0, 0.0, 0.0, 0.0);
  const Pose b = tilted(5.0, 3.0, 2.3, 0.7, 0.01, -0.008);
  const Pose truth = a.inverse() * b;
  const Pose tilt = tilted(0.0, 0.0, wrong_height_m, 0.0, wrong_tilt_deg.x() * kDegree,
                           wrong_tilt_deg.y() * kDegree);
  const Pose start(truth.rotation() * tilt.rotation(), truth.translation() + tilt.translation());
  Fitted done;
  done.fit = fit_tilt_and_height(stand.seen_from(a, 1), stand.seen_from(b, 2, bushes), start);
  done.off = right_difference(done.fit.target_from_source, truth);
  return done;
}

TEST(TiltAndHeight, LeansOfStemsAndSharedGroundTellThem) {
  for (const double height : {-1.5, 0.0, 1.0}) {
    const Fitted done = fitted({1.5, -1.0}, height);
    EXPECT_GE(done.fit.axes, 30);
    EXPECT_GE(done.fit.ground, 20);
    EXPECT_LT(done.off.head<2>().norm(), 0.2 * kDegree) << height;
    EXPECT_LT(std::abs(done.off[5]), 0.06) << height;
  }
}

TEST(TiltAndHeight, MostGroundTellsTheHeightWhereBushesHideSomeOfIt) {
  EXPECT_LT(std::abs(fitted({0.5, 0.5}, -1.5, true).off[5]), 0.06);
}

TEST(TiltAndHeight, PlaceAndHeadingStay) {
  const Fitted done = fitted({1.0, 1.0}, 0.5);
  EXPECT_LT(done.off.segment<2>(3).norm(), 0.02);
  EXPECT_LT(std::abs(done.off[2]), 0.05 * kDegree);
}

TEST(TiltAndHeight, TheInformationIsOfTiltAndHeightAlone) {
  const Fitted done = fitted({0.5, 0.0}, 0.2);
  const Matrix6d& information = done.fit.information;
  EXPECT_GT(information(0, 0), 1e4);
  EXPECT_GT(information(1, 1), 1e4);
  EXPECT_GT(information(5, 5), 1.0);
  EXPECT_LT(information(2, 2), 1e-3 * information(0, 0));  // heading
  EXPECT_LT(information(3, 3), 1e-3 * information(5, 5));  // place
}

TEST(TiltAndHeight, OtherStemsAndDenseScansTellNothing) {
  const LeaningStand stand(3);
  const LeaningStand other(4);
  const SearchCloud a = stand.seen_from(tilted(0.0, 0.0, 2.0, 0.0, 0.0, 0.0), 1);
  SearchCloud b = stand.seen_from(tilted(1.0, 0.0, 2.0, 0.1, 0.0, 0.0), 2);
  const Pose truth = tilted(1.0, 0.0, 0.0, 0.1, 0.0, 0.0);
  EXPECT_EQ(belief_of_sparse(a, b, truth).terms.size(), 1U);
  EXPECT_TRUE(belief_of_sparse(a, other.seen_from(tilted(1.0, 0.0, 2.0, 0.1, 0.0, 0.0), 2), truth)
                  .terms.empty());
  SearchCloud dense = a;
  dense.few_rings = false;
  b.few_rings = false;
  EXPECT_TRUE(belief_of_sparse(dense, b, truth).terms.empty());
}

TEST(TiltAndHeight, TermsCloseDirectionsThatPointsLeaveOpen) {
  RegistrationResult result;
  result.status = RegistrationStatus::kConverged;
  result.information.diagonal() << 1e-3, 1e-3, 100.0, 1000.0, 1000.0, 1e-3;
  result.degenerate_directions = Eigen::Matrix<double, 6, 3>::Identity();
  PosePrior prior;
  prior.information.diagonal() << 1e5, 1e5, 0.0, 0.0, 0.0, 500.0;
  count_terms({prior}, 10.0, result);
  EXPECT_EQ(result.degenerate_directions.cols(), 1);  // the heading: 1 of 1000
  EXPECT_DOUBLE_EQ(result.information(5, 5), 500.001);
}

}  // namespace
}  // namespace understory
