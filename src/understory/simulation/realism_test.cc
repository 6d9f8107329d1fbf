#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "understory/simulation/inertial.h"
#include "understory/simulation/magnetometer.h"
#include "understory/simulation/satellite.h"
#include "understory/simulation/scanner.h"
#include "understory/simulation/simulator.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

CarrierPath standing() {
  return CarrierPath(CarrierPath::Spline({Vector6d::Zero()}, 0.05));
}

// A silent IMU at rest, to which a test adds what it is about.
SiteConfig silent() {
  SiteConfig site;
  site.imu.gyro_noise = site.imu.accel_noise = 0.0;
  site.imu.gyro_bias_sd = site.imu.accel_bias_sd = 0.0;
  site.imu.gyro_bias_walk = site.imu.accel_bias_walk = 0.0;
  site.imu.scale_sd = site.imu.vibration_m_s2 = 0.0;
  site.imu.rate_hz = 20.0;
  return site;
}

std::vector<ImuSample> samples(const SiteConfig& site, std::size_t count,
                               const std::vector<double>& shocks_s = {}) {
  const CarrierPath path = standing();
  InertialSensor imu(site, path, 0, shocks_s);
  std::vector<ImuSample> all;
  for (std::size_t i = 0; i < count; ++i)
    all.push_back(imu.next());
  return all;
}

// Allan deviation of a series at an averaging time of `m` samples (non-overlapping).
double allan_deviation(const std::vector<double>& values, std::size_t m) {
  std::vector<double> means;
  for (std::size_t i = 0; i + m <= values.size(); i += m) {
    double sum = 0.0;
    for (std::size_t k = 0; k < m; ++k)
      sum += values[i + k];
    means.push_back(sum / static_cast<double>(m));
  }
  double sum = 0.0;
  for (std::size_t i = 1; i < means.size(); ++i)
    sum += std::pow(means[i] - means[i - 1], 2.0);
  return std::sqrt(0.5 * sum / static_cast<double>(means.size() - 1));
}

std::vector<double> gyro_x(const std::vector<ImuSample>& all) {
  std::vector<double> values;
  for (const ImuSample& sample : all)
    values.push_back(sample.angular_rate.x());
  return values;
}

TEST(ImuRealism, NoiseInstabilityAndWalkHaveTheirAllanFigures) {
  SiteConfig site = silent();
  site.imu.gyro_noise = 1e-3;
  const std::vector<double> white = gyro_x(samples(site, 200'000));
  EXPECT_NEAR(allan_deviation(white, 20), 1e-3, 3e-5);      // at 1 s: the density itself
  EXPECT_NEAR(allan_deviation(white, 320), 0.25e-3, 3e-5);  // falls with the root of time
  site = silent();
  site.imu.gyro_instability = 1e-4;
  double floor = 0.0;
  for (int seed = 1; seed <= 3; ++seed) {
    site.seed = seed;
    const std::vector<double> flicker = gyro_x(samples(site, 200'000));
    for (const std::size_t m : {100U, 400U, 1600U})
      floor += allan_deviation(flicker, m) / 9.0;
  }
  EXPECT_NEAR(floor, 0.664e-4, 0.08e-4);  // level from 5 to 80 s
  site = silent();
  site.imu.gyro_bias_walk = 1e-5;
  const std::vector<double> walk = gyro_x(samples(site, 200'000));
  EXPECT_NEAR(allan_deviation(walk, 400), 1e-5 * std::sqrt(20.0 / 3.0), 3e-6);
}

TEST(ImuRealism, BiasOfTheTruthIsThatOfTheSamples) {
  SiteConfig site = silent();
  site.imu.gyro_instability = 1e-3;
  site.imu.gyro_temperature = 1e-4;
  site.imu.accel_temperature = 1e-3;
  site.imu.gyro_bias_sd = 0.01;
  site.imu.warm_up_k = 20.0;
  site.imu.warm_up_s = 50.0;
  const CarrierPath path = standing();
  InertialSensor imu(site, path, 0);
  for (int i = 0; i < 4000; ++i) {
    const Eigen::Vector3d bias = imu.gyro_bias();
    EXPECT_LT((imu.next().angular_rate - bias).norm(), 1e-12);
  }
}

TEST(ImuRealism, WarmingDriftsToItsEndAndNoFurther) {
  SiteConfig site = silent();
  site.imu.accel_temperature = 1e-3;
  site.imu.warm_up_k = 20.0;
  site.imu.warm_up_s = 50.0;
  const std::vector<ImuSample> all = samples(site, 20'000);
  const Eigen::Vector3d first = all.front().specific_force;
  const Eigen::Vector3d middle = all[1000].specific_force;  // after one time constant
  const Eigen::Vector3d late = all[19'000].specific_force;
  EXPECT_GT((late - first).norm(), 5e-3);
  EXPECT_LT((late - first).norm(), 8e-2);
  EXPECT_NEAR((middle - first).norm() / (late - first).norm(), 1.0 - std::exp(-1.0), 0.01);
  EXPECT_LT((all[19'999].specific_force - late).norm(), 1e-6);
}

TEST(ImuRealism, ShocksRingWhenTheCarrierIsHitAndSaturate) {
  SiteConfig site = silent();
  site.imu.rate_hz = 500.0;
  site.imu.shock_m_s2 = 30.0;
  site.imu.shock_rad_s = 0.5;
  const auto peak_between = [](const std::vector<ImuSample>& all, double from, double to) {
    double peak = 0.0;
    for (const ImuSample& sample : all) {
      const double t = to_seconds(sample.stamp);
      if (t < from || t > to) continue;
      peak = std::max(peak, (sample.specific_force - all.front().specific_force).norm());
    }
    return peak;
  };
  std::vector<ImuSample> all = samples(site, 2500, {2.0, 4.0});
  EXPECT_EQ(peak_between(all, 0.0, 1.99), 0.0);
  EXPECT_GT(peak_between(all, 2.0, 2.2), 8.0);
  EXPECT_LT(peak_between(all, 2.0, 2.2), 46.0);
  EXPECT_LT(peak_between(all, 2.6, 3.99), 1e-9);
  EXPECT_GT(peak_between(all, 4.0, 4.2), 8.0);
  site.imu.accel_range_m_s2 = 12.0;
  site.imu.gyro_range_rad_s = 0.1;
  all = samples(site, 2500, {2.0, 4.0});
  bool clipped = false;
  for (const ImuSample& sample : all) {
    EXPECT_LE(sample.specific_force.cwiseAbs().maxCoeff(), 12.0);
    EXPECT_LE(sample.angular_rate.cwiseAbs().maxCoeff(), 0.1);
    clipped = clipped || sample.angular_rate.cwiseAbs().maxCoeff() == 0.1;
  }
  EXPECT_TRUE(clipped);
}

// The stream of a small site, with the sensors that a test asks for.
struct Counts {
  std::size_t imu = 0;
  TimeNs longest_gap = 0;
  TimeNs first_imu = -1;
  std::vector<TimeNs> scans;
  std::vector<TimeNs> fixes;
  std::vector<std::size_t> before_fix;  // IMU samples read before each fix
};
Counts read(const std::vector<std::string>& settings) {
  std::vector<std::string> all = {"lidar.columns=64", "stand.trees_per_ha=100",
                                  "stand.ground_plants_per_ha=0"};
  all.insert(all.end(), settings.begin(), settings.end());
  Simulator simulator(load_site("demo", all));
  Counts counts;
  TimeNs last = 0;
  while (const std::optional<Event> event = simulator.next()) {
    if (const auto* sample = std::get_if<ImuSample>(&*event)) {
      if (counts.imu > 0) counts.longest_gap = std::max(counts.longest_gap, sample->stamp - last);
      if (counts.imu == 0) counts.first_imu = sample->stamp;
      last = sample->stamp;
      ++counts.imu;
    }
    if (const auto* scan = std::get_if<ScanPtr>(&*event)) counts.scans.push_back((*scan)->stamp);
    if (const auto* fix = std::get_if<GnssFix>(&*event)) {
      counts.fixes.push_back(fix->stamp);
      counts.before_fix.push_back(counts.imu);
    }
  }
  return counts;
}

TEST(ImuRealism, SamplesGetLostOneByOneAndInGaps) {
  const Counts whole = read({"duration_s=20"});
  EXPECT_EQ(whole.imu, 4000U);
  EXPECT_EQ(whole.longest_gap, 5'000'000);
  const Counts some = read({"duration_s=20", "imu.missing=0.1"});
  EXPECT_NEAR(static_cast<double>(some.imu), 3600.0, 80.0);
  const Counts gaps = read({"duration_s=20", "imu.gap_interval_s=4", "imu.gap_s=0.25"});
  EXPECT_GE(gaps.longest_gap, 250'000'000);
  EXPECT_LE(gaps.longest_gap, 520'000'000);
  EXPECT_GT(gaps.imu, 3200U);
  EXPECT_LT(gaps.imu, 4000U);
}

TEST(Clocks, OffsetsMoveStampsAndNothingElse) {
  const Counts plain = read({"duration_s=2"});
  const Counts late = read({"duration_s=2", "lidar.time_offset_s=0.03", "imu.time_offset_s=-0.01"});
  ASSERT_EQ(plain.scans.size(), late.scans.size());
  for (std::size_t i = 0; i < plain.scans.size(); ++i)
    EXPECT_EQ(late.scans[i] - plain.scans[i], 30'000'000);
  EXPECT_EQ(late.first_imu - plain.first_imu, -10'000'000);
}

TEST(Clocks, FixesComeLateButSayWhenTheyWere) {
  const Counts plain = read({"duration_s=3"});
  const Counts late = read({"duration_s=3", "gnss.latency_s=0.4"});
  ASSERT_GT(late.fixes.size(), 5U);
  for (std::size_t i = 0; i < late.fixes.size(); ++i) {
    EXPECT_EQ(late.fixes[i], plain.fixes[i]);
    EXPECT_NEAR(static_cast<double>(late.before_fix[i]) - static_cast<double>(plain.before_fix[i]),
                80.0, 1.0);
  }
}

TEST(Extrinsics, ClaimIsWrongByTheGivenAmount) {
  const Simulator right(load_site("demo", {"duration_s=1"}));
  const Simulator wrong(load_site(
      "demo", {"duration_s=1", "lidar.error_m=[0.03,0,-0.02]", "lidar.error_rpy_deg=[0,2,0]"}));
  const Pose difference = right.rig().body_from_lidar.inverse() * wrong.rig().body_from_lidar;
  EXPECT_LT((difference.translation() - Eigen::Vector3d(0.03, 0.0, -0.02)).norm(), 1e-12);
  EXPECT_NEAR(so3_log(difference.rotation()).norm(), 2.0 * kDegree, 1e-12);
}

// A scene with a receiver below closed canopy and one under open sky.
struct Receiver {
  Receiver(const SiteConfig& config, double trees_per_ha, double seconds)
      : site(config), route(site.carrier, 1) {
    site.stand.trees_per_ha = trees_per_ha;
    const Terrain terrain(site.terrain, 42.0, 42.0, 1, &route);
    const Stand stand = grow_stand(site.stand, site.carrier, terrain, route, 1);
    const ForestScene scene(site.stand, terrain, stand, 1);
    const CarrierPlan plan = plan_carrier(site, route, terrain);
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

TEST(Magnetometer, PointsNorthUntilIronBendsIt) {
  SiteConfig site;
  site.mag.noise_ut = 0.0;
  site.mag.declination_deg = -12.0;
  std::vector<Vector6d> controls(40, Vector6d::Zero());
  for (Vector6d& control : controls)
    control[5] = 0.7;  // faces 0.7 rad north of east
  const CarrierPath path(CarrierPath::Spline(controls, 0.05));
  const auto heading = [&](const SiteConfig& config) {
    Magnetometer mag(config, path, 0);
    for (int i = 0; i < 50; ++i)
      (void)mag.next();
    const Eigen::Vector3d field = 1e6 * mag.next().field;
    EXPECT_NEAR(field.norm(), config.mag.field_ut, 12.0);
    // Yaw from east such that the field points to magnetic north.
    return 90.0 - config.mag.declination_deg - std::atan2(field.y(), field.x()) / kDegree;
  };
  EXPECT_NEAR(heading(site), 0.7 / kDegree, 1e-6);
  double sum = 0.0;
  for (int seed = 1; seed <= 20; ++seed) {
    site.seed = seed;
    site.mag.hard_iron_ut = 5.0;
    site.mag.soft_iron = 0.03;
    sum += std::pow(heading(site) - 0.7 / kDegree, 2.0) / 20.0;
  }
  EXPECT_GT(std::sqrt(sum), 5.0);  // the papers: 15 to 20 degrees
  EXPECT_LT(std::sqrt(sum), 25.0);
}

// ---- lidar -------------------------------------------------------------------------------------

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

// ---- ground and trees --------------------------------------------------------------------------

TEST(Ground, HasSlopesDitchesAndSnowThatHidesThem) {
  TerrainConfig config;
  config.relief_m = config.hummock_m = config.roughness_m = 0.0;
  config.slope_deg = 30.0;
  config.slope_azimuth_deg = 0.0;
  const Terrain steep(config, 40.0, 40.0, 1);
  EXPECT_NEAR(std::atan2(steep.height(10.0, 0.0) - steep.height(-10.0, 0.0), 20.0), 30.0 * kDegree,
              1e-9);
  config.slope_deg = 0.0;
  config.ditches = 1;
  config.ditch_depth_m = 0.8;
  const Terrain ditch(config, 40.0, 40.0, 1);
  EXPECT_NEAR(ditch.height(0.0, 0.0), -0.8, 0.05);
  EXPECT_NEAR(ditch.height(0.0, 8.0), 0.0, 0.01);
  config.ditches = 0;
  config.hummock_m = 0.15;
  const auto unevenness = [](const Terrain& terrain) {
    double sum = 0.0;
    for (double x = -30.0; x < 30.0; x += 0.9)
      sum += std::pow(terrain.height(x, 1.0), 2.0);
    return std::sqrt(sum / 67.0);
  };
  const double bare = unevenness(Terrain(config, 40.0, 40.0, 1));
  config.snow_m = 0.5;
  EXPECT_LT(unevenness(Terrain(config, 40.0, 40.0, 1)), 0.3 * bare);
  CarrierConfig carrier;
  carrier.length_m = 60.0;
  const Route route(carrier, 1);
  config.track_depth = 0.5;
  config.hummock_m = 0.0;
  config.cell_m = 0.1;
  const Terrain pressed(config, 40.0, 40.0, 1, &route);
  double deepest = 0.0;
  for (double across = -1.5; across <= 1.5; across += 0.05) {
    const double heading = route.heading(30.0);
    const Eigen::Vector2d place =
        route.place(30.0) + across * Eigen::Vector2d(-std::sin(heading), std::cos(heading));
    deepest = std::min(deepest, pressed.height(place.x(), place.y()));
  }
  EXPECT_NEAR(deepest, -0.25, 0.03);
}

// A stem seen along a level ray at a height above its foot: the two edges' distance.
double width_at(const SiteConfig& site, const Tree& tree, double height, double* offset = nullptr) {
  const Terrain terrain(site.terrain, 30.0, 30.0, 1);
  Stand stand;
  stand.trees = {tree};
  const ForestScene scene(site.stand, terrain, stand, 1);
  double low = 1e9;
  double high = -1e9;
  for (double y = -3.0; y <= 3.0; y += 0.002) {
    Ray ray;
    ray.origin =
        Eigen::Vector3f(-8.0F, static_cast<float>(y), static_cast<float>(tree.foot.z() + height));
    ray.direction = Eigen::Vector3f::UnitX();
    Hit hit;
    scene.cast(&ray, 1, 0.1F, 20.0F, &hit);
    if (hit.surface != Surface::kStem) continue;
    low = std::min(low, y);
    high = std::max(high, y);
  }
  if (offset != nullptr) *offset = 0.5 * (low + high);
  return high < low ? 0.0 : high - low;
}

TEST(Trees, ForkInTwoAndBreakOff) {
  SiteConfig site;
  site.terrain.relief_m = site.terrain.hummock_m = site.terrain.slope_deg = 0.0;
  site.terrain.roughness_m = 0.0;
  site.stand.foliage = site.stand.dead_branches = 0.0;
  Tree tree;
  tree.id = 1;
  tree.dbh_m = 0.3;
  tree.height_m = 18.0;
  tree.crown_base_m = 9.0;
  tree.crown_radius_m = 1.5;
  tree.yaw_rad = std::numbers::pi / 2.0;  // the second stem leaves to the side
  const double plain = width_at(site, tree, 6.0);
  EXPECT_NEAR(plain, tree.diameter(6.0), 0.006);
  tree.fork_m = 2.0;
  EXPECT_NEAR(width_at(site, tree, 1.3), 0.3, 0.006);  // below the fork nothing changes
  EXPECT_GT(width_at(site, tree, 6.0), plain + 0.5);
  tree.fork_m = 0.0;
  tree.broken_m = 5.0;
  EXPECT_GT(width_at(site, tree, 4.5), 0.2);
  EXPECT_EQ(width_at(site, tree, 6.0), 0.0);
}

TEST(Stands, HaveTheSharesOfForksBreaksAndBoulders) {
  SiteConfig site = load_site(
      "demo", {"stand.size_x_m=150", "stand.size_y_m=150", "stand.fork_share=0.2",
               "stand.broken_share=0.1", "stand.boulders_per_ha=200", "stand.buildings=2"});
  const Route route(site.carrier, 1);
  const Terrain terrain(site.terrain, 87.0, 87.0, 1);
  const Stand stand = grow_stand(site.stand, site.carrier, terrain, route, 1);
  double forks = 0.0;
  double breaks = 0.0;
  for (const Tree& tree : stand.trees) {
    forks += tree.fork_m > 0.0 ? 1.0 : 0.0;
    breaks += tree.broken_m > 0.0 ? 1.0 : 0.0;
  }
  const auto trees = static_cast<double>(stand.trees.size());
  EXPECT_NEAR(forks / trees, 0.18, 0.03);  // broken trees lose their fork
  EXPECT_NEAR(breaks / trees, 0.1, 0.02);
  EXPECT_GT(stand.boulders.size(), 350U);
  EXPECT_EQ(stand.buildings.size(), 2U);
  for (const Wood& boulder : stand.boulders)
    EXPECT_GT(route.distance_to(boulder.from.head<2>()), boulder.radius_from_m);
}

}  // namespace
}  // namespace understory
