#include "understory/graph/loops/loop_closure.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "understory/geometry/voxel_key.h"
#include "understory/graph/loops/test_bumpy_stand.h"
#include "understory/registration/test_stand.h"
#include "understory/util/angles.h"
#include "understory/util/parallel.h"

#include <unordered_set>

namespace understory {
namespace {

using test::bumpy_stand;

Pose tilted_pose_at(double x, double y, double heading_deg) {
  return {so3_exp({0.0, 0.0, heading_deg * kDegree}) * so3_exp({0.05, -0.03, 0.0}),
          Eigen::Vector3d(x, y, 1.6)};
}

// A small map around a pose: three scans a metre apart, thinned, in the frame of the middle one.
Points submap(const testing::Stand& made, const Pose& world_from_body, std::uint64_t seed) {
  testing::Pattern pattern = testing::os0_128();
  pattern.rings = 64;
  pattern.columns = 256;
  Points points;
  std::unordered_set<std::uint64_t> seen;
  for (int i = -1; i <= 1; ++i) {
    const Pose body_from_scan(Eigen::Quaterniond::Identity(), Eigen::Vector3d(i, 0.0, 0.0));
    const auto scan = testing::scan_stand(made, world_from_body * body_from_scan, pattern,
                                          seed + static_cast<std::uint64_t>(i + 1));
    for (const Eigen::Vector3f& p : scan) {
      const Eigen::Vector3f q = (body_from_scan * p.cast<double>()).cast<float>();
      if (q.norm() > 30.0F) continue;
      const auto cell = [](float v) { return static_cast<int>(std::floor(v / 0.25F)); };
      if (seen.insert(voxel_key(cell(q.x()), cell(q.y()), cell(q.z()))).second) points.push_back(q);
    }
  }
  return points;
}

LoopInput make_input(const testing::Stand& made, const Pose& world_from_target,
                     const Pose& world_from_source) {
  LoopInput input;
  input.target_points = submap(made, world_from_target, 11);
  input.source_points = submap(made, world_from_source, 23);
  input.target_from_source = world_from_target.inverse() * world_from_source;
  input.up_in_target = world_from_target.rotation().conjugate() * Eigen::Vector3d::UnitZ();
  input.up_in_source = world_from_source.rotation().conjugate() * Eigen::Vector3d::UnitZ();
  return input;
}

void print(const LoopVerification& v, const Pose& truth) {
  if (std::getenv("UNDERSTORY_PRINT") == nullptr) return;
  const Vector6d error = right_difference(v.target_from_source, truth);
  std::printf(
      "%s overlap %.2f chance %.2f runner-up %.2f fitness %.4f asym %.3f m %.2f deg, "
      "starts %d, error %.3f m %.2f deg; %s\n",
      v.accepted ? "accepted" : "rejected", v.overlap, v.chance_overlap, v.runner_up, v.fitness_m2,
      v.asymmetry_m, v.asymmetry_deg, v.starts, error.tail<3>().norm(),
      error.head<3>().norm() / kDegree, v.reason.c_str());
}

void expect_right(const LoopVerification& v, const Pose& truth) {
  print(v, truth);
  EXPECT_TRUE(v.accepted) << v.reason;
  const Vector6d error = right_difference(v.target_from_source, truth);
  EXPECT_LT(error.tail<3>().norm(), 0.08);
  EXPECT_LT(error.head<3>().norm(), 0.4 * kDegree);
}

TEST(LoopClosure, FindsThePlaceAgainFromASmallError) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    LoopInput input = make_input(bumpy_stand(45.0, 800.0, seed), tilted_pose_at(0, 0, 0),
                                 tilted_pose_at(4, 2, 170));
    const Pose truth = input.target_from_source;
    input.target_from_source =
        input.target_from_source * Pose(so3_exp({0.0, 0.0, 0.03}), Eigen::Vector3d(0.4, -0.3, 0.2));
    expect_right(verify_loop(input, {}), truth);
  }
}

// Drift of metres and degrees: the search over starts finds it, the belief alone does not.
TEST(LoopClosure, FindsThePlaceAgainAfterDrift) {
  LoopInput input =
      make_input(bumpy_stand(45.0, 800.0, 4), tilted_pose_at(0, 0, 0), tilted_pose_at(3, -4, 100));
  const Pose truth = input.target_from_source;
  input.target_from_source =
      Pose(so3_exp({0.0, 0.0, 0.15}), Eigen::Vector3d(5.0, -4.0, 0.5)) * input.target_from_source;
  input.sigma_translation_m = 4.0;
  input.sigma_rotation_rad = 0.1;
  const LoopVerification found = verify_loop(input, {});
  EXPECT_GT(found.starts, 100);
  expect_right(found, truth);
  input.sigma_translation_m = input.sigma_rotation_rad = 0.0;
  const LoopVerification alone = verify_loop(input, {});
  print(alone, truth);
  EXPECT_FALSE(alone.accepted);
}

// Another place of the same stand, or another stand altogether, is no loop, wherever it is started.
TEST(LoopClosure, OtherPlacesAreRejected) {
  for (std::uint64_t seed = 5; seed <= 6; ++seed) {
    LoopInput input = make_input(bumpy_stand(45.0, 800.0, seed), tilted_pose_at(-25, -20, 0),
                                 tilted_pose_at(25, 20, 100));
    const Pose truth = input.target_from_source;
    input.target_from_source = Pose(so3_exp({0.0, 0.0, 1.0}), Eigen::Vector3d(1.0, 2.0, 0.0));
    input.sigma_translation_m = 4.0;
    input.sigma_rotation_rad = 0.2;
    const LoopVerification v = verify_loop(input, {});
    print(v, truth);
    EXPECT_FALSE(v.accepted) << "seed " << seed;
    EXPECT_FALSE(v.reason.empty());
  }
}

TEST(LoopClosure, NothingToGoBy) {
  LoopInput input;
  EXPECT_FALSE(verify_loop(input, {}).accepted);
  // Bare ground, flat or sloping.
  testing::Stand bare;
  input = make_input(bare, tilted_pose_at(0, 0, 0), tilted_pose_at(2, 0, 10));
  EXPECT_FALSE(verify_loop(input, {}).accepted);
}

TEST(LoopClosure, SameBitsForAnyNumberOfThreads) {
  LoopInput input =
      make_input(bumpy_stand(45.0, 800.0, 2), tilted_pose_at(0, 0, 0), tilted_pose_at(4, 2, 170));
  input.sigma_translation_m = 1.5;
  input.sigma_rotation_rad = 0.05;
  std::vector<LoopVerification> results;
  for (const int threads : {1, 3})
    with_threads(threads, [&] { results.push_back(verify_loop(input, {})); });
  EXPECT_EQ(results[0].target_from_source.matrix(), results[1].target_from_source.matrix());
  EXPECT_EQ(results[0].covariance, results[1].covariance);
  EXPECT_EQ(results[0].overlap, results[1].overlap);
}

}  // namespace
}  // namespace understory
