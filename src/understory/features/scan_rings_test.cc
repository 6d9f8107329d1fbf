#include "understory/features/scan_rings.h"

#include <gtest/gtest.h>

#include <cmath>

namespace understory {
namespace {

// `sweep_rad`: by how much the elevation of a ring varies over the scan.
Scan scan_of(int rings, double sweep_rad) {
  Scan scan;
  for (int i = 0; i < 4000; ++i) {
    const double elevation = -0.2 + 0.03 * (i % rings) + sweep_rad * std::sin(0.37 * i);
    const double azimuth = 0.001 * i;
    const double range = 3.0 + i % 17;
    ScanPoint point;
    point.x = static_cast<float>(range * std::cos(elevation) * std::cos(azimuth));
    point.y = static_cast<float>(range * std::cos(elevation) * std::sin(azimuth));
    point.z = static_cast<float>(range * std::sin(elevation));
    point.ring = static_cast<std::uint16_t>(i % rings);
    scan.points.push_back(point);
  }
  return scan;
}

TEST(ScanRings, OfASpinningLidarAreLevelAndLinesAreNot) {
  EXPECT_TRUE(has_level_rings(scan_of(16, 0.0)));
  EXPECT_TRUE(has_level_rings(scan_of(16, 0.02)));  // beams that leave the optics off its centre
  EXPECT_FALSE(has_level_rings(scan_of(4, 0.5)));
}

TEST(ScanRings, TooFewPointsTellNothing) {
  EXPECT_TRUE(has_level_rings(Scan()));
  Scan few = scan_of(4, 0.5);
  few.points.resize(40);
  EXPECT_TRUE(has_level_rings(few));
}

// A scan without ring numbers is told by others.
TEST(ScanRings, AScanWithoutRingsTellsNothing) {
  Scan scan = scan_of(16, 0.0);
  for (ScanPoint& point : scan.points)
    point.ring = 0;
  EXPECT_TRUE(has_level_rings(scan));
}

}  // namespace
}  // namespace understory
