#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "understory/simulation/simulator.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

// The stream of a small site, with the sensors that a test asks for.
struct Counts {
  std::size_t imu = 0;
  TimeNs longest_gap = 0;
  TimeNs first_imu = -1;
  std::vector<TimeNs> scans;
  std::vector<TimeNs> fixes;
  std::vector<std::size_t> before_fix;  // IMU samples read before each fix
};
Counts read(const std::vector<std::string>& settings) {
  std::vector<std::string> all = {"lidar.columns=64", "stand.trees_per_ha=100",
                                  "stand.ground_plants_per_ha=0"};
  all.insert(all.end(), settings.begin(), settings.end());
  Simulator simulator(load_site("demo", all));
  Counts counts;
  TimeNs last = 0;
  while (const std::optional<Event> event = simulator.next()) {
    if (const auto* sample = std::get_if<ImuSample>(&*event)) {
      if (counts.imu > 0) counts.longest_gap = std::max(counts.longest_gap, sample->stamp - last);
      if (counts.imu == 0) counts.first_imu = sample->stamp;
      last = sample->stamp;
      ++counts.imu;
    }
    if (const auto* scan = std::get_if<ScanPtr>(&*event)) counts.scans.push_back((*scan)->stamp);
    if (const auto* fix = std::get_if<GnssFix>(&*event)) {
      counts.fixes.push_back(fix->stamp);
      counts.before_fix.push_back(counts.imu);
    }
  }
  return counts;
}

TEST(ImuRealism, SamplesGetLostOneByOneAndInGaps) {
  const Counts whole = read({"duration_s=20"});
  EXPECT_EQ(whole.imu, 4000U);
  EXPECT_EQ(whole.longest_gap, 5'000'000);
  const Counts some = read({"duration_s=20", "imu.missing=0.1"});
  EXPECT_NEAR(static_cast<double>(some.imu), 3600.0, 80.0);
  const Counts gaps = read({"duration_s=20", "imu.gap_interval_s=4", "imu.gap_s=0.25"});
  EXPECT_GE(gaps.longest_gap, 250'000'000);
  EXPECT_LE(gaps.longest_gap, 520'000'000);
  EXPECT_GT(gaps.imu, 3200U);
  EXPECT_LT(gaps.imu, 4000U);
}

TEST(Clocks, OffsetsMoveStampsAndNothingElse) {
  const Counts plain = read({"duration_s=2"});
  const Counts late = read({"duration_s=2", "lidar.time_offset_s=0.03", "imu.time_offset_s=-0.01"});
  ASSERT_EQ(plain.scans.size(), late.scans.size());
  for (std::size_t i = 0; i < plain.scans.size(); ++i)
    EXPECT_EQ(late.scans[i] - plain.scans[i], 30'000'000);
  EXPECT_EQ(late.first_imu - plain.first_imu, -10'000'000);
}

TEST(Clocks, FixesComeLateButSayWhenTheyWere) {
  const Counts plain = read({"duration_s=3"});
  const Counts late = read({"duration_s=3", "gnss.latency_s=0.4"});
  ASSERT_GT(late.fixes.size(), 5U);
  for (std::size_t i = 0; i < late.fixes.size(); ++i) {
    EXPECT_EQ(late.fixes[i], plain.fixes[i]);
    EXPECT_NEAR(static_cast<double>(late.before_fix[i]) - static_cast<double>(plain.before_fix[i]),
                80.0, 1.0);
  }
}

TEST(Extrinsics, ClaimIsWrongByTheGivenAmount) {
  const Simulator right(load_site("demo", {"duration_s=1"}));
  const Simulator wrong(load_site(
      "demo", {"duration_s=1", "lidar.error_m=[0.03,0,-0.02]", "lidar.error_rpy_deg=[0,2,0]"}));
  const Pose difference = right.rig().body_from_lidar.inverse() * wrong.rig().body_from_lidar;
  EXPECT_LT((difference.translation() - Eigen::Vector3d(0.03, 0.0, -0.02)).norm(), 1e-12);
  EXPECT_NEAR(so3_log(difference.rotation()).norm(), 2.0 * kDegree, 1e-12);
}

}  // namespace
}  // namespace understory
