#include "understory/odometry/dense/scan_path.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "understory/registration/ndt/ndt_matcher.h"
#include "understory/registration/test_stand.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

constexpr TimeNs kDuration = 100'000'000;
constexpr ScanPathConfig kAgile{3.0, 6.0};

// What a carrier measured that moved from `start` along `path_end` during one turn of its lidar,
// and took itself to stand still.
BodyCloud smeared_scan(const testing::Stand& stand, const Pose& start, const Vector6d& path_end) {
  BodyCloud cloud;
  constexpr int kSteps = 16;
  for (int step = 0; step < kSteps; ++step) {
    const double share = (step + 0.5) / kSteps;
    const Pose pose = start * Pose::exp(share * path_end);
    for (const Eigen::Vector3f& p : testing::scan_stand(stand, pose, testing::vlp16(), 3)) {
      const double turned = std::atan2(p.y(), p.x()) / (2.0 * std::numbers::pi) + 0.5;
      if (static_cast<int>(turned * kSteps) != step) continue;
      const std::size_t at = cloud.size();
      cloud.resize(at + 1);
      cloud.points[at] = p;
      cloud.t_ns[at] = static_cast<std::uint32_t>(turned * kDuration);
    }
  }
  return cloud;
}

class ScanPath : public ::testing::Test {
 protected:
  ScanPath() : stand_(testing::make_stand({.half_width_m = 18.0}, 4)) {
    const auto builder =
        make_matcher({.cell_sizes_m = {0.5}, .cells = {}, .steps = {}})->make_builder({});
    for (int i = -3; i <= 3; ++i) {
      const Pose pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.4 * i, 0.1 * i, 1.6));
      builder->insert(testing::scan_stand(stand_, pose, testing::vlp16(), 10 + i), pose,
                      std::nullopt);
    }
    map_ = builder->snapshot();
    end_ << 0.01, -0.02, 0.09, 0.12, -0.05, 0.03;  // 5 degrees and 13 cm in a tenth of a second
  }

  testing::Stand stand_;
  MatchTargetPtr map_;
  Pose start_{Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.2, 0.0, 1.6)};
  Vector6d end_;
};

TEST_F(ScanPath, FindsTheMotionThatARigidMatchAveragesOver) {
  const BodyCloud cloud = smeared_scan(stand_, start_, end_);
  ASSERT_GT(cloud.size(), 5000U);
  const RegistrationResult rigid = map_->match(cloud.points, start_, {}, MatchStart::kNear);
  ASSERT_TRUE(rigid.usable());
  const ScanPathCorrection found =
      match_scan_path(*map_, cloud, kDuration, rigid.target_from_source, kAgile);
  EXPECT_GT(found.iterations, 1);
  const Pose first = rigid.target_from_source * Pose::exp(found.at_start);
  const Pose last = rigid.target_from_source * Pose::exp(found.at_end);
  const Vector6d off = right_difference(start_, first);
  EXPECT_GT(right_difference(start_, rigid.target_from_source).tail<3>().norm(), 0.04);
  EXPECT_LT(off.tail<3>().norm(), 0.02);
  EXPECT_LT(off.head<3>().norm(), 0.003);
  EXPECT_LT(right_difference(start_ * Pose::exp(end_), last).tail<3>().norm(), 0.03);
}

TEST_F(ScanPath, LeavesAScanAloneThatNeedsNoCorrection) {
  const BodyCloud cloud = smeared_scan(stand_, start_, Vector6d::Zero());
  const RegistrationResult rigid = map_->match(cloud.points, start_, {}, MatchStart::kNear);
  const ScanPathCorrection found =
      match_scan_path(*map_, cloud, kDuration, rigid.target_from_source, {});
  EXPECT_LT((found.at_end - found.at_start).tail<3>().norm(), 0.02);
  EXPECT_LT((found.at_end - found.at_start).head<3>().norm(), 0.002);
}

TEST_F(ScanPath, IsTheSameForAnyNumberOfThreads) {
  const BodyCloud cloud = smeared_scan(stand_, start_, end_);
  ScanPathCorrection one;
  ScanPathCorrection two;
  with_threads(1, [&] { one = match_scan_path(*map_, cloud, kDuration, start_, {}); });
  with_threads(2, [&] { two = match_scan_path(*map_, cloud, kDuration, start_, {}); });
  EXPECT_EQ(one.at_start, two.at_start);
  EXPECT_EQ(one.at_end, two.at_end);
}

TEST_F(ScanPath, TooLittleToMatchIsNoCorrection) {
  EXPECT_EQ(match_scan_path(*map_, BodyCloud(), kDuration, start_, {}).iterations, 0);
}

// A method that makes no cost small: scans stay rigid.
class WithoutCost : public MatchTarget {
 public:
  [[nodiscard]] RegistrationResult match(const Points&, const Pose&, const PoseTerms&,
                                         MatchStart) const override {
    return {};
  }
  [[nodiscard]] double reach_m() const override { return 1.0; }
  [[nodiscard]] std::size_t size() const override { return 0; }
};

TEST_F(ScanPath, AMatcherWithoutACostGivesNoCorrection) {
  const BodyCloud cloud = smeared_scan(stand_, start_, end_);
  const ScanPathCorrection none = match_scan_path(WithoutCost(), cloud, kDuration, start_, kAgile);
  EXPECT_EQ(none.iterations, 0);
  EXPECT_EQ(none.at_end, Vector6d(Vector6d::Zero()));
}

TEST_F(ScanPath, CorrectionsGoAlongInProportionToTime) {
  Vector6d turn = Vector6d::Zero();
  turn[2] = 0.2;
  const std::vector<StampedPose> guess = {
      {1000, Pose()}, {1000 + kDuration / 2, Pose()}, {1000 + kDuration, Pose()}};
  const auto path = corrected_path(guess, start_, kDuration, {Vector6d::Zero(), turn, 1});
  ASSERT_EQ(path.size(), 3U);
  EXPECT_EQ(path[1].stamp, guess[1].stamp);
  EXPECT_LT(right_difference(start_, path[0].world_from_body).norm(), 1e-12);
  EXPECT_LT(right_difference(start_ * Pose::exp(0.5 * turn), path[1].world_from_body).norm(), 1e-9);
  EXPECT_LT(right_difference(start_ * Pose::exp(turn), path[2].world_from_body).norm(), 1e-9);
}

}  // namespace
}  // namespace understory
