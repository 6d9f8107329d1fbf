#include "understory/evaluation/alignment.h"

#include <gtest/gtest.h>

#include "understory/util/error.h"
#include "understory/util/random.h"

namespace understory {
namespace {

Eigen::Vector3d random_point(Random& random, double extent) {
  return {random.uniform(-extent, extent), random.uniform(-extent, extent),
          random.uniform(-extent, extent)};
}

double cost(const std::vector<Eigen::Vector3d>& source, const std::vector<Eigen::Vector3d>& target,
            const Pose& motion) {
  double sum = 0.0;
  for (std::size_t i = 0; i < source.size(); ++i)
    sum += (motion * source[i] - target[i]).squaredNorm();
  return sum;
}

struct Points {
  std::vector<Eigen::Vector3d> source;
  std::vector<Eigen::Vector3d> target;
};

Points noisy_points(std::uint64_t seed, const Pose& motion, double noise_m) {
  Random random(seed);
  Points points;
  for (int i = 0; i < 40; ++i) {
    points.source.push_back(random_point(random, 20.0));
    points.target.push_back(motion * points.source.back() + random_point(random, noise_m));
  }
  return points;
}

TEST(Alignment, Se3RecoversAnyMotionFarFromTheOrigin) {
  Random random(7);
  for (int k = 0; k < 50; ++k) {
    const Pose motion(so3_exp(random_point(random, 1.8)),
                      Eigen::Vector3d(4e5, 6.7e6, 200.0) + random_point(random, 100.0));
    const Points points = noisy_points(100 + k, motion, 0.0);
    const AlignmentResult result = align_points_se3(points.source, points.target);
    ASSERT_TRUE(result.determined);
    EXPECT_LT((motion.inverse() * result.target_from_source).angle(), 1e-8);
    EXPECT_LT((result.target_from_source * points.source[0] - points.target[0]).norm(), 1e-6);
  }
}

// Umeyama's answer is a minimum: no small motion away from it has a smaller cost.
TEST(Alignment, Se3IsTheLeastSquaresMinimum) {
  Random random(8);
  const Points points =
      noisy_points(9, Pose(so3_exp({0.3, -0.2, 2.0}), Eigen::Vector3d(5, 6, 7)), 1.0);
  const Pose best = align_points_se3(points.source, points.target).target_from_source;
  const double smallest = cost(points.source, points.target, best);
  for (int k = 0; k < 200; ++k) {
    Vector6d xi;
    for (int i = 0; i < 6; ++i)
      xi(i) = random.normal(0.0, 1e-3);
    EXPECT_GT(cost(points.source, points.target, best * Pose::exp(xi)), smallest);
  }
}

TEST(Alignment, YawIsTheMinimumAmongTurnsAboutTheVertical) {
  const Points points =
      noisy_points(10, Pose(so3_exp({0.05, -0.02, 2.5}), Eigen::Vector3d(5, 6, 7)), 1.0);
  const Pose best = align_points_yaw(points.source, points.target).target_from_source;
  EXPECT_NEAR(best.rotation_matrix()(2, 2), 1.0, 1e-15);
  const double smallest = cost(points.source, points.target, best);
  for (const double turn : {-1e-3, 1e-3, 0.5, 3.0}) {
    Eigen::Vector3d source_mean = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& p : points.source)
      source_mean += p / static_cast<double>(points.source.size());
    const Pose turned(so3_exp({0, 0, turn}), source_mean - so3_exp({0, 0, turn}) * source_mean);
    EXPECT_GT(cost(points.source, points.target, best * turned), smallest);
  }
}

TEST(Alignment, NeverMirrors) {
  Points points;
  for (int i = 0; i < 12; ++i) {
    points.source.emplace_back(i, i * i % 7, i * 5 % 3);
    points.target.emplace_back(i, i * i % 7, -(i * 5 % 3));
  }
  const Pose best = align_points_se3(points.source, points.target).target_from_source;
  EXPECT_NEAR(best.rotation_matrix().determinant(), 1.0, 1e-12);
}

TEST(Alignment, SaysWhenThePointsDoNotFixTheMotion) {
  const std::vector<Eigen::Vector3d> line = {{0, 0, 0}, {1, 2, 0}, {2, 4, 0}};
  EXPECT_FALSE(align_points_se3(line, line).determined);
  EXPECT_TRUE(align_points_yaw(line, line).determined);
  const std::vector<Eigen::Vector3d> still(5, Eigen::Vector3d(1, 2, 3));
  EXPECT_FALSE(align_points_se3(still, still).determined);
  EXPECT_FALSE(align_points_yaw(still, still).determined);
}

TEST(Alignment, NamesAreReadBack) {
  for (const char* name : {"none", "first", "yaw", "se3"})
    EXPECT_EQ(to_string(alignment_from_name(name)), name);
  EXPECT_THROW((void)alignment_from_name("sim3"), ConfigError);
}

}  // namespace
}  // namespace understory
