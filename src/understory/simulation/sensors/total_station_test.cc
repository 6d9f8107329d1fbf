#include "understory/simulation/sensors/total_station.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "understory/simulation/simulator.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

SiteConfig surveyed_site(const std::vector<std::string>& more = {}) {
  std::vector<std::string> settings = {"seed=31", "duration_s=120"};
  settings.insert(settings.end(), more.begin(), more.end());
  return load_site("tuusniemi1", settings);
}

const std::vector<std::string> kExact = {
    "total_station.distance_sd_m=0",   "total_station.distance_ppm=0", "total_station.setup_sd_m=0",
    "total_station.angle_sd_arcsec=0", "total_station.time_sd_s=0",    "total_station.levelling=0"};

TEST(TotalStation, WithoutErrorsItSeesThePrismOfTheBody) {
  SimulatedWorld world(surveyed_site(kExact));
  const auto samples = track_prism(world, 5 * kNsPerSecond, 120.0);
  ASSERT_GT(samples.size(), 300U);
  const std::vector<double>& prism = world.site.total_station.prism_m;
  for (const PrismSample& sample : samples) {
    const double time = to_seconds(sample.stamp - 5 * kNsPerSecond);
    const Eigen::Vector3d truth =
        world.plan.path.pose(time) * Eigen::Vector3d(prism[0], prism[1], prism[2]);
    EXPECT_LT((sample.place - truth).norm(), 1e-6);
  }
}

TEST(TotalStation, ErrorsHaveTheirSizeAndALevelledLinkLeavesTheBody) {
  SimulatedWorld world(surveyed_site({"total_station.setup_sd_m=0", "total_station.time_sd_s=0"}));
  const TotalStationConfig& config = world.site.total_station;
  double sum = 0.0;
  double apart = 0.0;
  const auto samples = track_prism(world, 0, 120.0);
  for (const PrismSample& sample : samples) {
    const double time = to_seconds(sample.stamp);
    const Eigen::Vector3d prism = prism_in_world(config, world.plan.path, time);
    sum += (sample.place - prism).squaredNorm();
    const Eigen::Vector3d fixed =
        world.plan.path.pose(time) *
        Eigen::Vector3d(config.prism_m[0], config.prism_m[1], config.prism_m[2]);
    apart = std::max(apart, (fixed - prism).norm());
  }
  // Near the instrument the distance counts, hardly the angles.
  EXPECT_NEAR(std::sqrt(sum / static_cast<double>(samples.size())), 0.002, 0.0005);
  EXPECT_GT(apart, 0.005);
  EXPECT_LT(apart, 0.1);
}

TEST(TotalStation, LosesThePrismBehindTreesAndNeedsAWhile) {
  // A walker's path through an open stand, where nobody cleared the view.
  SimulatedWorld world(
      load_site("handheld", {"seed=31", "stand.trees_per_ha=250", "total_station.enabled=true",
                             "total_station.rate_hz=5"}));
  const auto samples = track_prism(world, 0, 150.0);
  EXPECT_LT(samples.size(), 0.8 * 150.0 * 5.0);
  EXPECT_GT(samples.size(), 20U);
  double longest = 0.0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const double gap = to_seconds(samples[i].stamp - samples[i - 1].stamp);
    longest = std::max(longest, gap);
    // Either the next measurement, or after the time that a search takes.
    EXPECT_TRUE(gap < 0.21 || gap > 1.99) << gap;
  }
  EXPECT_GT(longest, 3.0);
}

TEST(TotalStation, IsWrittenBesideTheTruthWhereThereIsOneAndLeavesScansAlone) {
  const test::TemporaryFolder own;
  const std::string folder = own / "station.truth";
  const SiteConfig with = surveyed_site({"duration_s=3", "lidar.columns=256"});
  SiteConfig without = with;
  without.total_station.enabled = false;
  EXPECT_EQ(site_key(with), site_key(without));  // scans are kept for both
  for (const SiteConfig& config : {with, without}) {
    Simulator simulator(config);
    simulator.skip(1'000'000);
    simulator.write_truth(folder);
    EXPECT_EQ(std::filesystem::exists(folder + "/total_station.csv"), config.total_station.enabled);
    std::filesystem::remove_all(folder);
  }
}

}  // namespace
}  // namespace understory
