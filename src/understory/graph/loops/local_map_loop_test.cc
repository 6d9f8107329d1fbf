// Steps 2 and 3 of P4's loop closure, on scans cast from where things truly are.
#include "understory/graph/loops/local_map_loop.h"

#include <gtest/gtest.h>

#include "understory/graph/loops/test_bumpy_stand.h"
#include "understory/registration/test_stand.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

using test::bumpy_stand;

Points scan(const testing::Stand& made, const Pose& world_from_body, std::uint64_t seed) {
  testing::Pattern pattern = testing::os0_128();
  pattern.rings = 64;
  pattern.columns = 256;
  pattern.range_m = 30.0;
  return testing::scan_stand(made, world_from_body, pattern, seed);
}

Pose pose_at(double x, double y, double heading_deg) {
  return {so3_exp({0.0, 0.0, heading_deg * kDegree}), Eigen::Vector3d(x, y, 1.6)};
}

// The local map of three scans that ends half a metre before the query, and a candidate that truly
// is at `candidate`.
struct Scene {
  Scene(const Pose& query, const Pose& candidate, std::uint64_t seed = 3) {
    const testing::Stand made = bumpy_stand(60.0, 700.0, seed);
    std::vector<Points> clouds;
    for (int i = 0; i < 3; ++i) {
      const Pose there = query * Pose(Eigen::Quaterniond::Identity(), {-0.5 - i, 0.0, 0.0});
      clouds.push_back(scan(made, there, 10 + static_cast<std::uint64_t>(i)));
      for (const Eigen::Vector3f& p : clouds.back())
        input.map_points_in_query.push_back(
            (query.inverse() * there * p.cast<double>()).cast<float>());
      poses.push_back(there);
    }
    const auto builder = make_matcher(MatcherConfig())->make_builder({});
    for (std::size_t i = 0; i < clouds.size(); ++i)
      builder->insert(clouds[i], poses[i], std::nullopt);
    map = builder->snapshot();
    input.candidate_points = scan(made, candidate, 77);
    input.local_map = map.get();
    input.world_from_candidate = candidate;
    input.world_from_query = query;
  }
  std::vector<Pose> poses;
  MatchTargetPtr map;
  LocalMapLoopInput input;
};

LoopClosureConfig paper() {
  LoopClosureConfig config;
  config.sigma_rotation_deg = 0.01 / kDegree;
  config.sigma_translation_m = 0.01;
  return config;
}

// The graph has the candidate where it drifted to; the edge says where it is by the local map.
TEST(LocalMapLoop, TheEdgeIsTheQuerySeenFromWhereTheCandidateMatchedTheLocalMap) {
  const Pose query = pose_at(0, 0, 20);
  const Pose candidate = pose_at(2.5, -1.5, 200);
  Scene scene(query, candidate);
  scene.input.world_from_candidate =
      candidate * Pose(so3_exp({0.0, 0.0, 0.02}), Eigen::Vector3d(0.5, -0.4, 0.1));
  const LoopVerification loop = register_to_local_map(scene.input, paper());
  ASSERT_TRUE(loop.accepted) << loop.reason;
  const Vector6d error = right_difference(loop.target_from_source, candidate.inverse() * query);
  EXPECT_LT(error.tail<3>().norm(), 0.05);
  EXPECT_LT(error.head<3>().norm(), 0.3 * kDegree);
  EXPECT_GT(loop.fitness_m2, 0.0);
  // Noise of (36) below its threshold: 0.01 about and along each axis.
  EXPECT_TRUE(loop.covariance.isApprox(1e-4 * Matrix6d::Identity(), 1e-12));
}

TEST(LocalMapLoop, ACandidateThatFitsBadlyIsRefused) {
  const Pose query = pose_at(0, 0, 20);
  Scene scene(query, pose_at(2.5, -1.5, 200));
  LoopClosureConfig config = paper();
  const double fitness = register_to_local_map(scene.input, config).fitness_m2;
  ASSERT_LT(fitness, config.max_fitness_m2);
  config.max_fitness_m2 = 0.9 * fitness;
  const LoopVerification refused = register_to_local_map(scene.input, config);
  EXPECT_FALSE(refused.accepted);
  EXPECT_NE(refused.reason.find("mean squared distance"), std::string::npos) << refused.reason;
}

// What lies where the map shows nothing counts with its distance, unlike in the matcher's fitness.
TEST(LocalMapLoop, FitnessIsTheMeanSquaredDistanceOfAllPointsFromTheirNearest) {
  const Pose query = pose_at(0, 0, 0);
  Scene scene(query, query);
  scene.input.candidate_points = scene.input.map_points_in_query;
  LoopClosureConfig config = paper();
  config.max_fitness_m2 = 1e6;
  const LoopVerification same = register_to_local_map(scene.input, config);
  ASSERT_TRUE(same.accepted) << same.reason;
  EXPECT_LT(same.fitness_m2, 1e-3);
  const auto points = static_cast<double>(scene.input.candidate_points.size());
  scene.input.candidate_points.push_back({0.0F, 0.0F, -500.0F});
  double nearest = 1e9;
  for (const Eigen::Vector3f& p : scene.input.map_points_in_query)
    nearest = std::min(
        nearest, static_cast<double>((p - Eigen::Vector3f(0.0F, 0.0F, -500.0F)).squaredNorm()));
  const LoopVerification far = register_to_local_map(scene.input, config);
  EXPECT_NEAR(far.fitness_m2, nearest / (points + 1.0), 0.02 * nearest / points);
}

TEST(LocalMapLoop, WithoutALocalMapThereIsNone) {
  Scene scene(pose_at(0, 0, 0), pose_at(1, 0, 0));
  scene.input.local_map = nullptr;
  EXPECT_FALSE(register_to_local_map(scene.input, paper()).accepted);
}

}  // namespace
}  // namespace understory
