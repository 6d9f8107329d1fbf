#include "understory/simulation/stand/harvest.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>

#include "understory/simulation/sensors/head_log.h"
#include "understory/simulation/sensors/scanner.h"
#include "understory/simulation/simulator.h"
#include "understory/simulation/world.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

const std::vector<std::string> kShort = {"duration_s=110", "seed=31", "stand.size_x_m=200",
                                         "stand.size_y_m=80"};

SiteConfig harvested_site() {
  return load_site("lieksa1", kShort);
}

const GrownTree& tree_with_id(const SimulatedWorld& world, int id) {
  return *std::find_if(world.stand.trees.begin(), world.stand.trees.end(),
                       [&](const GrownTree& tree) { return tree.id == id; });
}

// Straight at a place from 1.5 m to its east.
Hit look_at(const SimulatedWorld& world, const Eigen::Vector3d& place) {
  const Ray ray{(place + Eigen::Vector3d(1.5, 0.0, 0.0)).cast<float>(), {-1.0F, 0.0F, 0.0F}};
  Hit hit;
  world.scene.cast(&ray, 1, 0.05F, 2.0F, &hit);
  return hit;
}

TEST(Harvest, TreesAreInReachStandApartAndAreWorkedOnOneByOne) {
  const SiteConfig whole = load_site("lieksa1", {"seed=31"});
  const std::uint64_t seed = 31;
  const Route route(whole.carrier, seed);
  const Terrain terrain(whole.terrain, 150.0, 80.0, seed, &route);
  const Stand stand = grow_stand(whole.stand, whole.carrier, terrain, route, seed);
  const CarrierPlan plan = plan_carrier(whole, route, terrain, stand);
  ASSERT_GT(plan.harvest.fellings.size(), 40U);
  ASSERT_EQ(plan.shocks_s.size(), plan.harvest.fellings.size());
  double last = 0.0;
  for (const Felling& felling : plan.harvest.fellings) {
    EXPECT_GT(felling.grab_s, last);
    EXPECT_LT(felling.feed_s, felling.drop_s);
    last = felling.drop_s;
    const auto tree = std::find_if(stand.trees.begin(), stand.trees.end(),
                                   [&](const GrownTree& t) { return t.id == felling.tree; });
    ASSERT_NE(tree, stand.trees.end());
    // The head is at the stem that it grips; the ground tilts the machine by a few degrees.
    const Eigen::Vector3d head =
        plan.path.pose(felling.grab_s) * head_in_body(plan.boom.value(felling.grab_s));
    EXPECT_LT((head - tree->centre(0.75)).norm(), 0.6) << felling.tree;
    EXPECT_NEAR((head - tree->centre(0.75)).head<2>().norm(), 0.0, 0.35) << felling.tree;
  }
}

// The machine's own log: a cut each, but for those missed, by the head's place and its errors.
TEST(Harvest, TheHeadLogHasTheCutsWithItsErrors) {
  SimulatedWorld world(load_site("lieksa1", {"seed=31", "head_log.missed=0.2"}));
  const auto& fellings = world.plan.harvest.fellings;
  const auto cuts = log_head_cuts(world, 0, 1e9);
  EXPECT_LT(cuts.size(), fellings.size());
  EXPECT_GT(cuts.size(), fellings.size() / 2);
  double squared = 0.0;
  for (const HeadCutSample& cut : cuts) {
    const auto felling = std::find_if(fellings.begin(), fellings.end(), [&](const Felling& f) {
      return from_seconds(f.grab_s) == cut.stamp;
    });
    ASSERT_NE(felling, fellings.end());
    squared +=
        (cut.head_in_body - head_in_body(world.plan.boom.value(felling->grab_s))).squaredNorm();
  }
  // 0.15 m from cut to cut and as much for all of them, three axes each.
  const double rms = std::sqrt(squared / static_cast<double>(cuts.size()));
  EXPECT_GT(rms, 0.2);
  EXPECT_LT(rms, 0.7);
  EXPECT_TRUE(log_head_cuts(world, 0, 0.0).empty());
}

TEST(Harvest, ATreeIsGoneOnceItIsCutAndItsStumpAndLogsStay) {
  SimulatedWorld world(harvested_site());
  ASSERT_FALSE(world.plan.harvest.fellings.empty());
  const Felling& felling = world.plan.harvest.fellings.front();
  ASSERT_LT(felling.drop_s, 109.0);
  const GrownTree& tree = tree_with_id(world, felling.tree);
  const Eigen::Vector3d stem = tree.centre(2.0);
  const FallenLog& log = world.plan.harvest.logs.front();
  const Eigen::Vector3d middle = 0.5 * (log.lying.from + log.lying.to);
  const Ray down{(middle + Eigen::Vector3d(0.0, 0.0, 1.0)).cast<float>(), {0.0F, 0.0F, -1.0F}};
  const auto above_log = [&] {
    Hit hit;
    world.scene.cast(&down, 1, 0.05F, 5.0F, &hit);
    return hit;
  };
  world.scene.arrange(0.0, felling.grab_s - 0.01);
  EXPECT_EQ(look_at(world, stem).tree, felling.tree);
  EXPECT_NE(above_log().surface, Surface::kDeadWood);
  world.scene.arrange(0.0, felling.grab_s + 0.01);
  EXPECT_NE(look_at(world, stem).tree, felling.tree);
  const Hit stump = look_at(world, tree.centre(0.1));
  EXPECT_EQ(stump.surface, Surface::kDeadWood);
  EXPECT_NEAR(stump.range_m, 1.5 - 0.5 * tree.diameter(0.1), 0.02);
  EXPECT_NE(above_log().surface, Surface::kDeadWood);
  world.scene.arrange(0.0, log.lies_s + 0.01);
  const Hit lying = above_log();
  EXPECT_EQ(lying.surface, Surface::kDeadWood);
  EXPECT_NEAR(lying.range_m, 1.0 - 0.25 * (tree.diameter(0.15) + tree.diameter(4.45)), 0.02);
  // A log touches the ground with its ends.
  EXPECT_NEAR(log.lying.from.z() - log.lying.radius_from_m,
              world.terrain.smooth_height(log.lying.from.x(), log.lying.from.y(), 0.3), 1e-9);
  // Back to before: the scene does not remember.
  world.scene.arrange(0.0, felling.grab_s - 0.01);
  EXPECT_EQ(look_at(world, stem).tree, felling.tree);
}

TEST(Harvest, TheTreeIsHeldWhereItGrewThenFallsAndIsFedAndShortens) {
  SimulatedWorld world(harvested_site());
  const Felling& felling = world.plan.harvest.fellings.front();
  const GrownTree& tree = tree_with_id(world, felling.tree);
  const auto at = [&](double time) { return held_tree(world.plan, felling, tree, time); };
  const HeldTree first = at(felling.grab_s);
  EXPECT_LT((first.world_from_tree.translation() - tree.foot).norm(), 1e-9);
  EXPECT_LT(first.world_from_tree.rotation().angularDistance(Eigen::Quaterniond::Identity()), 1e-9);
  // What a ray meets of it is what stood there.
  const Eigen::Vector3d stem = tree.centre(2.0);
  world.scene.arrange(0.0, felling.grab_s - 0.01);
  const Hit stood = look_at(world, stem);
  Hit held;
  world.scene.cast_held(
      first, {(stem + Eigen::Vector3d(1.5, 0.0, 0.0)).cast<float>(), {-1.0F, 0.0F, 0.0F}}, 0.05F,
      2.0F, held);
  EXPECT_NEAR(held.range_m, stood.range_m, 1e-3);
  EXPECT_EQ(held.tree, 0);
  EXPECT_EQ(held.surface, Surface::kStem);
  // Level after the fall, across the boom, gripped at the head.
  const HeldTree level = at(felling.level_s);
  const Eigen::Vector3d up = level.world_from_tree.rotation() * Eigen::Vector3d::UnitZ();
  EXPECT_LT(std::abs(up.z()), 0.1);
  const Eigen::Vector3d head =
      world.plan.path.pose(felling.level_s) * head_in_body(world.plan.boom.value(felling.level_s));
  EXPECT_LT((level.world_from_tree * (tree.centre(0.75) - tree.foot) - head).norm(), 1e-6);
  // Fed: ever higher up the stem, in pieces that are cut off.
  double fed = 0.0;
  for (double time = felling.feed_s; time < felling.drop_s; time += 0.2) {
    const HeldTree now = at(time);
    EXPECT_GE(now.crown_from_m, fed - 1e-9);
    EXPECT_LE(now.stem_from_m, now.crown_from_m + 1e-9);
    fed = now.crown_from_m;
  }
  EXPECT_NEAR(fed, felling.cuts_m.back(), 0.05);
}

TEST(Harvest, ScansAcrossAFellingAreTheSameForAnyThreadsAndOrder) {
  const SiteConfig config = harvested_site();
  std::vector<std::int64_t> scans;
  std::vector<ScanReadings> forwards;
  with_threads(1, [&] {
    SimulatedWorld world(config);
    Scanner scanner(config, world.scene, world.plan.path, world.machine, 0);
    const Felling& felling = world.plan.harvest.fellings.front();
    const double rate = config.lidar.rate_hz;
    for (const double time : {felling.grab_s, felling.level_s, felling.cut_s(0), felling.drop_s}) {
      const auto scan = static_cast<std::int64_t>(time * rate);
      scans.insert(scans.end(), {scan - 1, scan, scan + 1});
    }
    for (const std::int64_t scan : scans)
      forwards.push_back(scanner.measure(scan));
  });
  with_threads(2, [&] {
    SimulatedWorld world(config);
    Scanner scanner(config, world.scene, world.plan.path, world.machine, 0);
    for (std::size_t i = scans.size(); i-- > 0;) {
      const ScanReadings again = scanner.measure(scans[i]);
      ASSERT_EQ(again.beams.size(), forwards[i].beams.size());
      EXPECT_EQ(std::memcmp(again.beams.data(), forwards[i].beams.data(),
                            again.beams.size() * sizeof(again.beams[0])),
                0)
          << scans[i];
    }
  });
}

TEST(Harvest, TruthSaysWhenTreesWereFelled) {
  const test::TemporaryFolder own;
  const std::string folder = own / "felled.truth";
  SiteConfig config = harvested_site();
  Simulator simulator(config);
  simulator.skip(1'000'000);
  simulator.write_truth(folder);
  std::ifstream file(folder + "/trees.csv");
  std::string line;
  std::getline(file, line);
  EXPECT_EQ(line.substr(line.rfind(',')), ",felled_at");
  SimulatedWorld world(config);
  std::map<int, double> expected;
  for (const Felling& felling : world.plan.harvest.fellings)
    if (felling.grab_s < 109.0) expected[felling.tree] = felling.grab_s;
  ASSERT_FALSE(expected.empty());
  std::size_t felled = 0;
  while (std::getline(file, line)) {
    const std::string last = line.substr(line.rfind(',') + 1);
    if (last.empty()) continue;
    ++felled;
    const auto found = expected.find(std::stoi(line));
    ASSERT_NE(found, expected.end()) << line;
    EXPECT_NEAR(std::stod(last) - config.origin.start_time_s, found->second, 1e-3);
  }
  EXPECT_EQ(felled, expected.size());
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace understory
