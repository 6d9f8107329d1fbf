#include "understory/pipeline/inventory/stand_plots.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/util/error.h"

namespace understory {
namespace {

// A slope of 0.75 along x, 60 by 60 m, seen west of x = 45, with a tree every 2 m.
InventoryResult slope() {
  InventoryResult inventory;
  Raster& terrain = inventory.ground.terrain;
  terrain.columns = terrain.rows = 60;
  for (int row = 0; row < 60; ++row) {
    for (int column = 0; column < 60; ++column)
      terrain.values.push_back(0.75F * static_cast<float>(column));
  }
  inventory.seen.columns = inventory.seen.rows = 240;
  for (int row = 0; row < 240; ++row) {
    for (int column = 0; column < 240; ++column)
      inventory.seen.halves.push_back(column < 180 ? 2 : 0);
  }
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 22; ++x) {
      Tree tree;
      tree.x = 1.0 + 2.0 * x;
      tree.y = 1.0 + 2.0 * y;
      tree.dbh_m = 0.2;
      tree.dbh_sd_m = 0.01;
      inventory.trees.push_back(tree);
    }
  }
  return inventory;
}

PlotOutline circle(const std::string& id, double x, double y, double radius_m) {
  return {id, {x, y}, radius_m, {}};
}

TEST(StandPlots, CirclesGridAndWholeHaveTheDensityOfTheStand) {
  StandTableConfig config;
  config.grid_m = 20.0;
  const LayerFrame world;
  const StandResult result = take_stand(slope(), config, {circle("A", 20, 30, 15)}, world);
  EXPECT_NEAR(result.table.seen.stems_per_ha.value, 2'500.0 * 22.0 / 22.5, 1.0);
  ASSERT_EQ(result.table.plots.size(), 1U + 9U);
  EXPECT_NEAR(result.table.plots[0].figures.stems_per_ha.value, 2'500.0, 100.0);
  EXPECT_EQ(result.table.plots[1].shape.kind, "cell");
  EXPECT_EQ(result.table.plots[1].shape.id, "0_0");
  EXPECT_NEAR(result.table.plots[1].figures.stems_per_ha.value, 2'500.0, 1e-6);
  EXPECT_NEAR(result.table.plots[3].figures.seen_share, 0.25, 1e-9);
  EXPECT_TRUE(std::isnan(result.table.plots[3].figures.stems_per_ha.value));
  EXPECT_TRUE(result.remarks.empty());
  EXPECT_TRUE(result.complaint.empty()) << "cells at the border are nobody's mistake";
}

TEST(StandPlots, ARadiusAlongTheGroundCoversLess) {
  StandTableConfig config;
  config.radius = PlotRadius::kSlope;
  const LayerFrame world;
  const StandResult result = take_stand(slope(), config, {circle("A", 20, 30, 10)}, world);
  EXPECT_NEAR(result.table.plots[0].figures.area_m2, M_PI * 100.0 * 0.8, 0.5);
}

TEST(StandPlots, PlotsBeyondWhatWasSeenAreTold) {
  const LayerFrame world;
  const StandResult part =
      take_stand(slope(), {}, {circle("A", 20, 30, 9), circle("B", 42, 30, 9)}, world);
  ASSERT_EQ(part.remarks.size(), 1U);
  EXPECT_NE(part.remarks[0].find("% of plot B)"), std::string::npos) << part.remarks[0];
  EXPECT_TRUE(part.complaint.empty());
  const StandResult little = take_stand(slope(), {}, {circle("C", 50, 30, 9)}, world);
  EXPECT_NE(little.complaint.find("1 plot has no figures"), std::string::npos);
  // Bug: the range was that of the grid of cells, also where nothing was seen: x 0 to 60.
  EXPECT_NE(little.complaint.find("Stems were seen at x 0 to 45, y 0 to 60"), std::string::npos)
      << little.complaint;
}

// A plot in the wrong frame: the message says where it would have to lie, in the layers' own.
TEST(StandPlots, WhereStemsWereSeenIsToldInTheFrameOfTheLayers) {
  const LayerFrame moved(
      Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(400'000.0, 6'800'000.0, 0.0)));
  const StandResult far = take_stand(slope(), {}, {circle("D", 20, 30, 9)}, moved);
  EXPECT_NE(far.complaint.find("(0 % of plot D)"), std::string::npos) << far.complaint;
  EXPECT_NE(far.complaint.find("x 400000 to"), std::string::npos) << far.complaint;
  EXPECT_NE(far.complaint.find("y 6800000 to"), std::string::npos) << far.complaint;
}

TEST(StandPlots, ThoseOfAnotherPlaceAreRefusedBeforeTheWork) {
  const auto said = [](const std::vector<PlotOutline>& plots) {
    try {
      refuse_plots_outside({}, plots, {10.0, 20.0}, {40.0, 60.0});
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(said({}), "");
  EXPECT_EQ(said({circle("A", 5, 30, 9)}), "");
  EXPECT_EQ(said({circle("A", 500, 30, 9), circle("B", 20, 30, 9)}), "");
  EXPECT_EQ(said({{"C", {}, 0.0, {{{0, 0}, {100, 0}, {100, 100}}}}}), "");
  EXPECT_NE(said({circle("A", 500, 30, 9)}).find("y 20 to 60: the plot lies outside of it"),
            std::string::npos);
  EXPECT_NE(said({circle("A", 500, 30, 9), {"C", {}, 0.0, {{{0, 0}, {9, 0}, {9, 9}}}}})
                .find("all 2 plots lie outside of it"),
            std::string::npos);
}

TEST(StandPlots, AreDrawnInTheFrameOfTheLayers) {
  const LayerFrame turned(Pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ())),
                               Eigen::Vector3d(1'000.0, 2'000.0, 0.0)));
  const Eigen::Vector3d centre = turned.from_world({20.0, 30.0, 0.0});
  const StandResult result =
      take_stand(slope(), {}, {circle("A", centre.x(), centre.y(), 9)}, turned);
  const StandPlot& plot = result.table.plots.at(0);
  EXPECT_NEAR(plot.shape.centre.x(), 20.0, 1e-6);
  EXPECT_NEAR(plot.shape.centre.y(), 30.0, 1e-6);
  for (const Eigen::Vector2d& point : plot.drawn.at(0))
    EXPECT_NEAR((point - centre.head<2>()).norm(), 9.0, 0.01);
}

}  // namespace
}  // namespace understory
