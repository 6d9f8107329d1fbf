#include "understory/preprocess/body_cloud.h"

#include <gtest/gtest.h>

#include "understory/sensor/rig.h"

namespace understory {
namespace {

TEST(BodyCloud, IsCutByLidarWithAllThatItsPointsHave) {
  BodyCloud cloud;
  cloud.stamp = 7;
  cloud.resize(4);
  cloud.carried = {0, 1, 0, 1};
  const std::uint16_t third = 2 * kRingsALidar;
  cloud.ring = {5, static_cast<std::uint16_t>(third + 1), 6, third};
  for (std::size_t i = 0; i < 4; ++i) {
    cloud.points[i] = {static_cast<float>(i), 0.0F, 0.0F};
    cloud.range[i] = 10.0F + static_cast<float>(i);
    cloud.intensity[i] = 20.0F + static_cast<float>(i);
    cloud.t_ns[i] = static_cast<std::uint32_t>(30 + i);
  }
  const std::vector<BodyCloud> parts = clouds_by_lidar(cloud);
  ASSERT_EQ(parts.size(), 3U);
  EXPECT_EQ(parts[0].size(), 2U);
  EXPECT_TRUE(parts[1].empty());
  ASSERT_EQ(parts[2].size(), 2U);
  EXPECT_EQ(parts[2].stamp, 7);
  EXPECT_EQ(parts[2].points[0].x(), 1.0F);
  EXPECT_EQ(parts[2].range[1], 13.0F);
  EXPECT_EQ(parts[2].intensity[1], 23.0F);
  EXPECT_EQ(parts[2].t_ns[1], 33U);
  EXPECT_EQ(parts[2].ring[1], third);
  EXPECT_TRUE(parts[2].feature.empty());
  EXPECT_EQ(parts[0].carried, (std::vector<std::uint8_t>{0, 0}));
  EXPECT_EQ(parts[2].carried, (std::vector<std::uint8_t>{1, 1}));
}

}  // namespace
}  // namespace understory
