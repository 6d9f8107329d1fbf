#include "understory/sensor/scan_content.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

Scan scan_of(std::size_t points, float first_x) {
  Scan scan;
  scan.points.resize(points);
  for (std::size_t i = 0; i < points; ++i)
    scan.points[i].x = first_x + static_cast<float>(i);
  return scan;
}

TEST(ScanContent, TheSamePointsAreARepetition) {
  const std::uint64_t content = content_of(scan_of(100, 1.0F));
  EXPECT_TRUE(is_repetition(content, content_of(scan_of(100, 1.0F))));
  EXPECT_FALSE(is_repetition(content, content_of(scan_of(100, 1.001F))));
  EXPECT_FALSE(is_repetition(content, content_of(scan_of(101, 1.0F))));
}

TEST(ScanContent, ScansWithoutPointsAreNoRepetition) {
  EXPECT_FALSE(is_repetition(content_of(scan_of(0, 0.0F)), content_of(scan_of(0, 0.0F))));
}

}  // namespace
}  // namespace understory
