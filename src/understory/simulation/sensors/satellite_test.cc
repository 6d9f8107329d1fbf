#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "understory/simulation/carrier/carrier.h"
#include "understory/simulation/scene/scene.h"
#include "understory/simulation/scene/terrain.h"
#include "understory/simulation/sensors/satellite.h"
#include "understory/simulation/simulator.h"
#include "understory/simulation/stand/stand.h"

namespace understory {
namespace {

// A scene with a receiver below closed canopy and one under open sky.
struct Receiver {
  Receiver(const SiteConfig& config, double trees_per_ha, double seconds)
      : site(config), route(site.carrier, 1) {
    site.stand.trees_per_ha = trees_per_ha;
    const Terrain terrain(site.terrain, 42.0, 42.0, 1, &route);
    const Stand stand = grow_stand(site.stand, site.carrier, terrain, route, 1);
    const ForestScene scene(site.stand, terrain, stand, 1);
    const CarrierPlan plan = plan_carrier(site, route, terrain, {});
    SatelliteReceiver receiver(site, plan.path, scene, 0);
    for (int i = 0; i < static_cast<int>(seconds * site.gnss.rate_hz); ++i) {
      const std::optional<GnssFix> fix = receiver.next();
      errors.push_back(receiver.last_error_enu());
      fixes += fix ? 1 : 0;
      if (fix) promised_m = std::sqrt(fix->covariance(0, 0));
    }
  }
  [[nodiscard]] double largest() const {
    double most = 0.0;
    for (const Eigen::Vector3d& error : errors)
      most = std::max(most, error.head<2>().norm());
    return most;
  }
  SiteConfig site;
  Route route;
  std::vector<Eigen::Vector3d> errors;
  int fixes = 0;
  double promised_m = 0.0;  // standard deviation east that the last fix claims
};

SiteConfig quiet_receiver() {
  SiteConfig site =
      load_site("demo", {"gnss.open_sd_m=0", "gnss.canopy_sd_m=0", "gnss.white_sd_m=0",
                         "gnss.rate_hz=1", "stand.trees_per_ha=1500"});
  return site;
}

TEST(GnssRealism, BurstsRiseUnderTheCanopyAndComeBack) {
  SiteConfig site = quiet_receiver();
  site.gnss.burst_interval_s = 60.0;
  site.gnss.burst_s = 20.0;
  site.gnss.burst_m = 4.0;
  const Receiver under(site, 1500.0, 1200.0);
  EXPECT_GT(under.largest(), 2.5);
  EXPECT_LT(under.largest(), 5.3);
  std::size_t at_rest = 0;
  for (std::size_t i = 1; i < under.errors.size(); ++i) {
    at_rest += under.errors[i].norm() < 1e-12 ? 1 : 0;
    EXPECT_LT((under.errors[i] - under.errors[i - 1]).head<2>().norm(), 1.2);  // no step
  }
  EXPECT_GT(at_rest, 400U);
  const Receiver open(site, 0.0, 1200.0);
  EXPECT_LT(open.largest(), 1e-9);
}

TEST(GnssRealism, FixesAreLeftOutBetweenTheTimesThatAreTold) {
  SiteConfig site = quiet_receiver();
  const Receiver all(site, 0.0, 60.0);
  site.gnss.silent_s = {20.0, 30.0};
  const Receiver cut(site, 0.0, 60.0);
  EXPECT_EQ(all.fixes, 60);
  EXPECT_EQ(cut.fixes, 50);
  EXPECT_EQ(all.errors, cut.errors);  // all others are as they were
  EXPECT_THROW(load_site("demo", {"gnss.silent_s=[30,20]"}), ConfigError);
}

TEST(GnssRealism, JumpsStepAsideAndStay) {
  SiteConfig site = quiet_receiver();
  site.gnss.jump_interval_s = 60.0;
  site.gnss.jump_m = 1.5;
  const Receiver under(site, 1500.0, 1200.0);
  std::size_t steps = 0;
  for (std::size_t i = 1; i < under.errors.size(); ++i)
    steps += under.errors[i] != under.errors[i - 1] ? 1 : 0;
  EXPECT_GE(steps, 2U);
  EXPECT_LE(steps, 30U);
  EXPECT_GT(under.largest(), 0.5);
}

TEST(GnssRealism, CovarianceIsHonestOrOverconfidentAsAsked) {
  SiteConfig site = quiet_receiver();
  site.gnss.open_sd_m = 1.0;
  site.gnss.correlation_s = 4.0;
  site.gnss.multipath_share = 0.0;
  for (const double factor : {1.0, 0.12}) {
    site.gnss.reported_factor = factor;
    const Receiver open(site, 0.0, 4000.0);
    double sum = 0.0;
    for (const Eigen::Vector3d& error : open.errors)
      sum += error.x() * error.x() / static_cast<double>(open.errors.size());
    EXPECT_NEAR(open.promised_m / std::sqrt(sum), factor, 0.12 * factor);
  }
}

// The receiver's headings against the line between the antennas as the carrier really holds it.
std::vector<double> heading_errors_deg(const SiteConfig& site, double trees_per_ha,
                                       std::vector<GnssFix>* fixes = nullptr) {
  SiteConfig config = site;
  config.stand.trees_per_ha = trees_per_ha;
  const Route route(config.carrier, 1);
  const Terrain terrain(config.terrain, 42.0, 42.0, 1, &route);
  const Stand stand = grow_stand(config.stand, config.carrier, terrain, route, 1);
  const ForestScene scene(config.stand, terrain, stand, 1);
  const CarrierPlan plan = plan_carrier(config, route, terrain, {});
  SatelliteReceiver receiver(config, plan.path, scene, 0);
  const auto& along = config.gnss.second_antenna_m;
  std::vector<double> errors;
  for (int i = 0; i < static_cast<int>(600.0 * config.gnss.rate_hz); ++i) {
    const auto fix = receiver.next();
    if (!fix) continue;
    if (fixes != nullptr) fixes->push_back(*fix);
    if (std::isnan(fix->heading_deg)) continue;
    EXPECT_GE(fix->heading_deg, 0.0);
    EXPECT_LT(fix->heading_deg, 360.0);
    const Eigen::Vector3d line =
        plan.path.state(to_seconds(fix->stamp)).world_from_body.rotation() *
        Eigen::Vector3d(along[0], along[1], along[2]);
    const double truth = std::atan2(line.x(), line.y()) * 180.0 / M_PI;
    errors.push_back(std::remainder(fix->heading_deg - truth, 360.0) / fix->heading_sd_deg);
  }
  return errors;
}

double mean_square(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values)
    sum += value * value / static_cast<double>(values.size());
  return sum;
}

TEST(GnssRealism, ASecondAntennaErrsAsItSaysAndMoreUnderTrees) {
  SiteConfig site = quiet_receiver();
  site.gnss.second_antenna_m = {0.3, -0.4, 0.05};
  std::vector<GnssFix> open;
  std::vector<GnssFix> under;
  const auto free_sky = heading_errors_deg(site, 0.0, &open);
  ASSERT_GT(free_sky.size(), 500U);
  EXPECT_NEAR(mean_square(free_sky), 1.0, 0.5);
  EXPECT_NEAR(mean_square(heading_errors_deg(site, 1500.0, &under)), 1.0, 0.5);
  EXPECT_NEAR(open.back().heading_sd_deg, 0.4, 0.02);  // half a metre apart
  const auto worst = std::max_element(
      under.begin(), under.end(),
      [](const GnssFix& a, const GnssFix& b) { return a.heading_sd_deg < b.heading_sd_deg; });
  EXPECT_GT(worst->heading_sd_deg, 2.0 * open.back().heading_sd_deg);
}

TEST(GnssRealism, ASecondAntennaChangesNothingElseAndAnUprightOneTellsNothing) {
  SiteConfig site = quiet_receiver();
  std::vector<GnssFix> without;
  std::vector<GnssFix> with;
  EXPECT_TRUE(heading_errors_deg(site, 1500.0, &without).empty());
  site.gnss.second_antenna_m = {0.0, 0.0, 1.0};
  EXPECT_TRUE(heading_errors_deg(site, 1500.0).empty());
  site.gnss.second_antenna_m = {1.0, 0.0, 0.0};
  (void)heading_errors_deg(site, 1500.0, &with);
  ASSERT_EQ(with.size(), without.size());
  for (std::size_t k = 0; k < with.size(); ++k) {
    ASSERT_EQ(with[k].latitude_deg, without[k].latitude_deg);
    ASSERT_EQ(with[k].track_deg, without[k].track_deg);
  }
}

// The difference of both positions errs as the parts of the errors that are not common.
TEST(GnssRealism, PositionsOfASecondAntennaShareTheirErrors) {
  const auto difference_sd = [](double common) {
    SiteConfig site = quiet_receiver();
    site.gnss.second_antenna_m = {0.3, -0.4, 0.05};
    site.gnss.second_antenna_positions = true;
    site.gnss.second_antenna_common = common;
    site.gnss.open_sd_m = 1.0;
    site.gnss.correlation_s = 5.0;
    site.gnss.multipath_share = 0.0;
    site.stand.trees_per_ha = 0.0;
    const Route route(site.carrier, 1);
    const Terrain terrain(site.terrain, 42.0, 42.0, 1, &route);
    const Stand stand = grow_stand(site.stand, site.carrier, terrain, route, 1);
    const ForestScene scene(site.stand, terrain, stand, 1);
    const CarrierPlan plan = plan_carrier(site, route, terrain, {});
    SatelliteReceiver receiver(site, plan.path, scene, 0);
    const Eigen::Vector3d first_arm(site.gnss.mount_m[0], site.gnss.mount_m[1],
                                    site.gnss.mount_m[2]);
    const Eigen::Vector3d second_arm = first_arm + Eigen::Vector3d(0.3, -0.4, 0.05);
    double squares = 0.0;
    for (int i = 0; i < 1500; ++i) {
      const auto fix = receiver.next();
      EXPECT_TRUE(fix && receiver.second_fix() && std::isnan(fix->heading_deg));
      const GnssFix& second = *receiver.second_fix();
      const Pose pose = plan.path.state(to_seconds(fix->stamp)).world_from_body;
      const Eigen::Vector3d truth = geodetic_from_enu(site.origin, pose * second_arm) -
                                    geodetic_from_enu(site.origin, pose * first_arm);
      const double off_deg = second.latitude_deg - fix->latitude_deg - truth.x();
      squares += std::pow(off_deg * 111'400.0, 2.0) / 1500.0;
    }
    return std::sqrt(squares);
  };
  EXPECT_LT(difference_sd(1.0), 0.01);
  EXPECT_NEAR(difference_sd(0.5), 1.0, 0.15);
  EXPECT_NEAR(difference_sd(0.0), std::sqrt(2.0), 0.2);
}

}  // namespace
}  // namespace understory
