#include "understory/simulation/truth.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>
#include <vector>

namespace understory {
namespace {

constexpr int kScans = 1000;
constexpr int kStems = 150;

StemReturns stem_of(int scan, int k) {
  return {100'000 * k + scan, (scan + k) % 129, k % 100, 300 * scan + k};
}

// Of more stems than two blocks hold; scan 7 has none.
void fill(TruthLog& log) {
  for (int scan = 0; scan < kScans; ++scan) {
    std::vector<StemReturns> stems;
    for (int k = 0; k < (scan == 7 ? 0 : kStems); ++k)
      stems.push_back(stem_of(scan, k));
    ScanTruth truth;
    truth.stamp = scan;
    log.add(truth, stems);
  }
}

void expect_stems_of(const TruthLog& log, int scan) {
  const std::vector<StemReturns> stems = log.stems(static_cast<std::size_t>(scan));
  ASSERT_EQ(stems.size(), static_cast<std::size_t>(scan == 7 ? 0 : kStems)) << scan;
  for (std::size_t k = 0; k < stems.size(); ++k) {
    const StemReturns wanted = stem_of(scan, static_cast<int>(k));
    ASSERT_EQ(stems[k].tree, wanted.tree) << scan;
    ASSERT_EQ(stems[k].rings, wanted.rings) << scan;
    ASSERT_EQ(stems[k].rings_with_3, wanted.rings_with_3) << scan;
    ASSERT_EQ(stems[k].returns, wanted.returns) << scan;
  }
}

TEST(TruthLog, GivesBackEachScansStems) {
  TruthLog log;
  fill(log);
  EXPECT_LE(log.bytes_in_memory(), 1U << 20) << "one block";
  ASSERT_EQ(log.scans().size(), static_cast<std::size_t>(kScans));
  for (int scan = 0; scan < kScans; ++scan)
    expect_stems_of(log, scan);
  for (const int scan : {990, 3, 700, 7, 440})
    expect_stems_of(log, scan);
}

TEST(TruthLog, KeepsThemInMemoryWhereThereIsNoFolderForThem) {
  const char* const before = std::getenv("TMPDIR");
  const std::string kept = before == nullptr ? "" : before;
  setenv("TMPDIR", "/nowhere/at/all", 1);
  TruthLog log;
  fill(log);
  if (before == nullptr) {
    unsetenv("TMPDIR");
  } else {
    setenv("TMPDIR", kept.c_str(), 1);
  }
  EXPECT_GT(log.bytes_in_memory(), 1U << 20);
  for (const int scan : {0, 7, 999, 500})
    expect_stems_of(log, scan);
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
