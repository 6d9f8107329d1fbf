#include "understory/pipeline/mapping/finished_trajectory.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

Pose along_x(double x) {
  return Pose(Eigen::Quaterniond::Identity(), {x, 0, 0});
}

// Keyframes at 0 s and 10 s, ten metres apart by odometry; scans every second.
struct ShortRun {
  ShortRun() : journal(folder / "journal.bin") {
    keyframes.resize(2);
    keyframes[0].stamp = 0;
    keyframes[1].stamp = 10 * kNsPerSecond;
    keyframes[1].previous_from_this = along_x(10.0);
    keyframes[1].world_from_body = along_x(10.0);
    for (int i = 0; i <= 15; ++i) {
      ScanRecord record;
      record.stamp = i * kNsPerSecond;
      record.keyframe = i <= 10 ? 0 : 1;
      record.becomes_keyframe = i == 0 || i == 10;
      record.set_pose(along_x(i <= 10 ? i : i - 10));
      record.velocity = {1.0, 0.0, 0.0};
      journal.append(record);
    }
  }
  [[nodiscard]] std::vector<Pose> poses() const {
    std::vector<Pose> result;
    for_each_finished_scan(journal, keyframes, [&](const FinishedScan& scan) {
      result.push_back(scan.world_from_body);
    });
    return result;
  }
  const test::TemporaryFolder folder;
  Journal journal;
  std::vector<Keyframe> keyframes;
};

TEST(FinishedTrajectory, IsTheOdometryWhereNothingMoved) {
  const ShortRun run;
  const auto poses = run.poses();
  ASSERT_EQ(poses.size(), 16U);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_NEAR(poses[i].translation().x(), static_cast<double>(i), 1e-12);
  }
}

TEST(FinishedTrajectory, SpreadsACorrectionByPowersAndCarriesItOn) {  // P0 (19, 20)
  ShortRun run;
  Vector6d xi;
  xi << 0.0, 0.0, 0.2, 1.0, 0.5, 0.0;
  const Pose correction = Pose::exp(xi);
  run.keyframes[1].world_from_body = along_x(10.0) * correction;
  const auto poses = run.poses();
  for (std::size_t i = 0; i <= 10; ++i) {
    const Pose expected =
        along_x(static_cast<double>(i)) * Pose::exp(0.1 * static_cast<double>(i) * xi);
    EXPECT_LT((poses[i].matrix() - expected.matrix()).norm(), 1e-12) << i;
  }
  for (std::size_t i = 11; i < poses.size(); ++i) {
    const Pose expected = along_x(10.0) * correction * along_x(static_cast<double>(i) - 10.0);
    EXPECT_LT((poses[i].matrix() - expected.matrix()).norm(), 1e-12) << i;
  }
}

// A piece that was laid elsewhere: scans before it stay, its own go with it.
TEST(FinishedTrajectory, APieceTakesItsFirstScanAlongAndNoneBefore) {
  ShortRun run;
  run.keyframes[1].begins_piece = true;
  const Pose elsewhere(so3_exp({0, 0, 1.5707963267948966}), {40.0, -7.0, 1.0});
  run.keyframes[1].world_from_body = elsewhere;
  std::vector<FinishedScan> scans;
  for_each_finished_scan(run.journal, run.keyframes,
                         [&](const FinishedScan& scan) { scans.push_back(scan); });
  for (std::size_t i = 0; i < 10; ++i) {
    EXPECT_NEAR(
        (scans[i].world_from_body.translation() - Eigen::Vector3d(static_cast<double>(i), 0.0, 0.0))
            .norm(),
        0.0, 1e-12)
        << i;
  }
  for (std::size_t i = 10; i < scans.size(); ++i) {
    const Pose expected = elsewhere * along_x(static_cast<double>(i) - 10.0);
    EXPECT_LT((scans[i].world_from_body.matrix() - expected.matrix()).norm(), 1e-12) << i;
    EXPECT_LT((scans[i].velocity_in_world - Eigen::Vector3d(0, 1, 0)).norm(), 1e-12) << i;
  }
}

TEST(FinishedTrajectory, VelocityTurnsWithItsKeyframe) {
  ShortRun run;
  run.keyframes[1].world_from_body =
      Pose(so3_exp({0, 0, 1.5707963267948966}), run.keyframes[1].world_from_body.translation());
  Eigen::Vector3d last;
  for_each_finished_scan(run.journal, run.keyframes,
                         [&](const FinishedScan& scan) { last = scan.velocity_in_world; });
  EXPECT_LT((last - Eigen::Vector3d(0, 1, 0)).norm(), 1e-12);
}

}  // namespace
}  // namespace understory
