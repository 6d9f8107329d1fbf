#include "understory/preprocess/voxel_filter.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>

#include "understory/util/random.h"

namespace understory {
namespace {

BodyCloud random_cloud(std::size_t n, std::uint64_t seed) {
  Random random(seed);
  BodyCloud cloud;
  cloud.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    cloud.points[i] =
        Eigen::Vector3d(random.uniform(-8, 8), random.uniform(-8, 8), random.uniform(-2, 4))
            .cast<float>();
    cloud.range[i] = cloud.points[i].norm();
    cloud.intensity[i] = static_cast<float>(random.uniform());
    cloud.ring[i] = static_cast<std::uint16_t>(i % 16);
  }
  return cloud;
}

struct Reference {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double intensity = 0.0;
  std::vector<std::size_t> members;
};

std::map<std::array<int, 3>, Reference> reference(const BodyCloud& cloud,
                                                  const VoxelFilterConfig& config) {
  std::map<std::array<int, 3>, Reference> voxels;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (cloud.range[i] < config.range_min_m || cloud.range[i] > config.range_max_m) continue;
    std::array<int, 3> key;
    for (std::size_t k = 0; k < 3; ++k) {
      key[k] = static_cast<int>(std::floor(cloud.points[i][static_cast<int>(k)] *
                                           static_cast<float>(1.0 / config.voxel_size_m)));
    }
    Reference& voxel = voxels[key];
    voxel.sum += cloud.points[i].cast<double>();
    voxel.intensity += static_cast<double>(cloud.intensity[i]);
    voxel.members.push_back(i);
  }
  return voxels;
}

TEST(VoxelFilter, GivesTheMeanOfEachVoxel) {
  const BodyCloud cloud = random_cloud(40'000, 1);
  VoxelFilterConfig config;
  config.range_min_m = 2.0;
  config.range_max_m = 9.0;
  VoxelFilter filter;
  const BodyCloud thinned = filter.filter(cloud, config);
  const auto expected = reference(cloud, config);
  ASSERT_EQ(thinned.size(), expected.size());
  std::map<std::size_t, const Reference*> by_first;
  for (const auto& [key, voxel] : expected)
    by_first[voxel.members.front()] = &voxel;
  std::size_t i = 0;
  for (const auto& [first, voxel] : by_first) {  // order of first points
    const auto n = static_cast<double>(voxel->members.size());
    EXPECT_LT((thinned.points[i].cast<double>() - voxel->sum / n).norm(), 1e-5);
    EXPECT_NEAR(thinned.intensity[i], voxel->intensity / n, 1e-5);
    EXPECT_EQ(thinned.ring[i], cloud.ring[first]);
    ++i;
  }
}

TEST(VoxelFilter, NearestToTheMeanIsAMeasuredPoint) {
  const BodyCloud cloud = random_cloud(20'000, 2);
  VoxelFilterConfig config;
  config.range_min_m = 0.0;
  config.point = VoxelPoint::kNearestToMean;
  VoxelFilter filter;
  const std::vector<std::uint32_t> kept =
      filter.keep(cloud.points, config.voxel_size_m, config.point);
  const BodyCloud thinned = filter.filter(cloud, config);
  const auto expected = reference(cloud, config);
  ASSERT_EQ(kept.size(), expected.size());
  ASSERT_EQ(thinned.size(), expected.size());
  std::map<std::size_t, const Reference*> by_first;
  for (const auto& [key, voxel] : expected)
    by_first[voxel.members.front()] = &voxel;
  std::size_t i = 0;
  for (const auto& [first, voxel] : by_first) {
    const Eigen::Vector3d mean = voxel->sum / static_cast<double>(voxel->members.size());
    const auto from_mean = [&](std::size_t m) {
      return (cloud.points[m].cast<double>() - mean).norm();
    };
    double best = from_mean(first);
    for (const std::size_t m : voxel->members)
      best = std::min(best, from_mean(m));
    EXPECT_NEAR(from_mean(kept[i]), best, 1e-5);
    EXPECT_EQ(thinned.points[i], cloud.points[kept[i]]);
    ++i;
  }
}

TEST(VoxelFilter, LeavesOutThinVoxelsAndCanBeUsedAgain) {
  const BodyCloud cloud = random_cloud(20'000, 3);
  VoxelFilterConfig config;
  config.range_min_m = 0.0;
  config.min_points = 3;
  VoxelFilter filter;
  const BodyCloud first = filter.filter(cloud, config);
  std::size_t expected = 0;
  for (const auto& [key, voxel] : reference(cloud, config))
    expected += voxel.members.size() >= 3 ? 1 : 0;
  EXPECT_EQ(first.size(), expected);
  (void)filter.filter(random_cloud(50'000, 4), config);
  EXPECT_EQ(filter.filter(cloud, config).points, first.points);
  EXPECT_TRUE(filter.filter(BodyCloud{}, config).empty());
}

TEST(VoxelFilter, DecimationIsEvenAndUnbiased) {
  EXPECT_EQ(decimate(5, 10, 1).size(), 5U);
  EXPECT_TRUE(decimate(10, 0, 1).empty());
  const auto chosen = decimate(1000, 100, 7);
  ASSERT_EQ(chosen.size(), 100U);
  for (std::size_t i = 0; i < 100; ++i)
    EXPECT_EQ(chosen[i] / 10, i);
  EXPECT_EQ(decimate(1000, 100, 7), chosen);
  // Rings of a scan come in turn: none may be favoured.
  std::array<int, 4> hits{};
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    for (const std::uint32_t i : decimate(1024, 64, seed))
      ++hits[i % 4];
  }
  for (const int h : hits)
    EXPECT_NEAR(h, 3200, 250);
}

TEST(VoxelFilter, WhatIsCarriedComesOnlyWhereItIsAskedFor) {
  BodyCloud cloud = random_cloud(4000, 5);
  cloud.carried.assign(cloud.size(), 0);
  BodyCloud others = cloud;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (cloud.points[i].x() > 0.0F) continue;
    cloud.carried[i] = 1;
    others.range[i] = 1e6F;  // beyond the limit
  }
  VoxelFilter filter;
  EXPECT_EQ(filter.filter(cloud, {}).points, filter.filter(others, {}).points);
  others = cloud;
  others.carried.clear();
  EXPECT_EQ(filter.filter(cloud, {}, true).points, filter.filter(others, {}).points);
}

TEST(VoxelFilter, OfFeaturesWhatIsCarriedComesForAMap) {
  BodyCloud cloud = random_cloud(4000, 6);
  cloud.feature.assign(cloud.size(), PointFeature::kEdge);
  cloud.carried.assign(cloud.size(), 1);
  VoxelFilter filter;
  EXPECT_TRUE(filter.filter_features(cloud, {}, false).empty());
  EXPECT_FALSE(filter.filter_features(cloud, {}, true).empty());
}

}  // namespace
}  // namespace understory
