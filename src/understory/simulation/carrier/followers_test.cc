#include "understory/simulation/carrier/followers.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "understory/simulation/sensors/scanner.h"
#include "understory/simulation/stand/objects.h"
#include "understory/simulation/world.h"
#include "understory/util/error.h"

namespace understory {
namespace {

SiteConfig followed_site(int followers) {
  SiteConfig site;
  site.duration_s = 20.0;
  site.carrier.length_m = 60.0;
  site.carrier.height_m = 1.6;
  site.stand.size_x_m = site.stand.size_y_m = 50.0;
  site.objects.followers = followers;
  site.lidar.columns = 256;
  return site;
}

Eigen::Vector2d body_at(const SimulatedWorld& world, double time_s) {
  return world.plan.path.pose(time_s).translation().head<2>();
}

TEST(Followers, StayBehindAllTheWay) {
  const SimulatedWorld world(followed_site(3));
  ASSERT_EQ(world.stand.objects.size(), 3U);
  for (double time = 0.0; time < 20.0; time += 0.5) {
    const Eigen::Vector2d body = body_at(world, time);
    const Eigen::Vector2d ahead = body_at(world, time + 0.5) - body;
    std::vector<double> away;
    for (const StandObject& person : world.stand.objects) {
      const Eigen::Vector3d foot = motion_at(person, time).foot;
      const Eigen::Vector2d behind = foot.head<2>() - body;
      away.push_back(behind.norm());
      if (ahead.norm() > 0.3) {
        EXPECT_LT(behind.dot(ahead), 0.0) << time;
      }
      EXPECT_NEAR(foot.z(), world.terrain.smooth_height(foot.x(), foot.y(), 0.3), 0.05);
    }
    EXPECT_NEAR(away[0], std::hypot(1.5, 0.35), 0.02);
    EXPECT_NEAR(away[1], std::hypot(1.5, 0.35), 0.02);
    EXPECT_NEAR(away[2], std::hypot(2.3, 0.35), 0.02);
  }
}

TEST(Followers, VelocityIsTheChangeOfPlace) {
  const SimulatedWorld world(followed_site(1));
  const StandObject& person = world.stand.objects.front();
  for (double time = 5.01; time < 15.0; time += 0.7) {
    const Eigen::Vector3d before = motion_at(person, time - 1e-4).foot;
    const Eigen::Vector3d after = motion_at(person, time + 1e-4).foot;
    const Eigen::Vector2d moved = (after - before).head<2>() / 2e-4;
    EXPECT_LT((moved - motion_at(person, time).velocity).norm(), 1e-6) << time;
  }
}

// Points on things near the sensor, in a scan that is cast while the carrier walks.
int points_on_things(int followers) {
  SimulatedWorld world(followed_site(followers));
  Scanner scanner(world.site, world.scene, world.plan.path, world.machine, 0);
  scanner.keep_sources();
  const ScanReadings readings = scanner.measure(120);
  int count = 0;
  for (std::size_t i = 0; i < readings.beams.size(); ++i) {
    count += static_cast<int>(readings.sources[i].surface == Surface::kObject &&
                              readings.beams[i].range_m > 1.0F && readings.beams[i].range_m < 2.5F);
  }
  return count;
}

TEST(Followers, AreSeenWhereTheyWalk) {
  EXPECT_EQ(points_on_things(0), 0);
  EXPECT_GT(points_on_things(2), 500);
}

TEST(Blindness, ScansAreEmptyForItsLength) {
  SiteConfig site = followed_site(0);
  site.blindness = {8.0, 3.0};  // from 4 s to 7 s and from 12 s to 15 s
  SimulatedWorld world(site);
  Scanner scanner(world.site, world.scene, world.plan.path, world.machine, 0);
  for (const auto& [number, is_blind] : {std::pair(0, false),
                                         {38, false},
                                         {41, true},
                                         {68, true},
                                         {71, false},
                                         {121, true},
                                         {148, true},
                                         {151, false}}) {
    const SimulatedScan made = scanner.cast(number);
    EXPECT_EQ(made.scan->points.empty(), is_blind) << number;
    EXPECT_EQ(made.stems.empty(), is_blind) << number;
  }
}

TEST(CacheOfScans, IsOfSitesWhoseScansAreTheSame) {
  const std::uint64_t usual = site_key(followed_site(0));
  SiteConfig other = followed_site(0);
  other.imu.enabled = other.gnss.enabled = false;
  other.lidar.error_m[0] = 0.1;
  other.lidar.time_offset_s = 0.02;
  EXPECT_EQ(site_key(other), usual);
  other.lidar.dropout = 0.5;
  EXPECT_NE(site_key(other), usual);
}

TEST(Blindness, EndsBeforeItBeginsAgain) {
  EXPECT_NO_THROW((void)load_site("handheld", {"blindness.interval_s=4"}));
  EXPECT_THROW((void)load_site("handheld", {"blindness.interval_s=3"}), ConfigError);
}

TEST(Blindness, CountsInTheKeyOfTheCacheOnlyWhereItIs) {
  SiteConfig site = followed_site(0);
  const std::uint64_t without = site_key(site);
  site.blindness.length_s = 1.0;
  EXPECT_EQ(site_key(site), without);
  site.blindness.interval_s = 60.0;
  EXPECT_NE(site_key(site), without);
}

}  // namespace
}  // namespace understory
