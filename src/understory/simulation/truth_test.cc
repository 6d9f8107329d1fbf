#include "understory/simulation/truth.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

// More stems than one block of the log holds, and a scan without any.
TEST(TruthLog, GivesBackEachScansStems) {
  constexpr int kScans = 1000;
  constexpr int kStems = 150;
  const auto stem_of = [](int scan, int k) {
    return StemReturns{100'000 * k + scan, (scan + k) % 129, k % 100, 300 * scan + k};
  };
  TruthLog log;
  for (int scan = 0; scan < kScans; ++scan) {
    std::vector<StemReturns> stems;
    for (int k = 0; k < (scan == 7 ? 0 : kStems); ++k)
      stems.push_back(stem_of(scan, k));
    ScanTruth truth;
    truth.stamp = scan;
    log.add(truth, stems);
  }
  ASSERT_EQ(log.scans().size(), static_cast<std::size_t>(kScans));
  EXPECT_TRUE(log.stems(7).empty());
  for (int scan = 0; scan < kScans; ++scan) {
    if (scan == 7) continue;
    const std::vector<StemReturns> stems = log.stems(static_cast<std::size_t>(scan));
    ASSERT_EQ(stems.size(), static_cast<std::size_t>(kStems)) << scan;
    for (int k = 0; k < kStems; ++k) {
      const StemReturns& stem = stems[static_cast<std::size_t>(k)];
      const StemReturns wanted = stem_of(scan, k);
      ASSERT_EQ(stem.tree, wanted.tree) << scan;
      ASSERT_EQ(stem.rings, wanted.rings) << scan;
      ASSERT_EQ(stem.rings_with_3, wanted.rings_with_3) << scan;
      ASSERT_EQ(stem.returns, wanted.returns) << scan;
    }
  }
}

TEST(TruthLog, PosesOfBothLidarsComeInOrderOfTime) {
  TruthLog log;
  const auto at = [](TimeNs stamp) {
    ScanTruth scan;
    scan.stamp = stamp;
    scan.velocity.x() = static_cast<double>(stamp);
    return scan;
  };
  log.add(at(10), {});
  log.add_pose(at(7));
  log.add_pose(at(14));
  log.add(at(20), {});
  const std::vector<ScanTruth> poses = log.poses();
  ASSERT_EQ(poses.size(), 4U);
  const TimeNs expected[] = {7, 10, 14, 20};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(poses[i].stamp, expected[i]);
    EXPECT_EQ(poses[i].velocity.x(), static_cast<double>(expected[i]));
  }
  EXPECT_EQ(log.scans().size(), 2U) << "returns and biases are of the first lidar's scans";
}

}  // namespace
}  // namespace understory
