#include "understory/odometry/dense/scan_motion.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

// Motions of 1 m in changing directions, of which scans show `share` times as much, and more or
// less by turns.
ScanMotion told(double share, double differs, int probes) {
  ScanMotionSums sums;
  for (int k = 0; k < probes; ++k) {
    const Vector6d between = Vector6d::Unit(3 + k % 3);
    Vector6d within = (share + (k % 2 == 0 ? differs : -differs)) * between;
    within[0] += 5.0;  // across the motion: it tells nothing of the ratio
    sums.add(within, between);
  }
  return sums.motion();
}

TEST(ScanMotionSums, TheRatioIsThatOfTheMotions) {
  const ScanMotion right = told(1.0, 0.0, 8);
  EXPECT_EQ(right.probes, 8);
  EXPECT_NEAR(right.ratio, 1.0, 1e-12);
  EXPECT_NEAR(right.sd, 0.0, 1e-7);
  EXPECT_NEAR(told(-1.0, 0.0, 8).ratio, -1.0, 1e-12);
  EXPECT_EQ(ScanMotionSums().motion().ratio, 0.0);
}

TEST(ScanMotionSums, ProbesThatDifferMakeItUnsure) {
  // Each is 0.3 off: the mean of n has 0.3 / sqrt(n - 1).
  EXPECT_NEAR(told(0.5, 0.3, 10).ratio, 0.5, 1e-12);
  EXPECT_NEAR(told(0.5, 0.3, 10).sd, 0.1, 1e-12);
  EXPECT_NEAR(told(0.5, 0.3, 82).sd, 0.3 / 9.0, 1e-12);
  EXPECT_EQ(told(0.5, 0.3, 1).sd, 0.0);
}

}  // namespace
}  // namespace understory
