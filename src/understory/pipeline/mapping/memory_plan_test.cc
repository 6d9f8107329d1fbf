#include <gtest/gtest.h>

#include <string>

#include "understory/pipeline/mapping/adaptation.h"
#include "understory/pipeline/mapping/dense/memory_plan.h"
#include "understory/util/error.h"

namespace understory {
namespace {

SensorTraits lidar_of(std::uint64_t points) {
  SensorTraits traits;
  traits.scan_points = points;
  traits.has_imu = true;
  return traits;
}

DenseMappingConfig within(double mb) {
  DenseMappingConfig config;
  config.max_memory_mb = mb;
  return config;
}

TEST(MemoryPlan, TheLeastGrowsWithTheReturnsOfAScan) {
  const double small = least_memory_mb({}, lidar_of(29'000));
  const double large = least_memory_mb({}, lidar_of(131'072));
  EXPECT_LT(small, large);
  EXPECT_LE(large, 500.0);
  EXPECT_EQ(least_memory_mb({}, lidar_of(0)), large);
  DenseMappingConfig copc;
  copc.copc = true;
  EXPECT_GE(least_memory_mb(copc, lidar_of(29'000)), 400.0);
}

TEST(MemoryPlan, ALimitThatIsTooSmallNamesTheLeastThatWorks) {
  const SensorTraits lidar = lidar_of(90'000);
  const double least = least_memory_mb({}, lidar);
  EXPECT_NO_THROW(expect_memory(within(0.0), lidar));
  EXPECT_NO_THROW(expect_memory(within(least), lidar));
  try {
    expect_memory(within(least - 1.0), lidar);
    ADD_FAILURE() << "it is not refused";
  } catch (const ConfigError& error) {
    const std::string said = error.what();
    EXPECT_NE(said.find("expected " + std::to_string(static_cast<int>(least)) + " at least"),
              std::string::npos)
        << said;
    EXPECT_NE(said.find("90000 points a scan"), std::string::npos) << said;
  }
}

TEST(MemoryPlan, SharesTheLimitAndChangesNothingWithoutOne) {
  const SensorTraits lidar = lidar_of(90'000);
  const DenseMappingConfig free = adapt(within(0.0), {}, lidar, {}).config;
  EXPECT_EQ(free.keyframe_map.local_map.most_bytes, 0.0);
  EXPECT_EQ(free.map.most_bytes, 0.0);
  EXPECT_EQ(free.inventory_bytes, 0.0);
  EXPECT_FALSE(free.keyframe_map.one_local_map);
  double last = 0.0;
  for (const double mb : {least_memory_mb({}, lidar), 800.0, 2000.0}) {
    const DenseMappingConfig config = adapt(within(mb), {}, lidar, {}).config;
    const KeyframeMap::Config& map = config.keyframe_map;
    EXPECT_TRUE(map.one_local_map);
    EXPECT_GE(map.cached_keyframes, 30U);
    EXPECT_LE(map.cached_keyframes, free.keyframe_map.cached_keyframes);
    const double held =
        map.local_map.most_bytes + 12.0 * 90'000 * static_cast<double>(map.cached_keyframes);
    EXPECT_LT(held, 1e6 * mb - 100e6);
    EXPECT_GT(map.local_map.most_bytes, last);
    EXPECT_GT(config.map.most_bytes, 0.0);
    EXPECT_LT(config.map.most_bytes + config.inventory_bytes, 2e6 * mb);
    last = map.local_map.most_bytes;
  }
}

}  // namespace
}  // namespace understory
