#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "understory/simulation/simulator.h"

namespace understory {
namespace {

std::vector<ScanPtr> scans(const std::vector<std::string>& settings) {
  std::vector<std::string> all = {"duration_s=1.2", "lidar.columns=256"};
  all.insert(all.end(), settings.begin(), settings.end());
  Simulator simulator(load_site("demo", all));
  std::vector<ScanPtr> found;
  while (const std::optional<Event> event = simulator.next()) {
    if (const auto* scan = std::get_if<ScanPtr>(&*event)) found.push_back(*scan);
  }
  return found;
}

double range_of(const ScanPoint& point) {
  return std::sqrt(double(point.x) * point.x + double(point.y) * point.y +
                   double(point.z) * point.z);
}

TEST(LidarRealism, SecondReturnsLieApartFromTheFirst) {
  const auto one = scans({"lidar.rays_per_beam=9"});
  const auto two = scans({"lidar.rays_per_beam=9", "lidar.returns=2"});
  ASSERT_EQ(one.size(), two.size());
  std::size_t seconds = 0;
  std::size_t firsts = 0;
  for (std::size_t s = 0; s < two.size(); ++s) {
    const auto& points = two[s]->points;
    std::size_t alone = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (points[i].return_index == 0) {
        ++alone;
        continue;
      }
      ++seconds;
      if (i == 0 || points[i - 1].ring != points[i].ring || points[i - 1].t_ns != points[i].t_ns)
        continue;  // its first return was lost
      // Echoes nearer to each other than a pulse are one echo.
      EXPECT_GT(std::abs(range_of(points[i]) - range_of(points[i - 1])), 0.12);
    }
    EXPECT_EQ(alone, one[s]->points.size());  // the first returns are what they were
    firsts += alone;
  }
  const double share = static_cast<double>(seconds) / static_cast<double>(firsts);
  EXPECT_GT(share, 0.03);
  EXPECT_LT(share, 0.6);
}

TEST(LidarRealism, SnowFlakesFillTheAirNearTheSensor) {
  const std::vector<std::string> bare = {
      "stand.trees_per_ha=0",         "stand.seedlings_per_ha=0", "stand.shrubs_per_ha=0",
      "stand.ground_plants_per_ha=0", "stand.logs_per_ha=0",      "stand.stumps_per_ha=0",
      "terrain.relief_m=0",           "terrain.hummock_m=0",      "terrain.slope_deg=0"};
  const auto above = [&](const std::string& setting) {
    std::vector<std::string> settings = bare;
    settings.push_back(setting);
    std::size_t count = 0;
    double farthest = 0.0;
    for (const ScanPtr& scan : scans(settings)) {
      for (const ScanPoint& point : scan->points) {
        if (point.z < -1.0) continue;  // the ground lies 3 m below
        ++count;
        farthest = std::max(farthest, range_of(point));
      }
    }
    EXPECT_LT(farthest, 25.0);
    return count;
  };
  EXPECT_EQ(above("lidar.snow_fall_per_m=0"), 0U);
  const std::size_t light = above("lidar.snow_fall_per_m=0.002");
  const std::size_t heavy = above("lidar.snow_fall_per_m=0.008");
  EXPECT_GT(light, 500U);
  EXPECT_NEAR(static_cast<double>(heavy) / static_cast<double>(light), 4.0, 0.5);
}

// On level ground h below, a beam of elevation e that looks higher by b has the range h / sin(-(e +
// b)). Its point says that it looks along e.
TEST(LidarRealism, AnElevationBiasMovesRangesAndNotTheDirectionsThatAreTold) {
  const auto ranges = [](double bias_deg) {
    std::vector<double> found;
    double told = 0.0;
    const auto all =
        scans({"stand.trees_per_ha=0", "stand.seedlings_per_ha=0", "stand.shrubs_per_ha=0",
               "stand.ground_plants_per_ha=0", "stand.logs_per_ha=0", "stand.stumps_per_ha=0",
               "terrain.relief_m=0", "terrain.hummock_m=0", "terrain.slope_deg=0",
               "lidar.elevation_bias_deg=" + std::to_string(bias_deg)});
    for (const ScanPoint& point : all.front()->points) {
      if (point.ring != 20) continue;
      found.push_back(range_of(point));
      told += std::asin(point.z / range_of(point));
    }
    std::sort(found.begin(), found.end());
    return std::pair(found[found.size() / 2], told / static_cast<double>(found.size()));
  };
  const auto [plain, elevation] = ranges(0.0);
  const auto [biased, still_told] = ranges(0.6);
  EXPECT_NEAR(still_told, elevation, 1e-3);
  const double bias = 0.6 * 3.14159265358979 / 180.0;
  EXPECT_NEAR(biased / plain, std::sin(-elevation) / std::sin(-(elevation + bias)), 0.002);
}

TEST(LidarRealism, CrosstalkHasItsShareAndBloomingItsRanges) {
  const auto plain = scans({});
  const auto noisy = scans({"lidar.crosstalk=0.01"});
  std::size_t faint = 0;
  std::size_t faint_before = 0;
  for (std::size_t i = 0; i < plain.size(); ++i) {
    for (const ScanPoint& point : noisy[i]->points)
      faint += point.intensity <= 13.0F ? 1 : 0;
    for (const ScanPoint& point : plain[i]->points)
      faint_before += point.intensity <= 13.0F ? 1 : 0;
  }
  const double beams = 256.0 * 128.0 * static_cast<double>(plain.size());
  EXPECT_NEAR((static_cast<double>(faint) - static_cast<double>(faint_before)) / beams, 0.01,
              0.002);

  // Snow glares; beyond its edges beams repeat it.
  const auto count = [](const std::vector<ScanPtr>& all) {
    std::size_t points = 0;
    for (const ScanPtr& scan : all)
      points += scan->points.size();
    return points;
  };
  const std::vector<std::string> snow = {"terrain.snow_m=0.5", "stand.trees_per_ha=0"};
  std::vector<std::string> blooming = snow;
  blooming.push_back("lidar.blooming=1");
  EXPECT_GT(count(scans(blooming)), count(scans(snow)) + 100U);
}

}  // namespace
}  // namespace understory
