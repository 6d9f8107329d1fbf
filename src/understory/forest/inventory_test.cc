#include "understory/forest/inventory.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "understory/forest/ground/uphill_side.h"
#include "understory/forest/test_plot.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

TEST(Inventory, DiametersPositionsAndHeightsOfAStand) {
  TestPlot plot(4);
  plot.slope_x = 0.25;
  plot.add_ground(24.0, 40);
  std::vector<TestPlot::Stem> stems;
  for (int i = 0; i < 16; ++i) {
    TestPlot::Stem stem{3.0 + 6.0 * (i % 4), 3.0 + 6.0 * (i / 4), 0.08 + 0.03 * i};
    stem.lean_x = 0.01 * (i % 5);
    stem.noise_m = 0.01;
    stems.push_back(stem);
    plot.add_stem(stem);
  }
  const InventoryResult result = take_inventory(blocks_of(plot.cloud), {});
  EXPECT_EQ(result.trees.size(), stems.size());
  for (const TestPlot::Stem& stem : stems) {
    const Tree* tree = nearest(result.trees, stem.x, stem.y);
    ASSERT_NE(tree, nullptr) << stem.x << " " << stem.y;
    EXPECT_NEAR(tree->dbh_m, stem.dbh, 0.012);
    EXPECT_LT(std::abs(tree->dbh_m - stem.dbh), 5.0 * tree->dbh_sd_m + 0.004);
    EXPECT_NEAR(tree->x, stem.x, 0.02);
    EXPECT_NEAR(tree->z, plot.ground(stem.x, stem.y), 0.06);
    EXPECT_NEAR(tree->lean_deg, std::atan(stem.lean_x) * 180.0 / M_PI, 0.8);
    EXPECT_NEAR(tree->height_m, 15.0, 0.7);
  }
  for (std::size_t i = 0; i < result.stems.size(); ++i) {
    EXPECT_GT(result.stems[i].section_radius_m, 0.0) << i;
    const Tree& tree = result.trees[i];
    const StemFit& stem = result.stems[i];
    const double rise =
        uphill_rise_m(result.ground.terrain, {tree.x, tree.y}, stem.section_radius_m);
    EXPECT_GT(rise, 0.0) << i;  // the plot lies on a slope
    EXPECT_EQ(tree.dbh_m, 2.0 * (stem.section_radius_m + rise * stem.taper)) << i;
  }
}

TEST(Inventory, AFullOneHasCurvesVolumesCrownsAndTheTreeOfEachPoint) {
  TestPlot plot(4);
  plot.slope_x = 0.25;
  plot.add_ground(18.0, 40);
  plot.add_stem({5.0, 9.0, 0.3});
  plot.add_stem({12.0, 9.0, 0.2});
  InventoryConfig config;
  config.stand.species = TaperSpecies::kSpruce;
  const InventoryResult result = take_inventory(blocks_of(plot.cloud), config);
  ASSERT_EQ(result.trees.size(), 2U);
  ASSERT_EQ(result.curves.size(), 2U);
  EXPECT_EQ(result.trees[1].species, "spruce");
  EXPECT_EQ(result.trees[1].quality, "good");
  ASSERT_TRUE(result.owners);
  for (std::size_t i = 0; i < 2; ++i) {
    const Tree& tree = result.trees[i];
    const CurveSection& section = result.curves[i].sections.at(30);  // 3 m
    EXPECT_TRUE(section.measured);
    EXPECT_NEAR(section.diameter_m, tree.dbh_m - 2.0 * 0.008 * 1.7, 0.012);
    EXPECT_NEAR(result.curves[i].measured_to_m, 4.0, 0.6);
    EXPECT_EQ(tree.stem_volume_m3, result.curves[i].volume_m3);
    // Between a cone and a cylinder of the tree.
    const double cylinder = 0.25 * M_PI * tree.dbh_m * tree.dbh_m * tree.height_m;
    EXPECT_GT(tree.stem_volume_m3, 0.3 * cylinder);
    EXPECT_LT(tree.stem_volume_m3, 0.8 * cylinder);
    EXPECT_NEAR(tree.crown_base_m, 4.0, 1.1);
    EXPECT_GT(tree.crown_area_m2, 1.0);
    EXPECT_LT(tree.crown_area_m2, 13.0);
    ASSERT_GT(result.crown_outlines.at(i).size(), 4U);
    EXPECT_NEAR(signed_area_m2(result.crown_outlines[i]), tree.crown_area_m2, 1e-9);
    for (const Eigen::Vector2d& corner : result.crown_outlines[i])
      EXPECT_LT((corner - Eigen::Vector2d(tree.x, tree.y)).norm(), 3.0) << "in the world frame";
    const double ground = plot.ground(tree.x, tree.y);
    EXPECT_EQ(tree_at(result, {tree.x + 0.5 * tree.dbh_m, tree.y, ground + 2.0}, 2.0),
              static_cast<std::uint32_t>(tree.id));
    EXPECT_EQ(tree_at(result, {tree.x, tree.y, ground + 0.05}, 0.05), 0U) << "ground";
  }
  EXPECT_EQ(tree_at(result, {8.5, 3.0, plot.ground(8.5, 3.0) + 2.0}, 2.0), 0U);
}

TEST(Inventory, OutlinesOfCrownsAreInTheFrameOfTheCloud) {
  TestPlot plot(4);
  plot.add_ground(18.0, 40);
  plot.add_stem({5.0, 9.0, 0.3});
  for (Eigen::Vector3d& point : plot.cloud)
    point += Eigen::Vector3d(1000.0, 2000.0, 0.0);
  const InventoryResult result = take_inventory(blocks_of(plot.cloud), {});
  ASSERT_EQ(result.crown_outlines.size(), 1U);
  ASSERT_GT(result.crown_outlines[0].size(), 4U);
  for (const Eigen::Vector2d& corner : result.crown_outlines[0])
    EXPECT_LT((corner - Eigen::Vector2d(1005.0, 2009.0)).norm(), 3.0);
}

// Two trees whose crowns touch: on a sheet the points of the other one are marked.
TEST(Inventory, SheetsShowTheTreesAndWhatIsNotTheirOwn) {
  TestPlot plot(4);
  plot.add_ground(18.0, 40);
  plot.add_stem({8.0, 9.0, 0.3});
  plot.add_stem({9.8, 9.0, 0.2});
  const InventoryResult result = take_inventory(blocks_of(plot.cloud), {});
  ASSERT_EQ(result.sheets.size(), 2U);
  EXPECT_TRUE(result.look_again.empty()) << "both diameters are sure";
  for (std::size_t i = 0; i < 2; ++i) {
    const TreeSheet& sheet = result.sheets[i];
    ASSERT_EQ(sheet.tree, i);
    EXPECT_EQ(sheet.seen.count(), 36U);
    float top = 0.0F;
    int strangers = 0;
    for (const TreeSheet::FrontPoint& point : sheet.front) {
      top = std::max(top, point.place.z());
      strangers += point.own ? 0 : 1;
      EXPECT_LT(point.place.head<2>().norm(), 2.0F);
      if (!point.stem || point.place.z() >= 3.0F) continue;
      EXPECT_NEAR(static_cast<double>(point.place.head<2>().norm()), result.stems[i].radius_m,
                  0.08);
    }
    EXPECT_NEAR(static_cast<double>(top), result.trees[i].height_m, 1.0);
    EXPECT_LT(strangers, static_cast<int>(sheet.front.size()) / 2);
    ASSERT_GT(sheet.section.size(), 100U);
    for (const Eigen::Vector2f& point : sheet.section)
      EXPECT_NEAR(static_cast<double>(point.norm()), result.stems[i].radius_m, 0.06);
  }
}

// Beside a path the ground has a hundred times the points of a crown; the canopy model had holes
// over such trees.
TEST(Inventory, ACrownOverAGroundSeenMuchMoreIsPartOfTheCanopy) {
  TestPlot plot(4);
  plot.add_ground(12.0, 40);
  plot.add_stem({6.0, 6.0, 0.3});
  plot.add_ground_at(6.0, 6.0, 2.0, 60'000);
  const InventoryResult result = take_inventory(blocks_of(plot.cloud), basic_inventory());
  ASSERT_EQ(result.trees.size(), 1U);
  const Raster& canopy = result.canopy;
  float highest = 0.0F;
  for (int row = 0; row < canopy.rows; ++row) {
    for (int column = 0; column < canopy.columns; ++column) {
      const double x = canopy.x0 + (column + 0.5) * canopy.cell_m;
      const double y = canopy.y0 + (row + 0.5) * canopy.cell_m;
      if (std::hypot(x - 6.0, y - 6.0) < 1.0)
        highest = std::max(highest, canopy.values[canopy.index(column, row)]);
    }
  }
  EXPECT_NEAR(highest, result.trees[0].height_m, 0.1);
}

TEST(Inventory, ABasicOneHasNoneOfThat) {
  TestPlot plot(4);
  plot.add_ground(12.0, 40);
  plot.add_stem({6.0, 6.0, 0.3});
  const InventoryResult result = take_inventory(blocks_of(plot.cloud), basic_inventory());
  ASSERT_EQ(result.trees.size(), 1U);
  EXPECT_TRUE(result.curves.empty());
  EXPECT_FALSE(result.owners);
  EXPECT_TRUE(std::isnan(result.trees[0].stem_volume_m3));
  EXPECT_TRUE(std::isnan(result.trees[0].crown_area_m2));
  EXPECT_TRUE(result.crown_outlines.empty());
  EXPECT_EQ(tree_at(result, {6.1, 6.0, 102.0}, 2.0), 0U);
}

TEST(Inventory, StemsOfAnInventoryAreItsTreesAsOneView) {
  TestPlot plot(4);
  plot.slope_x = 0.25;
  plot.add_ground(24.0, 40);
  TestPlot::Stem stem{12.0, 9.0, 0.3};
  stem.lean_x = 0.05;
  plot.add_stem(stem);
  const InventoryResult result = take_inventory(blocks_of(plot.cloud), {});
  ASSERT_EQ(result.trees.size(), 1U);
  const Eigen::Vector3d origin(10.0, 10.0, -1.0);
  const std::vector<Stem> stems = stems_of(result, origin);
  ASSERT_EQ(stems.size(), 1U);
  EXPECT_NEAR(stems[0].point.x(), 12.0 - origin.x(), 0.02);
  EXPECT_NEAR(stems[0].point.y(), 9.0 - origin.y(), 0.02);
  EXPECT_NEAR(stems[0].point.z(), plot.ground(12.0, 9.0) - origin.z(), 0.06);
  EXPECT_NEAR(stems[0].axis.x() / stems[0].axis.z(), 0.05, 0.01);
  EXPECT_NEAR(stems[0].axis.norm(), 1.0, 1e-6);
  EXPECT_NEAR(stems[0].dbh_m, 0.3, 0.012);
  EXPECT_GT(stems[0].xx, 0.0);
  EXPECT_TRUE(std::isnan(stems[0].zz));
}

TEST(Inventory, StemsSeenFromOneSideKeepTheirDiameter) {
  TestPlot plot(5);
  plot.add_ground(20.0, 40);
  for (int i = 0; i < 9; ++i) {
    TestPlot::Stem stem{3.0 + 6.0 * (i % 3), 3.0 + 6.0 * (i / 3), 0.2 + 0.03 * i};
    stem.arc_deg = 150.0;
    plot.add_stem(stem);
  }
  const InventoryResult result = take_inventory(blocks_of(plot.cloud), {});
  EXPECT_EQ(result.trees.size(), 9U);
  for (int i = 0; i < 9; ++i) {
    const Tree* tree = nearest(result.trees, 3.0 + 6.0 * (i % 3), 3.0 + 6.0 * (i / 3));
    ASSERT_NE(tree, nullptr) << i;
    EXPECT_NEAR(tree->dbh_m, 0.2 + 0.03 * i, 0.03);
  }
}

TEST(Inventory, BushesAreNoTrees) {
  TestPlot plot(6);
  plot.add_ground(20.0, 40);
  for (int i = 0; i < 16; ++i)
    plot.add_bush(2.0 + 5.0 * (i % 4), 2.0 + 5.0 * (i / 4), 0.6 + 0.1 * (i % 5), 3000);
  EXPECT_TRUE(take_inventory(blocks_of(plot.cloud), {}).trees.empty());
}

TEST(Inventory, AStemInABushIsFound) {
  TestPlot plot(7);
  plot.add_ground(12.0, 40);
  plot.add_stem({6.0, 6.0, 0.3});
  plot.add_bush(6.5, 6.0, 0.7, 800);
  const InventoryResult result = take_inventory(blocks_of(plot.cloud), {});
  ASSERT_EQ(result.trees.size(), 1U);
  EXPECT_NEAR(result.trees[0].dbh_m, 0.3, 0.03);
}

TEST(Inventory, FewReturnsAreEnoughForAFreeStem) {
  TestPlot plot(8);
  plot.add_ground(16.0, 40);
  for (int i = 0; i < 4; ++i) {
    TestPlot::Stem stem{4.0 + 8.0 * (i % 2), 4.0 + 8.0 * (i / 2), 0.3};
    stem.points = 80;  // about 60 of them in the searched layer
    plot.add_stem(stem);
  }
  EXPECT_EQ(take_inventory(blocks_of(plot.cloud), {}).trees.size(), 4U);
}

TEST(Inventory, AHeightDoesNotReachOverAGapOfSky) {
  TestPlot plot(14);
  plot.add_ground(20.0, 40);
  plot.add_stem({6.0, 6.0, 0.3});
  plot.add_stem({14.0, 14.0, 0.3});
  for (int i = 0; i < 40; ++i) {
    plot.cloud.emplace_back(6.0 + 0.01 * i, 6.0,
                            plot.ground(6.0, 6.0) + 24.0 + 0.02 * i);  // a bird
    plot.cloud.emplace_back(14.0 + 0.01 * i, 14.0, plot.ground(14.0, 14.0) + 17.2 + 0.02 * i);
  }
  const InventoryResult result = take_inventory(blocks_of(plot.cloud), {});
  const Tree* below_a_bird = nearest(result.trees, 6.0, 6.0);
  const Tree* loose_top = nearest(result.trees, 14.0, 14.0);
  ASSERT_NE(below_a_bird, nullptr);
  ASSERT_NE(loose_top, nullptr);
  EXPECT_NEAR(below_a_bird->height_m, 15.0, 0.3);
  EXPECT_NEAR(loose_top->height_m, 18.0, 0.3);
}

// Defect: ghosts of other pulses over a path where a sleigh had stood made trees 14 m too high.
TEST(Inventory, GhostsInTheSkyAreNoTops) {
  TestPlot plot(17);
  plot.add_ground(20.0, 40);
  plot.add_stem({6.0, 6.0, 0.3});
  plot.add_stem({14.0, 14.0, 0.3});
  Random random(18);
  for (int i = 0; i < 2000; ++i) {
    const double side = i % 2 == 0 ? 6.0 : 14.0;
    plot.cloud.emplace_back(side + random.normal(0.0, 0.6), side + random.normal(0.0, 0.6),
                            100.0 + random.uniform(4.0, 15.0));
  }
  for (int i = 0; i < 3000; ++i) {  // denser near the ground, as near a scanner
    const double up = 40.0 * random.uniform(0.0, 1.0) * random.uniform(0.0, 1.0);
    plot.cloud.emplace_back(random.uniform(0.0, 20.0), random.uniform(0.0, 20.0), 100.0 + up);
  }
  const InventoryResult result = take_inventory(blocks_of(plot.cloud), {});
  ASSERT_EQ(result.trees.size(), 2U);
  for (const Tree& tree : result.trees)
    EXPECT_NEAR(tree.height_m, 15.0, 1.2);
  // Of the canopy the same: open ground stays open.
  EXPECT_NEAR(result.canopy.cell_value(6.2, 6.2), 14.0, 2.0);
  int above = 0;
  int cells = 0;
  for (double x = 9.0; x < 12.0; x += 0.5) {
    for (double y = 1.0; y < 19.0; y += 0.5) {
      ++cells;
      above += result.canopy.cell_value(x, y) > 2.0 ? 1 : 0;
    }
  }
  EXPECT_LT(above, cells / 10);
}

TEST(Inventory, ATreeThatMayGoOnAboveTheViewHasNoHeight) {
  TestPlot plot(19);
  plot.add_ground(20.0, 40);
  plot.add_stem({6.0, 6.0, 0.3});
  plot.add_stem({14.0, 14.0, 0.3});
  // To the left of x = 10 the scanner saw no higher than 15.5 m.
  const Lookouts lookouts = [&](const Eigen::Vector3d& place) {
    const bool seen = place.x() > 10.0 || place.z() < plot.ground(place.x(), place.y()) + 15.5;
    return std::vector<Eigen::Vector3d>(seen ? 1 : 0, {18.0, 10.0, 101.0});
  };
  const InventoryResult result = take_inventory(blocks_of(plot.cloud), {}, {}, lookouts);
  const Tree* cut = nearest(result.trees, 6.0, 6.0);
  const Tree* seen = nearest(result.trees, 14.0, 14.0);
  ASSERT_NE(cut, nullptr);
  ASSERT_NE(seen, nullptr);
  EXPECT_TRUE(std::isnan(cut->height_m)) << cut->height_m;
  EXPECT_NEAR(seen->height_m, 15.0, 0.3);
  EXPECT_TRUE(std::isnan(cut->height_is_lower_bound));
  EXPECT_EQ(seen->height_is_lower_bound, 0.0);
  EXPECT_GT(seen->height_sd_m, 0.0);
  ASSERT_FALSE(result.remarks.empty());
  EXPECT_NE(result.remarks.back().find("1 of 2 trees have no height"), std::string::npos)
      << result.remarks.back();
}

// What fills the gap in the terrain under the first tree may be off, and so is its height.
TEST(Inventory, AHeightIsLessSureWhereTheGroundAtItsFootWasNotSeen) {
  TestPlot plot(33);
  plot.bump_m = 0.8;
  plot.add_ground(20.0, 40);
  plot.add_stem({5.0, 5.0, 0.3});
  plot.add_stem({14.0, 14.0, 0.3});
  std::erase_if(plot.cloud, [&](const Eigen::Vector3d& point) {
    return (point.head<2>() - Eigen::Vector2d(5.0, 5.0)).norm() < 3.0 &&
           point.z() < plot.ground(point.x(), point.y()) + 0.8;
  });
  const InventoryResult result = take_inventory(blocks_of(plot.cloud), {});
  const Tree* hidden = nearest(result.trees, 5.0, 5.0);
  const Tree* open = nearest(result.trees, 14.0, 14.0);
  ASSERT_NE(hidden, nullptr);
  ASSERT_NE(open, nullptr);
  EXPECT_GT(hidden->height_sd_m, 1.02 * open->height_sd_m);
}

// Five eighths of a stem are seen, from afar: its diameter is uncertain, and that it stands is not.
TEST(Inventory, AThinStemSeenInPartIsListed) {
  for (const int points : {700, 2500}) {
    for (const std::uint64_t seed : {1, 2}) {
      TestPlot plot(16);
      plot.add_ground(12.0, 40);
      Random random(seed);
      for (int i = 0; i < points; ++i) {
        const double x = random.uniform(-0.06, 0.015);
        const double h = random.uniform(0.4, 4.0);
        const double y = -std::sqrt(0.0036 - x * x) + random.normal(0.0, 0.01);
        plot.cloud.emplace_back(6.0 + x + random.normal(0.0, 0.005), 6.0 + y,
                                plot.ground(6.0, 6.0) + h);
      }
      const std::vector<Tree> trees = take_inventory(blocks_of(plot.cloud), {}).trees;
      ASSERT_EQ(trees.size(), 1U) << points << " " << seed;
      EXPECT_NEAR(trees[0].dbh_m, 0.12, 0.05);
    }
  }
}

// A noisy stem from afar: each sweep shows a few pieces of it, and none shows the same.
TEST(Inventory, AStemSeenInPiecesFromAfarIsListed) {
  for (const std::uint64_t seed : {1, 2, 3, 4}) {
    TestPlot plot(16);
    plot.add_ground(12.0, 40);
    Random random(seed);
    for (int piece = 0; piece < 60; ++piece) {
      const double turn = random.uniform(-50.0, 50.0) * M_PI / 180.0;
      const double h = random.uniform(0.4, 4.0);
      for (int i = 0; i < 20; ++i) {
        const double at = turn + random.uniform(-0.15, 0.15);
        const double r = 0.06 + random.normal(0.0, 0.01);
        plot.cloud.emplace_back(6.0 + r * std::cos(at), 6.0 + r * std::sin(at),
                                plot.ground(6.0, 6.0) + h + random.uniform(0.0, 0.1));
      }
    }
    const std::vector<Tree> trees = take_inventory(blocks_of(plot.cloud), {}).trees;
    ASSERT_EQ(trees.size(), 1U) << seed;
    EXPECT_NEAR(trees[0].dbh_m, 0.12, 0.05) << seed;
  }
}

TEST(Inventory, AnAirborneCloudSaysThatStemsAreNotSeen) {
  TestPlot plot(9);
  plot.add_ground(20.0, 4);
  Random random(9);
  for (int i = 0; i < 4000; ++i)
    plot.cloud.emplace_back(random.uniform(0, 20), random.uniform(0, 20), random.uniform(108, 120));
  InventoryConfig by_stems;
  by_stems.crowns.search = CrownSearch::kNever;
  const InventoryResult result = take_inventory(blocks_of(plot.cloud), by_stems);
  EXPECT_TRUE(result.trees.empty());
  EXPECT_TRUE(result.too_sparse);
  EXPECT_TRUE(result.from_above);
  EXPECT_FALSE(result.remarks.empty());
}

// A short walk sees much of the crowns, and few returns a square metre near breast height.
TEST(Inventory, AScannerBelowTheCanopyDoesNotSeeItFromAbove) {
  TestPlot plot(9);
  plot.add_ground(20.0, 4);
  Random random(9);
  for (int i = 0; i < 4000; ++i) {
    const double x = random.uniform(0, 20);
    const double y = random.uniform(0, 20);
    plot.cloud.emplace_back(x, y, plot.ground(x, y) + random.uniform(8, 20));
  }
  const auto seen_from = [&](double height_m) {
    std::vector<Eigen::Vector3d> scanner;
    for (int i = 0; i < 10; ++i)
      scanner.emplace_back(5.0 + i, 10.0, plot.ground(5.0 + i, 10.0) + height_m);
    return take_inventory(blocks_of(plot.cloud), {}, {}, {}, scanner);
  };
  const InventoryResult walk = seen_from(1.5);
  EXPECT_TRUE(walk.too_sparse);
  EXPECT_FALSE(walk.from_above);
  EXPECT_TRUE(walk.trees.empty());
  const InventoryResult flight = seen_from(60.0);
  EXPECT_TRUE(flight.from_above);
  EXPECT_FALSE(flight.trees.empty());
}

TEST(Inventory, AnAirborneCloudHasTreesByTheirCrowns) {
  TestPlot plot(9);
  plot.add_ground(20.0, 4);
  Random random(10);
  const std::vector<Eigen::Vector2d> places = {{5.0, 6.0}, {13.0, 12.0}};
  for (const Eigen::Vector2d& place : places) {
    for (int i = 0; i < 2000; ++i) {  // a cone of 3 m at 8 m above the ground, 16 m high
      const double r = 3.0 * std::sqrt(random.uniform());
      const double turn = 2.0 * M_PI * random.uniform();
      const double x = place.x() + r * std::cos(turn);
      const double y = place.y() + r * std::sin(turn);
      plot.cloud.emplace_back(x, y, plot.ground(place.x(), place.y()) + 16.0 - 8.0 * r / 3.0);
    }
  }
  const InventoryResult result = take_inventory(blocks_of(plot.cloud), {});
  ASSERT_EQ(result.trees.size(), 2U);
  EXPECT_TRUE(result.thin.corners.empty()) << "no stem is missed where none is looked for";
  EXPECT_TRUE(result.stems.empty());
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Tree& tree = result.trees[i];
    EXPECT_LT((Eigen::Vector2d(tree.x, tree.y) - places[i]).norm(), 0.4);
    EXPECT_NEAR(tree.height_m, 16.0, 0.5);
    EXPECT_NEAR(tree.crown_area_m2, M_PI * 9.0, 4.0);
    EXPECT_TRUE(std::isnan(tree.dbh_m));
    EXPECT_EQ(tree.quality, "no_diameter");
    EXPECT_EQ(tree.species, "");
    const Eigen::Vector3d in_crown(places[i].x() + 1.0, places[i].y(), tree.z + 12.0);
    EXPECT_EQ(tree_at(result, in_crown, 12.0), static_cast<std::uint32_t>(tree.id));
    EXPECT_EQ(tree_at(result, in_crown, 1.0), 0U) << "what is low below a crown may be undergrowth";
  }
}

TEST(Inventory, ThreadsDoNotChangeAnything) {
  TestPlot plot(10);
  plot.add_ground(16.0, 40);
  for (int i = 0; i < 9; ++i)
    plot.add_stem({3.0 + 5.0 * (i % 3), 3.0 + 5.0 * (i / 3), 0.15 + 0.04 * i});
  plot.add_bush(5.5, 5.5, 1.2, 4000);
  std::vector<InventoryResult> results(2);
  for (int threads = 1; threads <= 2; ++threads) {
    with_threads(threads, [&] {
      results[static_cast<std::size_t>(threads - 1)] = take_inventory(blocks_of(plot.cloud), {});
    });
  }
  ASSERT_EQ(results[0].trees.size(), results[1].trees.size());
  for (std::size_t i = 0; i < results[0].trees.size(); ++i) {
    EXPECT_EQ(results[0].trees[i].x, results[1].trees[i].x);
    EXPECT_EQ(results[0].trees[i].dbh_m, results[1].trees[i].dbh_m);
  }
  const std::vector<float>& a = results[0].ground.terrain.values;
  const std::vector<float>& b = results[1].ground.terrain.values;
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i)
    EXPECT_TRUE(a[i] == b[i] || (std::isnan(a[i]) && std::isnan(b[i])));
}

}  // namespace
}  // namespace understory
