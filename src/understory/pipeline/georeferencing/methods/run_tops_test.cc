#include "understory/pipeline/georeferencing/methods/run_tops.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/output/layers/geo_files.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

constexpr double kGround = 140.0;

// A raster of 40 x 30 m, cells of 0.25 m.
template <typename Height>
Raster raster_of_heights(Height height) {
  Raster raster;
  raster.x0 = 500.0;
  raster.y0 = -20.0;
  raster.cell_m = 0.25;
  raster.columns = 160;
  raster.rows = 120;
  for (int row = 0; row < raster.rows; ++row) {
    for (int column = 0; column < raster.columns; ++column)
      raster.values.push_back(static_cast<float>(height(raster.x0 + (column + 0.5) * raster.cell_m,
                                                        raster.y0 + (row + 0.5) * raster.cell_m)));
  }
  return raster;
}

// Two cones, 18 and 12 m tall.
double crowns(double x, double y) {
  return std::max({0.0, 18.0 - 3.0 * std::hypot(x - 510.1, y + 4.0),
                   12.0 - 3.0 * std::hypot(x - 525.0, y - 3.2)});
}

TEST(RunTops, AreThoseOfTheCanopyInTheWorldFrame) {
  const test::TemporaryFolder folder;
  write_geotiff(folder / "chm.tif", raster_of_heights(crowns), "");
  write_geotiff(folder / "dtm.tif",
                raster_of_heights([](double x, double) { return kGround + 0.1 * (x - 500.0); }),
                "");
  MovableRun run;
  const Pose layer_from_world(so3_exp({0.0, 0.0, 0.7}), {480.0, 10.0, 100.0});
  run.layers = std::make_shared<LayerFrame>(layer_from_world);
  const std::vector<Tree> tops = tops_of_run(folder / "", run);
  ASSERT_EQ(tops.size(), 2U);
  const Eigen::Vector3d first = layer_from_world * Eigen::Vector3d(tops[0].x, tops[0].y, tops[0].z);
  EXPECT_NEAR(first.x(), 510.1, 0.1);
  EXPECT_NEAR(first.y(), -4.0, 0.1);
  EXPECT_NEAR(first.z(), kGround + 1.01, 0.05);
  EXPECT_NEAR(tops[0].height_m, 18.0, 0.6);
  EXPECT_NEAR(tops[1].height_m, 12.0, 0.6);
}

TEST(RunTops, NeedNoTerrainButACanopy) {
  const test::TemporaryFolder folder;
  const MovableRun run;
  EXPECT_TRUE(tops_of_run(folder / "", run).empty());
  write_geotiff(folder / "chm.tif", raster_of_heights(crowns), "");
  const std::vector<Tree> tops = tops_of_run(folder / "", run);
  ASSERT_EQ(tops.size(), 2U);
  EXPECT_TRUE(std::isnan(tops[0].z));
  EXPECT_NEAR(tops[0].x, 510.1, 0.1);
}

Tree tree_at(double x, double height_m) {
  Tree tree;
  tree.x = x;
  tree.y = 3.0;
  tree.height_m = height_m;
  return tree;
}

TEST(RunTops, TreesBelowTheCrownsOfOthersHaveNone) {
  // Below a neighbour; hardly lower; far enough away; of no known height beside a high one.
  std::vector<Tree> trees = {tree_at(0.0, 18.0),  tree_at(2.0, 9.0),  tree_at(-2.0, 17.0),
                             tree_at(10.0, 18.0), tree_at(12.6, 9.0), tree_at(30.0, Tree::kUnknown),
                             tree_at(31.0, 18.0)};
  // A wide map, whose grid is coarse.
  trees.push_back(tree_at(60.0, 18.0));
  trees.back().y = 70.0;
  const std::vector<Tree> kept = without_overtopped(trees);
  ASSERT_EQ(kept.size(), 7U);
  for (const Tree& tree : kept)
    EXPECT_NE(tree.x, 2.0);
  EXPECT_TRUE(without_overtopped({}).empty());
}

}  // namespace
}  // namespace understory
