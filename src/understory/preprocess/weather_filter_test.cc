#include "understory/preprocess/weather_filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "understory/preprocess/lone_share.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using Eigen::Vector3f;

WeatherFilterConfig switched_on() {
  WeatherFilterConfig config;
  config.enabled = true;
  return config;
}

void add_point(BodyCloud& cloud, const Vector3f& point, float intensity) {
  cloud.points.push_back(point);
  cloud.intensity.push_back(intensity);
  cloud.range.push_back(point.norm());
  cloud.ring.push_back(static_cast<std::uint16_t>(cloud.ring.size() % 16));
  cloud.t_ns.push_back(static_cast<std::uint32_t>(cloud.t_ns.size()));
}

// A wall 10 m ahead with a return each 10 cm, and dark spots on it.
BodyCloud wall() {
  BodyCloud cloud;
  for (int row = 0; row < 20; ++row) {
    for (int column = 0; column < 40; ++column)
      add_point(cloud,
                {10.0F, -2.0F + 0.1F * static_cast<float>(column),
                 -1.0F + 0.1F * static_cast<float>(row)},
                (row + column) % 5 == 0 ? 20.0F : 100.0F);
  }
  return cloud;
}

BodyCloud moved(BodyCloud cloud, const Pose& pose) {
  for (Vector3f& point : cloud.points)
    point = (pose * point.cast<double>()).cast<float>();
  return cloud;
}

// Where it judges, the filter of lone returns is left out.
TEST(WeatherFilter, JudgesScansWithIntensitiesWhereItIsEnabled) {
  Scan scan;
  scan.points.resize(3);
  EXPECT_FALSE(WeatherFilter(switched_on()).judges(scan));
  scan.points[2].intensity = 7.0F;
  EXPECT_TRUE(WeatherFilter(switched_on()).judges(scan));
  EXPECT_FALSE(WeatherFilter({}).judges(scan));
  EXPECT_FALSE(WeatherFilter(switched_on()).judges(Scan()));
  scan.points[0].intensity = std::nanf("");
  scan.points[1].intensity = std::numeric_limits<float>::infinity();
  EXPECT_FALSE(WeatherFilter(switched_on()).judges(scan)) << "intensities that are no numbers";
}

TEST(WeatherFilter, DarkReturnsThatStandAloneGoAndNothingElse) {
  BodyCloud cloud = wall();
  const std::size_t of_wall = cloud.size();
  add_point(cloud, {5.0F, 0.0F, 0.0F}, 8.0F);    // a flake
  add_point(cloud, {5.0F, 2.0F, 0.0F}, 100.0F);  // as bright as the wall
  add_point(cloud, {30.0F, 9.0F, 3.0F}, 2.0F);
  WeatherFilter filter(switched_on());
  EXPECT_EQ(filter.drop(cloud, Pose()), 2U);
  ASSERT_EQ(cloud.size(), of_wall + 1);
  EXPECT_EQ(cloud.points.back(), Vector3f(5.0F, 2.0F, 0.0F));
  EXPECT_EQ(cloud.intensity.back(), 100.0F);
  EXPECT_EQ(cloud.t_ns.back(), of_wall + 1);
  EXPECT_EQ(cloud.ring.size(), cloud.size());
}

TEST(WeatherFilter, PointsKeepTheirMarks) {
  BodyCloud cloud = wall();
  add_point(cloud, {5.0F, 0.0F, 0.0F}, 8.0F);  // a flake
  add_point(cloud, {5.0F, 2.0F, 0.0F}, 100.0F);
  cloud.carried.assign(cloud.size(), 0);
  cloud.carried.back() = 1;
  WeatherFilter filter(switched_on());
  ASSERT_EQ(filter.drop(cloud, Pose()), 1U);
  ASSERT_EQ(cloud.carried.size(), cloud.size());
  EXPECT_EQ(cloud.carried.back(), 1);
}

// A dark twig alone in its scan, seen from another place in the scan before.
TEST(WeatherFilter, WhatWasThereBeforeStays) {
  const Vector3f twig(5.0F, 0.0F, 0.0F);
  const Pose before(Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitZ())),
                    Eigen::Vector3d(-0.3, 0.1, 0.0));
  for (const bool was_there : {true, false}) {
    WeatherFilter filter(switched_on());
    BodyCloud first = moved(wall(), before.inverse());
    if (was_there) add_point(first, (before.inverse() * twig.cast<double>()).cast<float>(), 8.0F);
    filter.drop(first, before);
    filter.remember(before);
    BodyCloud second = wall();
    add_point(second, twig, 8.0F);
    EXPECT_EQ(filter.drop(second, Pose()), was_there ? 0U : 1U);
  }
}

TEST(WeatherFilter, WithoutIntensitiesOrSwitchedOffNothingGoes) {
  BodyCloud cloud = wall();
  add_point(cloud, {5.0F, 0.0F, 0.0F}, 8.0F);
  EXPECT_EQ(WeatherFilter(WeatherFilterConfig{}).drop(cloud, Pose()), 0U);
  std::fill(cloud.intensity.begin(), cloud.intensity.end(), 7.0F);
  EXPECT_EQ(WeatherFilter(switched_on()).drop(cloud, Pose()), 0U);
  BodyCloud empty;
  EXPECT_EQ(WeatherFilter(switched_on()).drop(empty, Pose()), 0U);
}

BodyCloud cloud_of_random_ranges(std::uint64_t seed) {
  Random random(seed);
  BodyCloud cloud;
  for (int i = 0; i < 3000; ++i) {
    const Vector3f towards(static_cast<float>(random.normal()), static_cast<float>(random.normal()),
                           static_cast<float>(0.3 * random.normal()));
    const double range = std::exp(random.uniform(-0.5, 4.0));
    add_point(cloud, static_cast<float>(range) * towards.normalized(),
              static_cast<float>(random.uniform(0.0, 100.0)));
  }
  return cloud;
}

// Distances to the nearest and the second nearest by trying all, over 0.1 m + range, at most the
// reach.
std::array<double, 2> shares(const BodyCloud& among, const Vector3f& place, double range,
                             std::size_t but) {
  std::array<double, 2> nearest = {0.05, 0.05};
  for (std::size_t i = 0; i < among.size(); ++i) {
    if (i == but) continue;
    const double share = double((among.points[i] - place).norm()) / (0.1 + range);
    if (share < nearest[0]) {
      nearest = {share, nearest[0]};
    } else {
      nearest[1] = std::min(nearest[1], share);
    }
  }
  return nearest;
}

double apart(const std::array<double, 2>& nearest) {
  return std::cbrt(nearest[0] * nearest[0] * nearest[1]);
}

// Whether a neighbour on the ring is about as far: the clouds have 16 rings in turn.
bool continues(const BodyCloud& cloud, std::size_t i) {
  const double within = 0.05 * (0.1 + cloud.range[i]);
  const auto near = [&](std::size_t j) {
    return std::abs(double(cloud.range[j]) - cloud.range[i]) <= within;
  };
  return (i >= 16 && near(i - 16)) || (i + 16 < cloud.size() && near(i + 16));
}

// sqrt(s b) (range / 10 m)^0.18 over 0.111 (i + 0.02), and 1 where nothing is near.
std::pair<std::vector<double>, std::vector<std::uint8_t>> excess_of(const BodyCloud& now,
                                                                    const BodyCloud& before) {
  std::vector<float> sorted = now.intensity;
  std::sort(sorted.begin(), sorted.end());
  const double bright = sorted[static_cast<std::size_t>(0.9 * (sorted.size() - 1.0))];
  std::vector<double> excess;
  std::vector<std::uint8_t> alone;
  for (std::size_t i = 0; i < now.size(); ++i) {
    const auto s = shares(now, now.points[i], now.range[i], i);
    const auto b = shares(before, now.points[i], now.range[i], before.size());
    excess.push_back(std::sqrt(apart(s) * apart(b)) * std::pow((0.1 + now.range[i]) / 10.0, 0.18) /
                     (0.111 * (now.intensity[i] / bright + 0.02)) /
                     (continues(now, i) ? 1.32 : 1.0));
    alone.push_back(excess.back() > 1.0 && std::min(s[0], b[0]) > 0.04 ? 1 : 0);
  }
  return {excess, alone};
}

// ((f + 0.008) / 0.039)^0.63 up to 1, and down to 1 / 2.05 from a share f of 0.05 to one of 0.29.
double weight_of(double f) {
  const double expected = std::pow(std::min((f + 0.008) / 0.039, 1.0), 0.63);
  return expected / (1.0 + 1.05 * std::clamp((f - 0.05) / 0.24, 0.0, 1.0));
}

TEST(WeatherFilter, IsTheRuleOverAllPoints) {
  const BodyCloud before = cloud_of_random_ranges(3);
  const BodyCloud now = cloud_of_random_ranges(4);
  const auto [excess, alone] = excess_of(now, before);
  const LoneShare share(now.ring, now.t_ns, now.range, alone);
  std::vector<std::uint32_t> expected;
  for (std::size_t i = 0; i < now.size(); ++i) {
    if (excess[i] <= 1.0 || excess[i] * weight_of(share.around(i)) <= 1.0)
      expected.push_back(now.t_ns[i]);
  }
  for (const int threads : {1, 4}) {
    WeatherFilter filter(switched_on());
    BodyCloud first = before;
    BodyCloud cloud = now;
    with_threads(threads, [&] {
      filter.drop(first, Pose());
      filter.remember(Pose());
      filter.drop(cloud, Pose());
    });
    EXPECT_EQ(cloud.t_ns, expected);
    EXPECT_GT(cloud.size(), 500U);
    EXPECT_LT(cloud.size(), 2900U);
  }
}

// A dark return off a wall by a little. It is weather where there are false ranges in the air.
TEST(WeatherFilter, IsStricterWhereOthersStandAlone) {
  for (const bool weather : {true, false}) {
    BodyCloud cloud = wall();
    for (int i = 0; i < 60; ++i) {  // 2 m apart
      const float azimuth = 0.1F * static_cast<float>(i);
      add_point(cloud, {20.0F * std::cos(azimuth), 20.0F * std::sin(azimuth), 5.0F},
                weather ? 8.0F : 100.0F);
    }
    const auto number = static_cast<std::uint32_t>(cloud.size());
    add_point(cloud, {9.8F, 0.0F, 0.0F}, 6.0F);
    WeatherFilter filter(switched_on());
    EXPECT_EQ(filter.drop(cloud, Pose()), weather ? 61U : 0U);
    EXPECT_EQ(cloud.t_ns.back() == number, !weather);
  }
}

// A part of the machine is at the same place seen from the lidar, and moves through the world.
TEST(WeatherFilter, WhatGoesAlongStaysWhereItIsBesideTheLidar) {
  const Vector3f rail(1.0F, 0.3F, -0.2F);
  const Pose then(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-0.4, 0.0, 0.0));
  for (const bool carried : {true, false}) {
    WeatherFilter filter(switched_on());
    BodyCloud first = moved(wall(), then.inverse());
    add_point(first, rail, 8.0F);
    add_point(first, rail + Vector3f(0.0F, 0.01F, 0.0F), 8.0F);
    filter.drop(first, then);
    filter.remember(then);
    BodyCloud second = wall();
    const std::size_t of_wall = second.size();
    add_point(second, rail, 8.0F);
    second.carried.assign(second.size(), 0);
    second.carried.back() = carried ? 1 : 0;
    filter.drop(second, Pose());
    EXPECT_EQ(second.size(), of_wall + (carried ? 1U : 0U));
  }
}

// A run that goes on has the same scans before.
TEST(WeatherFilter, IsTheSameAfterItWasSavedAndWithTheWorldMoved) {
  const Pose place(Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitX())),
                   Eigen::Vector3d(3.0, -2.0, 1.0));
  WeatherFilter filter(switched_on());
  BodyCloud first = cloud_of_random_ranges(5);
  filter.drop(first, Pose());
  filter.remember(Pose());
  BinaryWriter writer;
  filter.save(writer);
  BinaryReader reader(writer.bytes(), "test");
  WeatherFilter again(switched_on());
  again.load(reader);
  again.move_world(place);
  BodyCloud one = cloud_of_random_ranges(6);
  BodyCloud two = one;
  filter.drop(one, Pose());
  again.drop(two, place);
  EXPECT_EQ(one.t_ns, two.t_ns);
  EXPECT_LT(one.size(), 3000U);
}

}  // namespace
}  // namespace understory
