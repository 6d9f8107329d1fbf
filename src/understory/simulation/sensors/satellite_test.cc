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

}  // namespace
}  // namespace understory
