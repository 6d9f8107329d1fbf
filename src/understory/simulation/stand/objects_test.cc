#include "understory/simulation/stand/objects.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "understory/simulation/sensors/scanner.h"
#include "understory/simulation/world.h"
#include "understory/util/time.h"

namespace understory {
namespace {

SiteConfig site_with_things(int rays_per_beam) {
  SiteConfig site;
  site.duration_s = 10.0;
  site.carrier.length_m = 60.0;
  site.stand.size_x_m = site.stand.size_y_m = 50.0;
  site.stand.ovality = site.stand.bark_relief_m = site.stand.whorl_swelling_m = 0.0;
  site.stand.wind_sway_m = 0.0;
  site.objects = {2, 8, 2, 2, 3, 4};
  site.lidar.columns = 256;
  site.lidar.rays_per_beam = rays_per_beam;
  site.lidar.divergence_mrad = site.lidar.azimuth_jitter_deg = 0.0;
  site.lidar.range_sd_m = site.lidar.range_sd_per_m = site.lidar.bark_sd_m = 0.0;
  site.lidar.range_step_m = site.lidar.dropout = 0.0;
  return site;
}

// Metres outside of the rectangle that a thing takes up at a time.
double outside_of(const StandObject& object, const Eigen::Vector3d& point, double time_s) {
  const Eigen::Vector3d off = point - motion_at(object, time_s).foot;
  const double c = std::cos(object.yaw_rad);
  const double s = std::sin(object.yaw_rad);
  // Legs of walkers step out of the stated size. Between the moment of the scene and a beam's own
  // time their outlines stay: up to 8 cm. Posts lean.
  const double more = object.walk_m > 0.0 ? 0.2 : 0.1;
  const double along = std::abs(c * off.x() + s * off.y()) - 0.5 * object.size_m.x() - more;
  const double across = std::abs(c * off.y() - s * off.x()) - 0.5 * object.size_m.y() - more - 0.05;
  return std::max({along, across, 0.0});
}

TEST(Objects, AllKindsStandClearOfTheRouteAndOfTrees) {
  const SimulatedWorld world(site_with_things(1));
  std::map<ObjectKind, int> counts;
  for (const StandObject& object : world.stand.objects) {
    ++counts[object.kind];
    EXPECT_GT(world.route.distance_to(object.foot.head<2>()), world.site.objects.clearance_m);
    EXPECT_NEAR(object.foot.z(), world.terrain.smooth_height(object.foot.x(), object.foot.y(), 0.3),
                0.8);
    for (const GrownTree& tree : world.stand.trees)
      EXPECT_GT(outside_of(object, tree.foot, 0.0), 0.0) << object_name(object.kind);
  }
  EXPECT_EQ(counts[ObjectKind::kWall], 4);
  EXPECT_EQ(counts[ObjectKind::kPost], 8);
  EXPECT_EQ(counts[ObjectKind::kFence], 2);
  EXPECT_EQ(counts[ObjectKind::kVehicle], 2);
  EXPECT_EQ(counts[ObjectKind::kPerson], 3);
  EXPECT_EQ(counts[ObjectKind::kWalker], 4);
}

TEST(Objects, WithoutThemAStandIsWhatItWas) {
  SiteConfig with = site_with_things(1);
  SiteConfig without = with;
  without.objects = {};
  const SimulatedWorld bare(without);
  EXPECT_TRUE(bare.stand.objects.empty());
  EXPECT_LT(SimulatedWorld(with).stand.trees.size(), bare.stand.trees.size());
}

TEST(Objects, VelocityOfAWalkerIsTheChangeOfItsPlace) {
  const SimulatedWorld world(site_with_things(1));
  int compared = 0;
  for (const StandObject& object : world.stand.objects) {
    if (object.kind != ObjectKind::kWalker) continue;
    for (double time = 0.1; time < 30.0; time += 0.7) {
      const ObjectMotion before = motion_at(object, time - 1e-4);
      const ObjectMotion after = motion_at(object, time + 1e-4);
      if (before.velocity != after.velocity) continue;  // it turns round
      const Eigen::Vector2d moved = (after.foot - before.foot).head<2>() / 2e-4;
      EXPECT_LT((moved - before.velocity).norm(), 1e-6);
      EXPECT_LE((after.foot - object.foot).head<2>().norm(), 0.5 * object.walk_m + 1e-9);
      ++compared;
    }
  }
  EXPECT_GT(compared, 50);
}

// Points at their true places: on the ground, on the stem of their tree, or on a thing where it is
// at that time. Both ways of casting.
class TruePointsTest : public ::testing::TestWithParam<int> {};

TEST_P(TruePointsTest, LieOnWhatGaveThem) {
  SimulatedWorld world(site_with_things(GetParam()));
  Scanner scanner(world.site, world.scene, world.plan.path, world.machine, 0);
  scanner.keep_sources();
  std::map<int, const GrownTree*> trees;
  for (const GrownTree& tree : world.stand.trees)
    trees[tree.id] = &tree;
  std::map<Surface, int> counts;
  for (const std::int64_t number : {4, 40, 70}) {
    const ScanReadings readings = scanner.measure(number);
    const ScanPtr scan = scanner.assemble(number, readings);
    const std::vector<TruePoint> points = scanner.true_points(*scan, readings);
    ASSERT_EQ(points.size(), scan->points.size());
    for (const TruePoint& point : points) {
      ++counts[point.source.surface];
      if (point.source.surface == Surface::kStem) {
        const GrownTree& tree = *trees.at(point.source.tree);
        const double height = point.place.z() - tree.foot.z();
        const double off = (point.place - tree.centre(height)).head<2>().norm();
        EXPECT_LT(std::abs(off - 0.5 * tree.diameter(height)), 0.05) << height;
      } else if (point.source.surface == Surface::kFoliage) {
        EXPECT_EQ(trees.count(point.source.tree), 1U);
        EXPECT_LT((point.place - trees.at(point.source.tree)->foot).head<2>().norm(), 6.0);
      } else if (point.source.surface == Surface::kObject) {
        EXPECT_EQ(point.source.tree, 0);
        double least = 1e9;
        for (const StandObject& object : world.stand.objects)
          least = std::min(least, outside_of(object, point.place, to_seconds(point.stamp)));
        EXPECT_LT(least, 0.02);
      } else {
        EXPECT_EQ(point.source.tree, 0);
      }
    }
  }
  EXPECT_GT(counts[Surface::kGround], 1000);
  EXPECT_GT(counts[Surface::kStem], 300);
  EXPECT_GT(counts[Surface::kFoliage], 1000);
  EXPECT_GT(counts[Surface::kObject], 300);
}

INSTANTIATE_TEST_SUITE_P(RaysAndBundles, TruePointsTest, ::testing::Values(1, 4));

}  // namespace
}  // namespace understory
