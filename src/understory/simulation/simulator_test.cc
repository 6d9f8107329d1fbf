#include "understory/simulation/simulator.h"
#include "understory/simulation/simulation_uri.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "understory/simulation/sensors/satellite.h"
#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

SiteConfig small_site() {
  SiteConfig site = load_site("demo", {"duration_s=3", "lidar.columns=256"});
  return site;
}

bool same(const Event& a, const Event& b) {
  if (a.index() != b.index() || event_time(a) != event_time(b)) return false;
  if (const auto* imu = std::get_if<ImuSample>(&a)) {
    const auto& other = std::get<ImuSample>(b);
    return imu->angular_rate == other.angular_rate && imu->specific_force == other.specific_force;
  }
  if (const auto* fix = std::get_if<GnssFix>(&a)) {
    const auto& other = std::get<GnssFix>(b);
    return fix->latitude_deg == other.latitude_deg && fix->height_m == other.height_m &&
           fix->hdop == other.hdop;
  }
  const auto& points = std::get<ScanPtr>(a)->points;
  const auto& others = std::get<ScanPtr>(b)->points;
  return points.size() == others.size() &&
         std::memcmp(points.data(), others.data(), points.size() * sizeof(ScanPoint)) == 0;
}

std::vector<Event> read_all(Recording& recording) {
  std::vector<Event> events;
  while (std::optional<Event> event = recording.next())
    events.push_back(*event);
  return events;
}

std::size_t lines_of(const std::string& path) {
  std::ifstream file(path);
  EXPECT_TRUE(file.is_open()) << path;
  std::size_t count = 0;
  for (std::string line; std::getline(file, line);)
    ++count;
  return count;
}

TEST(Simulator, ASecondLidarHasItsOwnClockAndLifeAndLeavesTheFirstAlone) {
  const std::vector<std::string> settings = {"duration_s=2",
                                             "stand.size_x_m=80",
                                             "stand.size_y_m=80",
                                             "second_lidar.time_offset_s=0.03",
                                             "second_lidar.begins_s=0.5",
                                             "second_lidar.ends_s=1.5"};
  Simulator alone(load_site("harvester2", settings));
  Simulator both(load_site("harvester2", settings));
  both.give(SimulatedLidars::kBoth);
  ASSERT_EQ(both.rig().further_lidars.size(), 1U);
  EXPECT_TRUE(alone.rig().further_lidars.empty());
  const TimeNs start = from_seconds(1'700'000'000.0 + 0.03);
  std::vector<ScanPtr> of_second;
  while (const std::optional<Event> event = both.next()) {
    if (std::holds_alternative<ScanPtr>(*event) && both.is_of_second_lidar()) {
      of_second.push_back(std::get<ScanPtr>(*event));
      continue;
    }
    const std::optional<Event> other = alone.next();
    ASSERT_TRUE(other && same(*event, *other));
  }
  EXPECT_FALSE(alone.next());
  ASSERT_GE(of_second.size(), 8U);
  EXPECT_GE(of_second.front()->stamp, start + from_seconds(0.5));
  EXPECT_LT(of_second.front()->stamp, start + from_seconds(0.6));
  EXPECT_LE(of_second.back()->end(), start + from_seconds(1.5));
  EXPECT_GT(of_second.back()->end(), start + from_seconds(1.4));
  // The first one is a part of a revolution.
  EXPECT_GT(of_second[1]->points.size(), 3000U);
}

TEST(Simulator, SameSeedSameEventsWithOneAndTwoThreads) {
  std::vector<Event> one;
  std::vector<Event> two;
  with_threads(1, [&] {
    Simulator simulator(small_site());
    one = read_all(simulator);
  });
  with_threads(2, [&] {
    Simulator simulator(small_site());
    two = read_all(simulator);
  });
  ASSERT_EQ(one.size(), two.size());
  for (std::size_t i = 0; i < one.size(); ++i)
    ASSERT_TRUE(same(one[i], two[i])) << "event " << i;
  SiteConfig other = small_site();
  other.seed = 2;
  Simulator simulator(other);
  const std::vector<Event> different = read_all(simulator);
  EXPECT_FALSE(same(one[0], different[0]));
}

TEST(Simulator, EventsComeInOrderAtTheirRates) {
  Simulator simulator(small_site());
  std::size_t counts[3] = {0, 0, 0};
  TimeNs last = 0;
  while (std::optional<Event> event = simulator.next()) {
    ++counts[event->index()];
    // A scan whose last firings brought nothing ends a little before its place in the stream.
    EXPECT_GE(event_time(*event), last - 2'000'000);
    last = event_time(*event);
  }
  EXPECT_NEAR(static_cast<double>(counts[0]), 30.0, 1.0);
  EXPECT_NEAR(static_cast<double>(counts[1]), 600.0, 1.0);
  EXPECT_NEAR(static_cast<double>(counts[2]), 15.0, 1.0);
  EXPECT_EQ(simulator.rig().body_frame, "imu");
  EXPECT_EQ(simulator.topics()[0].messages, counts[0]);
}

TEST(Simulator, SkippingLeavesTheRestAsItWas) {
  Simulator whole(small_site());
  const std::vector<Event> events = read_all(whole);
  Simulator skipping(small_site());
  skipping.skip(400);
  for (std::size_t i = 400; i < events.size(); ++i) {
    const std::optional<Event> event = skipping.next();
    ASSERT_TRUE(event.has_value());
    ASSERT_TRUE(same(*event, events[i])) << "event " << i;
  }
  EXPECT_FALSE(skipping.next().has_value());
}

TEST(Simulator, CacheGivesTheSameEventsAndSurvivesDamage) {
  const test::TemporaryFolder own;
  const std::string folder = own / "cache";
  Log log;
  SiteConfig site = small_site();
  site.duration_s = 1.5;
  Simulator plain(site);
  const std::vector<Event> events = read_all(plain);
  const auto expect_same = [&](const char* what) {
    Simulator cached(site, folder, log);
    const std::vector<Event> others = read_all(cached);
    ASSERT_EQ(others.size(), events.size()) << what;
    for (std::size_t i = 0; i < events.size(); ++i)
      ASSERT_TRUE(same(events[i], others[i])) << what << ", event " << i;
  };
  expect_same("casting");
  const auto file = std::filesystem::directory_iterator(folder)->path();
  const auto size = std::filesystem::file_size(file);
  EXPECT_LT(size / 15, 500'000U);
  expect_same("kept");
  std::filesystem::resize_file(file, size - 1000);  // killed while writing
  expect_same("torn");
  EXPECT_EQ(std::filesystem::file_size(file), size);
  EXPECT_TRUE(log.warnings().empty());
  {
    std::fstream broken(file, std::ios::in | std::ios::out | std::ios::binary);
    broken.seekp(5000);
    broken.put('\x55').put('\xaa').put('\x55');
  }
  expect_same("damaged");
  EXPECT_EQ(log.warnings().size(), 1U);
}

// Whatever lies under the name of the kept scans was cut down to nothing.
TEST(Simulator, AFileOfAnotherProgramInPlaceOfTheCacheStays) {
  const test::TemporaryFolder own;
  SiteConfig site = small_site();
  site.duration_s = 0.3;
  Log log;
  { (void)read_all(*std::make_unique<Simulator>(site, own / "cache", log)); }
  const auto file = std::filesystem::directory_iterator(own / "cache")->path();
  for (const std::string& text : {std::string("the notes of somebody else"), std::string("x")}) {
    std::ofstream(file, std::ios::binary | std::ios::trunc) << text;
    Log heard;
    Simulator simulator(site, own / "cache", heard);
    EXPECT_FALSE(read_all(simulator).empty());
    ASSERT_EQ(heard.warnings().size(), 1U);
    EXPECT_EQ(heard.warnings()[0].key, "simulation.cache");
    std::ifstream kept(file, std::ios::binary);
    EXPECT_EQ(std::string(std::istreambuf_iterator<char>(kept), {}), text);
  }
  EXPECT_TRUE(log.warnings().empty());
}

// Defect: the truth gave broken trees the height that they had before.
TEST(Simulator, TrueHeightsAreThoseOfWhatStands) {
  Simulator simulator(
      load_site("demo", {"duration_s=0.2", "lidar.columns=64", "stand.broken_share=0.5"}));
  (void)read_all(simulator);
  const test::TemporaryFolder own;
  const std::string folder = own / "run.truth";
  simulator.write_truth(folder);
  std::map<std::string, double> ends;
  std::ifstream curves(folder + "/stem_curves.csv");
  std::string line;
  std::getline(curves, line);
  while (std::getline(curves, line)) {
    const std::size_t comma = line.find(',');
    ends[line.substr(0, comma)] = std::stod(line.substr(comma + 1));
  }
  std::ifstream trees(folder + "/trees.csv");
  std::getline(trees, line);
  int low = 0;
  while (std::getline(trees, line)) {
    std::stringstream row(line);
    std::vector<std::string> cells;
    for (std::string cell; std::getline(row, cell, ',');)
      cells.push_back(cell);
    const double height = std::stod(cells.at(6));  // height_m
    EXPECT_NEAR(height, ends.at(cells[0]), 0.1 + 1e-6) << line;
    low += height < 6.0 ? 1 : 0;
  }
  EXPECT_GT(ends.size(), 100U);
  EXPECT_GT(low, 5);
}

TEST(Simulator, DeadWoodIsInTheTruth) {
  Simulator simulator(load_site("demo", {"duration_s=0.2", "lidar.columns=64",
                                         "stand.stumps_per_ha=200", "stand.logs_per_ha=100"}));
  (void)read_all(simulator);
  const test::TemporaryFolder own;
  const std::string folder = own / "run.truth";
  simulator.write_truth(folder);
  std::ifstream file(folder + "/dead_wood.csv");
  std::string line;
  std::getline(file, line);
  std::map<std::string, int> count;
  while (std::getline(file, line)) {
    std::stringstream row(line);
    std::string kind;
    std::getline(row, kind, ',');
    ++count[kind];
    std::vector<double> cells;
    for (std::string cell; std::getline(row, cell, ',');)
      cells.push_back(std::stod(cell));
    ASSERT_EQ(cells.size(), 8U) << line;
    const double length = std::hypot(cells[3] - cells[0], cells[4] - cells[1]);
    if (kind == "stump") {
      EXPECT_LT(length, 1e-6) << line;
      EXPECT_GT(cells[5], cells[2]) << line;
    } else {
      EXPECT_TRUE(length > 2.9 && length < 11.1) << line;
    }
    EXPECT_GT(cells[6], 0.1) << line;
  }
  EXPECT_GT(count["stump"], 20);
  EXPECT_GT(count["log"], 10);
  EXPECT_EQ(count.size(), 2U);
}

// By tree: diameter at breast height less the one 1.3 m above the foot, metres.
std::map<std::string, double> uphill_differences(const std::string& folder) {
  std::map<std::string, double> at_axis;
  std::ifstream curves(folder + "/stem_curves.csv");
  std::string line;
  while (std::getline(curves, line)) {
    std::stringstream row(line);
    std::vector<std::string> cells;
    for (std::string cell; std::getline(row, cell, ',');)
      cells.push_back(cell);
    if (cells.at(1) == "1.3") at_axis[cells[0]] = std::stod(cells.at(4));
  }
  std::map<std::string, double> differences;
  std::ifstream trees(folder + "/trees.csv");
  std::getline(trees, line);
  while (std::getline(trees, line)) {
    std::stringstream row(line);
    std::vector<std::string> cells;
    for (std::string cell; std::getline(row, cell, ',');)
      cells.push_back(cell);
    const double dbh = std::stod(cells.at(4));
    if (dbh > 0.2 && at_axis.count(cells[0]) > 0) differences[cells[0]] = dbh - at_axis[cells[0]];
  }
  return differences;
}

TEST(Simulator, TrueBreastHeightBeginsAtTheUphillSide) {
  for (const char* slope : {"terrain.slope_deg=0", "terrain.slope_deg=25"}) {
    Simulator simulator(
        load_site("demo", {"duration_s=0.2", "lidar.columns=64", "terrain.relief_m=0",
                           "terrain.hummock_m=0", "terrain.roughness_m=0", slope}));
    (void)read_all(simulator);
    const test::TemporaryFolder own;
    simulator.write_truth(own / "run.truth");
    const std::map<std::string, double> differences = uphill_differences(own / "run.truth");
    ASSERT_GT(differences.size(), 20U);
    const bool even = std::string(slope).ends_with("=0");
    for (const auto& [tree, difference] : differences) {
      // A stem of 24 cm has its uphill side 6 cm above its foot, and loses about 1 cm a metre.
      EXPECT_LT(difference, even ? 1e-5 : -2e-4) << tree;
      EXPECT_GT(difference, even ? -1e-5 : -0.006) << tree;
    }
  }
}

TEST(Simulator, WritesItsTruth) {
  Simulator simulator(small_site());
  const std::vector<Event> events = read_all(simulator);
  std::size_t scans = 0;
  for (const Event& event : events)
    scans += std::holds_alternative<ScanPtr>(event) ? 1 : 0;
  const test::TemporaryFolder own;
  const std::string folder = own / "run.truth";
  simulator.write_truth(folder);
  EXPECT_EQ(lines_of(folder + "/trajectory.tum"), scans);
  EXPECT_EQ(lines_of(folder + "/velocity.csv"), scans + 1);
  EXPECT_EQ(lines_of(folder + "/imu_bias.csv"), scans + 1);
  EXPECT_GT(lines_of(folder + "/trees.csv"), 100U);
  EXPECT_TRUE(std::filesystem::exists(folder + "/returns.csv.gz"));
  EXPECT_TRUE(std::filesystem::exists(folder + "/dtm.tif"));
  // The site that was written is the site that was run.
  const SiteConfig again = load_site(folder + "/site.yaml", {});
  Simulator second(again);
  EXPECT_TRUE(same(*second.next(), events[0]));
  EXPECT_THROW(simulator.write_truth("/proc/nowhere"), OutputError);
}

TEST(SatelliteReceiver, ErrorsGrowUnderTheCanopyAndAreWorseInHeight) {
  const auto run = [](double trees_per_ha, Eigen::Vector3d& squares, double& reported) {
    int count = 0;
    squares.setZero();
    reported = 0.0;
    for (int seed = 1; seed <= 6; ++seed) {
      SiteConfig site = load_site("demo", {"gnss.rate_hz=1", "gnss.correlation_s=4"});
      site.seed = seed;
      site.stand.trees_per_ha = trees_per_ha;
      const auto key = static_cast<std::uint64_t>(seed);
      const Route route(site.carrier, key);
      const Terrain terrain(site.terrain, 40.0, 40.0, key);
      const Stand stand = grow_stand(site.stand, site.carrier, terrain, route, key);
      const CarrierPlan plan = plan_carrier(site, route, terrain, stand);
      const ForestScene scene(site.stand, terrain, stand, key);
      SatelliteReceiver receiver(site, plan.path, scene, 0);
      while (to_seconds(receiver.next_stamp()) < plan.path.duration_s()) {
        const std::optional<GnssFix> fix = receiver.next();
        if (!fix) continue;
        squares += receiver.last_error_enu().cwiseAbs2();
        reported += std::sqrt(fix->covariance(0, 0));
        ++count;
      }
    }
    squares /= count;
    reported /= count;
  };
  Eigen::Vector3d open;
  Eigen::Vector3d dense;
  double open_reported = 0.0;
  double dense_reported = 0.0;
  run(0.0, open, open_reported);
  run(1200.0, dense, dense_reported);
  EXPECT_GT(dense.x() + dense.y(), 2.0 * (open.x() + open.y()));
  EXPECT_GT(dense.z(), 1.2 * (dense.x() + dense.y()));
  EXPECT_LT(dense_reported, 0.8 * std::sqrt(0.5 * (dense.x() + dense.y())));  // overconfident
}

TEST(Geodetic, SmallOffsetsFollowTheRadiiOfCurvature) {
  OriginConfig origin;
  const double lat = origin.latitude_deg * std::numbers::pi / 180.0;
  const double e2 = 0.00669437999014;
  const double w = std::sqrt(1.0 - e2 * std::pow(std::sin(lat), 2.0));
  const double prime = 6378137.0 / w;
  const double meridian = 6378137.0 * (1.0 - e2) / (w * w * w);
  const Eigen::Vector3d zero = geodetic_from_enu(origin, Eigen::Vector3d::Zero());
  EXPECT_NEAR(zero.x(), origin.latitude_deg, 1e-12);
  EXPECT_NEAR(zero.y(), origin.longitude_deg, 1e-12);
  EXPECT_NEAR(zero.z(), origin.height_m, 1e-8);
  const Eigen::Vector3d moved = geodetic_from_enu(origin, {10.0, 20.0, 5.0});
  const double degree = std::numbers::pi / 180.0;
  EXPECT_NEAR((moved.x() - origin.latitude_deg) * degree * (meridian + 150.0), 20.0, 1e-3);
  EXPECT_NEAR((moved.y() - origin.longitude_deg) * degree * (prime + 150.0) * std::cos(lat), 10.0,
              1e-3);
  EXPECT_NEAR(moved.z() - origin.height_m, 5.0, 1e-3);
}

TEST(Sites, AreFoundByNameAndChangedBySettings) {
  ASSERT_GE(shipped_sites().size(), 3U);
  for (const ShippedSite& site : shipped_sites()) {
    EXPECT_FALSE(site.summary.empty());
    EXPECT_NO_THROW((void)load_site(site.name, {}));
  }
  EXPECT_EQ(load_site("handheld", {"seed=9", "lidar.rays_per_beam=4"}).lidar.rays_per_beam, 4);
  EXPECT_THROW((void)load_site("nowhere", {}), InputError);
  try {
    (void)load_site("handheld", {"lidar.raysperbeam=4", "seed=-3"});
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_EQ(error.problems().size(), 2U);
  }
}

// The recording said that the IMU was not turned, and its map was untrusted.
TEST(Sites, AnImuThatIsTheBodyHasNoMount) {
  EXPECT_THROW((void)load_site("handheld", {"imu.mount_rpy_deg=[0, 0, 135]"}), ConfigError);
  EXPECT_THROW((void)load_site("handheld", {"imu.mount_m=[0.1, 0, 0]"}), ConfigError);
  EXPECT_NO_THROW(
      (void)load_site("handheld", {"imu.mount_m=[0.1, 0, 0]", "carrier.body=base_link"}));
}

TEST(Sites, UrisAreTakenApart) {
  const SimulationUri uri = parse_simulation_uri("sim:handheld?seed=3&lidar.rays_per_beam=1");
  EXPECT_EQ(uri.site, "handheld");
  EXPECT_EQ(uri.settings, (std::vector<std::string>{"seed=3", "lidar.rays_per_beam=1"}));
  EXPECT_TRUE(parse_simulation_uri("sim:demo").settings.empty());
  EXPECT_FALSE(is_simulation_uri("handheld.mcap"));
  EXPECT_THROW((void)parse_simulation_uri("sim:"), ConfigError);
}

}  // namespace
}  // namespace understory
