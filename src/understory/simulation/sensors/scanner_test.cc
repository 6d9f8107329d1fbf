#include "understory/simulation/sensors/scanner.h"

#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>

#include "understory/simulation/world.h"
#include "understory/util/angles.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

// A scanner with all that it needs, without noise.
struct World : SimulatedWorld {
  explicit World(const SiteConfig& config)
      : SimulatedWorld(config), scanner(site, scene, plan.path, machine, 0) {}

  [[nodiscard]] Eigen::Vector3d in_world(const Scan& scan, const ScanPoint& point) const {
    const Pose world_from_lidar =
        plan.path.pose(to_seconds(scan.stamp + point.t_ns)) * scanner.body_from_lidar();
    return world_from_lidar * Eigen::Vector3d(point.x, point.y, point.z);
  }

  Scanner scanner;
};

SiteConfig quiet_site() {
  SiteConfig site;
  site.duration_s = 30.0;
  site.carrier.length_m = 60.0;
  site.stand.size_x_m = site.stand.size_y_m = 50.0;
  site.stand.trees_per_ha = 600.0;
  site.stand.foliage = site.stand.dead_branches = site.stand.wind_sway_m = 0.0;
  site.stand.seedlings_per_ha = site.stand.shrubs_per_ha = 0.0;
  site.stand.ground_plants_per_ha = 0.0;
  site.stand.stumps_per_ha = site.stand.logs_per_ha = 0.0;
  site.stand.ovality = site.stand.bark_relief_m = site.stand.whorl_swelling_m = 0.0;
  site.lidar.columns = 512;
  site.lidar.divergence_mrad = site.lidar.azimuth_jitter_deg = 0.0;
  site.lidar.range_sd_m = site.lidar.range_sd_per_m = site.lidar.bark_sd_m = 0.0;
  site.lidar.range_step_m = site.lidar.dropout = 0.0;
  site.lidar.range_10_percent_m = 1000.0;
  return site;
}

// Distance of a point from a stem, with sign: from the spheres that roll along each of its cones.
double off_bark(const GrownTree& tree, const Eigen::Vector3d& point) {
  const std::vector<double> heights = tree.joints();
  double nearest = 1e9;
  for (std::size_t i = 0; i + 1 < heights.size(); ++i) {
    const GrownTree::Joint low = tree.joint(heights[i]);
    const GrownTree::Joint high = tree.joint(heights[i + 1]);
    if (point.z() < low.centre.z() - 1.0 || point.z() > high.centre.z() + 1.0) continue;
    const auto distance = [&](double u) {
      return (point - low.centre - u * (high.centre - low.centre)).norm() - low.radius_m -
             u * (high.radius_m - low.radius_m);
    };
    double from = 0.0;
    double to = 1.0;
    for (int step = 0; step < 60; ++step) {  // the distance is convex along the cone
      const double a = from + (to - from) / 3.0;
      const double b = to - (to - from) / 3.0;
      (distance(a) < distance(b) ? to : from) = distance(a) < distance(b) ? b : a;
    }
    nearest = std::min(nearest, distance(from));
  }
  return nearest;
}

const GrownTree* nearest_tree(const Stand& stand, const Eigen::Vector3d& point) {
  const GrownTree* best = nullptr;
  double nearest = 1e9;
  for (const GrownTree& tree : stand.trees) {
    if ((tree.centre(point.z() - tree.foot.z()) - point).head<2>().norm() > 0.4) continue;
    const double distance = std::abs(off_bark(tree, point));
    if (distance < nearest) {
      nearest = distance;
      best = &tree;
    }
  }
  return best;
}

TEST(Scanner, VlpOnFlatGroundSeesRingsAtTheirAnglesAndRanges) {
  SiteConfig site = quiet_site();
  site.terrain.relief_m = site.terrain.slope_deg = 0.0;
  site.terrain.hummock_m = site.terrain.roughness_m = 0.0;
  site.stand.trees_per_ha = 0.0;
  site.carrier.height_m = 0.0;
  site.carrier.still_s = 20.0;
  site.lidar.model = "VLP-16";
  site.lidar.mount_m = {0.0, 0.0, 1.5};
  site.lidar.fov_deg = 360.0;
  site.lidar.max_range_m = 20.0;
  World world(site);
  const SimulatedScan simulated = world.scanner.cast(20);
  const Scan& scan = *simulated.scan;
  // Five rings look down steeply enough to end within 20 m: -15 to -5 degrees is six, of which the
  // last meets the ground at 17.2 m.
  EXPECT_GT(scan.points.size(), 6U * 1800U);
  std::uint32_t last = 0;
  for (const ScanPoint& point : scan.points) {
    const double flat = std::hypot(point.x, point.y);
    const double elevation = std::atan2(point.z, flat) / kDegree;
    EXPECT_NEAR(elevation, -15.0 + 2.0 * point.ring, 1e-4);
    EXPECT_LE(point.ring, 5);
    EXPECT_NEAR(std::hypot(flat, point.z), 1.5 / std::sin(-elevation * kDegree), 2e-3);
    EXPECT_GE(point.t_ns, last);
    last = point.t_ns;
    // 2.304 us between lasers, 55.296 us between sequences.
    const double in_sequence = std::fmod(point.t_ns + 0.5, 55296.0);
    EXPECT_LT(std::fmod(in_sequence, 2304.0), 2.0);
    EXPECT_LT(in_sequence, 16 * 2304.0);
  }
  EXPECT_GT(last, 99'000'000U);
  EXPECT_LT(last, 100'000'000U);
}

TEST(Scanner, NarrowViewKeepsToItsSector) {
  SiteConfig site = quiet_site();
  site.lidar.model = "VLP-16";
  site.lidar.mount_m = {0.0, 0.0, -1.7};
  site.lidar.fov_deg = 210.0;
  World world(site);
  const ScanPtr kept = world.scanner.cast(10).scan;
  const Scan& scan = *kept;
  double widest = 0.0;
  for (const ScanPoint& point : scan.points)
    widest = std::max(widest, std::abs(std::atan2(point.y, point.x)) / kDegree);
  EXPECT_LT(widest, 105.1);
  EXPECT_GT(widest, 104.0);
}

// Beams that swing. They meet the ground at places that agree with the directions and the times of
// the points.
TEST(Scanner, Mid360SwingsOverItsFieldAndMeetsTheGroundThere) {
  SiteConfig site = quiet_site();
  site.terrain.relief_m = site.terrain.slope_deg = 0.0;
  site.terrain.hummock_m = site.terrain.roughness_m = 0.0;
  site.stand.trees_per_ha = 0.0;
  site.carrier.height_m = 0.0;
  site.carrier.still_s = 20.0;
  site.lidar.model = "Mid-360";
  site.lidar.mount_m = {0.0, 0.0, 1.5};
  World world(site);
  const SimulatedScan simulated = world.scanner.cast(20);
  const Scan& scan = *simulated.scan;
  EXPECT_EQ(scan.ring_count, 0);
  // Of 5000 firings of four lines, those from -7 to -1.6 degrees meet the ground within 55 m.
  EXPECT_NEAR(static_cast<double>(scan.points.size()), 20'000.0 * (7.0 - 1.56) / 59.0, 300.0);
  for (const ScanPoint& point : scan.points) {
    const double flat = std::hypot(point.x, point.y);
    const double elevation = std::atan2(point.z, flat) / kDegree;
    EXPECT_GE(elevation, -7.0 - 1e-4);
    EXPECT_NEAR(std::hypot(flat, point.z) * std::sin(-elevation * kDegree), 1.5, 5e-3);
    EXPECT_LT(point.ring, 4);
    EXPECT_EQ(point.t_ns % 20'000, 0U);
    EXPECT_LT(point.t_ns, 100'000'000U);
  }
}

// In ten turns no direction comes back: the swing has moved by a golden share of itself each time.
TEST(LidarModels, PatternOfTheMid360DoesNotRepeat) {
  LidarConfig config;
  config.model = "Mid-360";
  const LidarModel model = make_lidar_model(config);
  EXPECT_NEAR(1e9 / model.firing_ns * static_cast<double>(model.beams.size()), 200'000.0, 1e-6);
  double lowest = 1e9;
  double highest = -1e9;
  for (int firing = 0; firing < 5000; ++firing) {
    const double elevation = model.elevation(0, firing * model.firing_ns) / kDegree;
    lowest = std::min(lowest, elevation);
    highest = std::max(highest, elevation);
  }
  EXPECT_NEAR(lowest, -7.0, 0.5);
  EXPECT_NEAR(highest, 52.0, 0.5);
  for (int turn = 1; turn <= 10; ++turn) {
    int same = 0;
    for (int firing = 0; firing < 5000; ++firing) {
      const double now = model.elevation(0, firing * model.firing_ns);
      const double then = model.elevation(0, firing * model.firing_ns + turn * model.revolution_ns);
      same += std::abs(now - then) < 0.1 * kDegree ? 1 : 0;
    }
    EXPECT_LT(same, 100) << turn;
  }
}

TEST(Scanner, PointsAtTheirOwnTimesLieOnTheSurfaces) {
  World world(quiet_site());
  std::size_t ground = 0;
  std::size_t bark = 0;
  for (const std::int64_t number : {5, 100, 230}) {
    const SimulatedScan simulated = world.scanner.cast(number);
    ASSERT_GT(simulated.scan->points.size(), 20000U);
    for (const ScanPoint& point : simulated.scan->points) {
      const Eigen::Vector3d place = world.in_world(*simulated.scan, point);
      const double above = place.z() - world.terrain.height(place.x(), place.y());
      if (std::abs(above) < 1e-3) {
        ++ground;
        continue;
      }
      const GrownTree* tree = nearest_tree(world.stand, place);
      ASSERT_NE(tree, nullptr);
      EXPECT_NEAR(off_bark(*tree, place), 0.0, 1e-3);
      ++bark;
    }
  }
  EXPECT_GT(ground, 30000U);
  EXPECT_GT(bark, 3000U);
}

TEST(GrownTree, StemHasItsDiameterAtBreastHeight) {
  World world(quiet_site());
  for (const GrownTree& tree : world.stand.trees) {
    EXPECT_NEAR(2.0 * tree.joint(1.3).radius_m, tree.dbh_m, 1e-12);
    EXPECT_NEAR(tree.centre(0.0).z(), world.terrain.height(tree.foot.x(), tree.foot.y()), 1e-12);
    EXPECT_LT(tree.diameter(tree.height_m * 0.8), tree.dbh_m);
  }
}

TEST(Scanner, CountsOfStemReturnsAgreeWithABruteCount) {
  World world(quiet_site());
  const SimulatedScan simulated = world.scanner.cast(150);
  std::map<int, std::map<int, int>> counted;
  for (const ScanPoint& point : simulated.scan->points) {
    const Eigen::Vector3d place = world.in_world(*simulated.scan, point);
    if (std::abs(place.z() - world.terrain.height(place.x(), place.y())) < 1e-3) continue;
    ++counted[nearest_tree(world.stand, place)->id][point.ring];
  }
  ASSERT_GT(simulated.stems.size(), 20U);
  EXPECT_NEAR(static_cast<double>(counted.size()), static_cast<double>(simulated.stems.size()), 1);
  for (const StemReturns& stem : simulated.stems) {
    int returns = 0;
    int with_3 = 0;
    for (const auto& [ring, count] : counted[stem.tree]) {
      returns += count;
      with_3 += count >= 3 ? 1 : 0;
    }
    // A return just at the foot may be taken for ground.
    EXPECT_NEAR(stem.returns, returns, 2) << "tree " << stem.tree;
    EXPECT_NEAR(stem.rings, static_cast<int>(counted[stem.tree].size()), 2);
    EXPECT_NEAR(stem.rings_with_3, with_3, 2);
  }
}

// Both ways of casting.
class ScannerOfRays : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Scanner, ScannerOfRays, ::testing::Values(3, 8));

TEST_P(ScannerOfRays, SameBytesForAnyNumberOfThreadsAndAnyOrder) {
  SiteConfig site = quiet_site();
  site.stand.foliage = 1.0;
  site.lidar.range_sd_m = 0.02;
  site.lidar.divergence_mrad = 6.0;
  site.lidar.rays_per_beam = GetParam();
  site.lidar.range_10_percent_m = 17.0;
  World one(site);
  World two(site);
  std::vector<SimulatedScan> alone(3);
  with_threads(1, [&] {
    for (std::int64_t i = 0; i < 3; ++i)
      alone[static_cast<std::size_t>(i)] = one.scanner.cast(i);
  });
  with_threads(2, [&] {
    for (std::int64_t i = 2; i >= 0; --i) {
      const SimulatedScan both = two.scanner.cast(i);
      const SimulatedScan& first = alone[static_cast<std::size_t>(i)];
      ASSERT_EQ(both.scan->points.size(), first.scan->points.size());
      EXPECT_EQ(std::memcmp(both.scan->points.data(), first.scan->points.data(),
                            first.scan->points.size() * sizeof(ScanPoint)),
                0);
      ASSERT_EQ(both.stems.size(), first.stems.size());
    }
  });
}

TEST(Scanner, RangeNoiseGrowsWithRangeAndIncidence) {
  SiteConfig site = quiet_site();
  site.terrain.relief_m = site.terrain.slope_deg = 0.0;
  site.terrain.hummock_m = site.terrain.roughness_m = 0.0;
  site.stand.trees_per_ha = 0.0;
  site.stand.size_x_m = site.stand.size_y_m = 100.0;
  site.carrier.height_m = 3.2;
  site.carrier.still_s = 20.0;
  site.lidar.mount_m = {0.0, 0.0, 0.0};
  site.lidar.range_sd_m = 0.012;
  site.lidar.range_sd_per_m = 0.0004;
  World world(site);
  const ScanPtr kept = world.scanner.cast(20).scan;
  const Scan& scan = *kept;
  std::map<int, std::pair<double, int>> squares;
  for (const ScanPoint& point : scan.points) {
    const double range = std::sqrt(point.x * point.x + point.y * point.y + point.z * point.z);
    const double truth = range * 3.2 / -point.z;
    squares[point.ring].first += std::pow(range - truth, 2.0);
    squares[point.ring].second += 1;
  }
  const auto sd = [&](int ring) { return std::sqrt(squares[ring].first / squares[ring].second); };
  EXPECT_NEAR(sd(0), 0.012 * (1.0 + 0.35), 0.002);  // 45 degrees down
  EXPECT_GT(sd(50), 1.3 * sd(0));                   // 9.6 degrees down, 19 m away
}

TEST(ForestScene, WindMovesCrowns) {
  SiteConfig site = quiet_site();
  site.stand.wind_sway_m = 0.3;
  site.stand.foliage = 1.0;
  World leafy(site);
  const Ray up{{0.0F, 0.0F, 2.0F}, {0.0F, 0.6F, 0.8F}};
  std::vector<Ray> fan;
  for (int i = 0; i < 400; ++i) {
    const float angle = 0.0157F * static_cast<float>(i);
    fan.push_back({up.origin, {0.6F * std::cos(angle), 0.6F * std::sin(angle), 0.8F}});
  }
  const auto ranges = [&](double time) {
    std::vector<Hit> hits(fan.size());
    leafy.scene.arrange(time, time);
    leafy.scene.cast(fan.data(), fan.size(), 0.1F, 40.0F, hits.data());
    std::vector<float> values;
    for (const Hit& hit : hits)
      values.push_back(hit.range_m);
    return values;
  };
  const std::vector<float> first = ranges(1.0);
  const std::vector<float> later = ranges(2.0);
  EXPECT_NE(first, later);
  EXPECT_EQ(first, ranges(1.0));
}

// Sixteen rays go through the scene together, and plants lie in another tree of boxes than crowns.
TEST(ForestScene, RaysMeetTheSameAloneAndTogether) {
  SiteConfig site = quiet_site();
  site.stand.wind_sway_m = 0.3;
  site.stand.foliage = site.stand.dead_branches = 1.0;
  site.stand.ground_plants_per_ha = 4000.0;
  World world(site);
  world.scene.arrange(3.0, 3.0);
  Random random(5);
  std::vector<Ray> rays;
  for (int i = 0; i < 5000; ++i) {
    const Eigen::Vector3f towards(static_cast<float>(random.normal()),
                                  static_cast<float>(random.normal()),
                                  static_cast<float>(0.5 * random.normal()));
    rays.push_back({{0.0F, 0.0F, 3.0F}, towards.normalized(), 0.02F});
  }
  std::vector<Hit> hits(rays.size());
  world.scene.cast(rays.data(), rays.size(), 0.1F, 60.0F, hits.data());
  std::map<Surface, int> seen;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    Hit alone;
    world.scene.cast(&rays[i], 1, 0.1F, 60.0F, &alone);
    ASSERT_EQ(alone.range_m, hits[i].range_m);
    ASSERT_EQ(alone.cosine, hits[i].cosine);
    ASSERT_EQ(alone.surface, hits[i].surface);
    ++seen[alone.surface];
  }
  for (const Surface surface :
       {Surface::kGround, Surface::kStem, Surface::kFoliage, Surface::kPlant}) {
    EXPECT_GT(seen[surface], 20) << static_cast<int>(surface);
  }
}

// A firing measures the same in whichever block it is cast: half a view begins its blocks
// elsewhere.
TEST(Scanner, HalfAViewIsHalfOfTheWholeView) {
  SiteConfig site = quiet_site();
  site.stand.foliage = 1.0;
  site.lidar.columns = 500;
  site.lidar.divergence_mrad = 3.0;
  site.lidar.rays_per_beam = 3;
  site.lidar.range_sd_m = 0.01;
  World whole(site);
  site.lidar.fov_deg = 197.0;
  World half(site);
  const std::vector<BeamReading> all = whole.scanner.measure(7).beams;
  const std::vector<BeamReading> part = half.scanner.measure(7).beams;
  const LidarModel::Firings all_firings = whole.scanner.model().firings(7);
  const LidarModel::Firings part_firings = half.scanner.model().firings(7);
  const std::size_t beams = whole.scanner.model().beams.size();
  ASSERT_EQ(part.size(), beams * static_cast<std::size_t>(part_firings.end - part_firings.first));
  ASSERT_NE((part_firings.first - all_firings.first) % 64, 0);
  const std::size_t ahead =
      beams * static_cast<std::size_t>(part_firings.first - all_firings.first);
  std::size_t returns = 0;
  for (std::size_t i = 0; i < part.size(); ++i) {
    ASSERT_EQ(part[i].range_m, all[ahead + i].range_m) << i;
    ASSERT_EQ(part[i].intensity, all[ahead + i].intensity) << i;
    returns += part[i].range_m > 0.0F ? 1 : 0;
  }
  EXPECT_GT(returns, part.size() / 4);
}

// The edges of stems mix: with a wide beam the points around a stem spread farther than it is wide.
TEST(Scanner, WideBeamsMakeStemsWider) {
  SiteConfig site = quiet_site();
  site.stand.trees_per_ha = 300.0;
  const auto width = [](const SiteConfig& config) {
    World world(config);
    const SimulatedScan simulated = world.scanner.cast(10);
    int returns = 0;
    for (const StemReturns& stem : simulated.stems)
      returns += stem.returns;
    return returns;
  };
  const int narrow = width(site);
  site.lidar.divergence_mrad = 6.1;
  site.lidar.rays_per_beam = 16;
  const int wide = width(site);
  EXPECT_GT(wide, 1.02 * narrow);
}

TEST(ForestScene, LeavesTheProcessItsThreads) {
  using Control = oneapi::tbb::global_control;
  const Terrain terrain({}, 40.0, 40.0, 1);
  const std::size_t before = Control::active_value(Control::max_allowed_parallelism);
  const ForestScene scene({}, terrain, {}, 1);
  EXPECT_EQ(Control::active_value(Control::max_allowed_parallelism), before);
}

TEST(ForestScene, OpenSkyIsOpenAndAStandHidesIt) {
  SiteConfig site = quiet_site();
  site.stand.foliage = 1.0;
  site.stand.trees_per_ha = 1200.0;
  World dense(site);
  site.stand.trees_per_ha = 0.0;
  World open(site);
  EXPECT_EQ(open.scene.canopy_cover({0.0, 0.0, 5.0}), 0.0);
  EXPECT_GT(dense.scene.canopy_cover({0.0, 0.0, 5.0}), 0.3);
}

}  // namespace
}  // namespace understory
