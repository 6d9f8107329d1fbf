#include "understory/forest/stand/stand_figures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

#include "understory/forest/stand_figure_constants.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using Eigen::Vector2d;
using forest_constants::stand_errors::kSharedDiameter;

// A square from the origin, of which the part west of `seen_to_m` was seen.
VisibleArea square_of(double side_m, double seen_to_m) {
  VisibleArea area;
  area.columns = static_cast<int>(side_m / area.cell_m);
  area.rows = area.columns;
  for (int row = 0; row < area.rows; ++row) {
    for (int column = 0; column < area.columns; ++column)
      area.halves.push_back((column + 0.5) * area.cell_m < seen_to_m ? 2 : 0);
  }
  return area;
}

Tree tree_at(double x, double y, double dbh_m, double height_m) {
  Tree tree;
  tree.x = x;
  tree.y = y;
  tree.dbh_m = dbh_m;
  tree.dbh_sd_m = 0.0;
  tree.x_sd_m = 0.0;
  tree.y_sd_m = 0.0;
  tree.height_m = height_m;
  tree.stem_volume_m3 = 0.45 * 0.25 * M_PI * dbh_m * dbh_m * height_m;
  tree.stem_volume_sd_m3 = 0.0;
  return tree;
}

double curve_height(double dbh_m) {
  return 1.3 + std::pow(dbh_m / (0.012 + 0.19 * dbh_m), 2);
}

std::vector<Tree> stand_of(Random& random, double side_m, double per_ha) {
  std::vector<Tree> trees;
  const auto count = static_cast<int>(per_ha * side_m * side_m / 1e4);
  for (int i = 0; i < count; ++i) {
    const double dbh = random.uniform(0.08, 0.36);
    trees.push_back(tree_at(random.uniform(0.0, side_m), random.uniform(0.0, side_m), dbh,
                            curve_height(dbh) + random.normal(0.0, 1.2)));
  }
  return trees;
}

TEST(StandFigures, OfAPlotByHand) {
  // Three trees on a circle of 10 m, and one outside of it.
  std::vector<Tree> trees = {tree_at(20, 20, 0.10, 10), tree_at(22, 20, 0.20, 16),
                             tree_at(20, 25, 0.30, 22), tree_at(35, 20, 0.50, 30)};
  const PlotShape plot = circle_plot("a", {20, 20}, 10.0);
  const StandFigures figures =
      stand_figures(stand_trees(trees, {}), square_of(40.0, 40.0), plot, {});
  const double ha = M_PI * 100.0 / 1e4;
  EXPECT_EQ(figures.trees, 3U);
  EXPECT_NEAR(figures.seen_share, 1.0, 1e-9);
  EXPECT_NEAR(figures.stems_per_ha.value, 3.0 / ha, 1e-6);
  EXPECT_NEAR(figures.basal_area_m2_per_ha.value, 0.25 * M_PI * 0.14 / ha, 1e-6);
  EXPECT_NEAR(figures.mean_dbh_m.value, std::sqrt(0.14 / 3.0), 1e-9);
  EXPECT_NEAR(figures.weighted_dbh_m.value, (0.001 + 0.008 + 0.027) / 0.14, 1e-9);
  EXPECT_NEAR(figures.weighted_height_m.value, (0.1 + 16 * 0.04 + 22 * 0.09) / 0.14, 1e-9);
  EXPECT_NEAR(figures.dominant_trees, M_PI, 1e-6);
  EXPECT_TRUE(std::isnan(figures.dominant_height_m.value)) << "three trees for 3.14";
  EXPECT_NEAR(figures.volume_m3_per_ha.value,
              0.45 * 0.25 * M_PI * (0.01 * 10 + 0.04 * 16 + 0.09 * 22) / ha, 1e-6);
  EXPECT_TRUE(std::isnan(figures.national_m3_per_ha.value));
  EXPECT_EQ(figures.stems_per_ha.sd, 0.0);
  ASSERT_EQ(figures.classes.size(), 14U);  // 4 to 6 cm, ..., 30 to 32 cm
  EXPECT_NEAR(figures.classes[3].from_m, 0.10, 1e-12);
  EXPECT_EQ(figures.classes[3].trees, 1U);
  EXPECT_EQ(figures.classes[13].trees, 1U);
  EXPECT_NEAR(figures.classes[8].stems_per_ha.value, 1.0 / ha, 1e-6);
}

TEST(StandFigures, WithoutACurveHeightsAndVolumesAreLowerBounds) {
  std::vector<Tree> trees = {tree_at(20, 20, 0.10, 10), tree_at(22, 20, 0.20, 16),
                             tree_at(20, 25, 0.30, 22)};
  trees[2].height_is_lower_bound = 1.0;
  const PlotShape plot = circle_plot("a", {20, 20}, 10.0);
  const StandFigures figures =
      stand_figures(stand_trees(trees, {}), square_of(40.0, 40.0), plot, {});
  EXPECT_EQ(figures.heights_lower_bounds, 1U);
  EXPECT_EQ(figures.heights_filled_in, 0U);
  EXPECT_NEAR(figures.weighted_height_m.value, (0.1 + 16 * 0.04 + 22 * 0.09) / 0.14, 1e-9);
  EXPECT_TRUE(std::isfinite(figures.volume_m3_per_ha.value));
}

// Trees by the curve are all off by its error: more of them do not make their mean surer.
TEST(StandFigures, TheErrorOfTheCurveIsShared) {
  Random random(12);
  std::vector<Tree> trees = stand_of(random, 40.0, 900.0);
  const PlotShape plot = circle_plot("a", {20, 20}, 18.0);
  for (std::size_t i = 12; i < trees.size(); ++i)
    trees[i].height_m = NAN;
  for (std::size_t i = 0; i < 12; ++i)
    trees[i].height_m += random.normal(0.0, 2.0);
  const StandTrees stand = stand_trees(trees, {});
  ASSERT_TRUE(stand.curve);
  const StandFigures figures = stand_figures(stand, square_of(40.0, 40.0), plot, {});
  EXPECT_GT(figures.weighted_height_m.sd,
            0.9 * stand.curve->own_sd_at(figures.weighted_dbh_m.value));
}

TEST(StandFigures, DominantHeightIsThatOfTheThickestOfTheHectare) {
  Random random(9);
  const std::vector<Tree> trees = stand_of(random, 40.0, 900.0);
  PlotShape plot;
  plot.rings = {{{0, 0}, {40, 0}, {40, 40}, {0, 40}}};
  const StandFigures figures =
      stand_figures(stand_trees(trees, {}), square_of(40.0, 40.0), plot, {});
  EXPECT_NEAR(figures.dominant_trees, 16.0, 1e-9);
  std::vector<Tree> sorted = trees;
  std::sort(sorted.begin(), sorted.end(),
            [](const Tree& a, const Tree& b) { return a.dbh_m > b.dbh_m; });
  double mean = 0.0;
  for (int i = 0; i < 16; ++i)
    mean += sorted[static_cast<std::size_t>(i)].height_m / 16.0;
  EXPECT_NEAR(figures.dominant_height_m.value, mean, 1e-9);
}

TEST(StandFigures, AHeightThatWasNotSeenComesFromTheCurveAndAVolumeFromTheForm) {
  std::vector<Tree> trees;
  for (int i = 0; i < 20; ++i) {
    const double dbh = 0.1 + 0.01 * i;
    trees.push_back(tree_at(5.0 + i, 20.0, dbh, curve_height(dbh)));
  }
  const PlotShape all = circle_plot("a", {20, 20}, 19.0);
  const VisibleArea seen = square_of(40.0, 40.0);
  const StandFigures whole = stand_figures(stand_trees(trees, {}), seen, all, {});
  for (const std::size_t i : {3U, 11U, 17U}) {
    trees[i].height_m = NAN;
    trees[i].stem_volume_m3 = NAN;
  }
  // A lower bound is no height.
  trees[6].stem_volume_m3 *= 1.0 - 6.0 / trees[6].height_m;
  trees[6].height_m -= 6.0;
  trees[6].height_is_lower_bound = 1.0;
  const StandFigures filled = stand_figures(stand_trees(trees, {}), seen, all, {});
  EXPECT_EQ(filled.heights_filled_in, 4U);
  EXPECT_EQ(filled.volumes_filled_in, 4U);
  EXPECT_NEAR(filled.volume_m3_per_ha.value, whole.volume_m3_per_ha.value, 1e-6);
  EXPECT_NEAR(filled.weighted_height_m.value, whole.weighted_height_m.value, 1e-9);
  StandTableConfig pine;
  pine.species = TaperSpecies::kPine;
  const StandFigures national = stand_figures(stand_trees(trees, pine), seen, all, {});
  EXPECT_NEAR(national.national_m3_per_ha.value / whole.volume_m3_per_ha.value, 1.1, 0.1);
}

TEST(StandFigures, APlotOfWhichLittleWasSeenHasNone) {
  Random random(2);
  const StandTrees stand = stand_trees(stand_of(random, 40.0, 900.0), {});
  const PlotShape plot = circle_plot("a", {20, 20}, 12.0);
  const StandFigures few = stand_figures(stand, square_of(40.0, 18.0), plot, {});
  EXPECT_LT(few.seen_share, 0.5);
  EXPECT_GT(few.trees, 0U);
  EXPECT_TRUE(std::isnan(few.stems_per_ha.value));
  EXPECT_TRUE(few.classes.empty());
  const StandFigures most = stand_figures(stand, square_of(40.0, 28.0), plot, {});
  EXPECT_NEAR(most.stems_per_ha.value, 900.0, 4.0 * most.stems_per_ha.sd);
  EXPECT_GT(most.stems_per_ha.sd, 20.0) << "a fifth of the plot was not seen";
}

using Pick = std::function<Measured(const StandFigures&)>;
struct Row {
  std::string name;
  Pick pick;
};

// The known model of errors on lists of truth: standard deviations have to be those of the errors.
void expect_calibrated(double seen_to_m, double missed, double rms_low, double rms_high) {
  const std::vector<Row> rows = {
      {"stems", [](const StandFigures& f) { return f.stems_per_ha; }},
      {"basal area", [](const StandFigures& f) { return f.basal_area_m2_per_ha; }},
      {"mean dbh", [](const StandFigures& f) { return f.mean_dbh_m; }},
      {"weighted dbh", [](const StandFigures& f) { return f.weighted_dbh_m; }},
      {"weighted height", [](const StandFigures& f) { return f.weighted_height_m; }},
      {"dominant height", [](const StandFigures& f) { return f.dominant_height_m; }},
      {"volume", [](const StandFigures& f) { return f.volume_m3_per_ha; }},
  };
  std::vector<double> squares(rows.size(), 0.0);
  std::vector<double> means(rows.size(), 0.0);
  constexpr int kPlots = 500;
  const VisibleArea everything = square_of(50.0, 50.0);
  const VisibleArea seen = square_of(50.0, seen_to_m);
  const PlotShape plot = circle_plot("a", {25, 25}, 15.0);
  for (std::uint64_t seed = 1; seed <= kPlots; ++seed) {
    Random random(seed);
    const std::vector<Tree> truth = stand_of(random, 50.0, 900.0);
    std::vector<Tree> listed;
    const double shared_height = random.normal(0.0, 0.3);
    const double shared_dbh = random.normal(0.0, kSharedDiameter);
    for (Tree tree : truth) {
      if (tree.x > seen_to_m || random.chance(missed)) continue;
      tree.x_sd_m = tree.y_sd_m = random.uniform(0.1, 0.4);
      tree.x += random.normal(0.0, tree.x_sd_m);
      tree.y += random.normal(0.0, tree.y_sd_m);
      tree.dbh_sd_m = random.uniform(0.005, 0.03);
      const double by_dbh = shared_dbh * tree.dbh_sd_m;
      tree.stem_volume_m3 *= 1.0 + shared_height / tree.height_m + 2.0 * by_dbh / tree.dbh_m;
      tree.dbh_m += by_dbh + std::sqrt(1.0 - kSharedDiameter * kSharedDiameter) * tree.dbh_sd_m *
                                 random.normal();
      tree.stem_volume_sd_m3 = 0.1 * tree.stem_volume_m3;
      tree.stem_volume_m3 += random.normal(0.0, tree.stem_volume_sd_m3);
      tree.height_m =
          random.chance(0.3) ? NAN : tree.height_m + shared_height + random.normal(0.0, 0.7);
      if (std::isnan(tree.height_m)) tree.stem_volume_m3 = NAN;
      listed.push_back(tree);
    }
    const StandFigures right = stand_figures(stand_trees(truth, {}), everything, plot, {});
    FiguresConfig config;
    config.missed_share = missed;
    const StandFigures figures = stand_figures(stand_trees(listed, {}), seen, plot, config);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const Measured estimate = rows[i].pick(figures);
      double expected = rows[i].pick(right).value;
      const bool total = i == 0 || i == 1 || i == 6;
      if (total) expected *= 1.0 - missed;  // the list is told to lack them, not filled up
      const double z = (estimate.value - expected) / estimate.sd;
      squares[i] += z * z / kPlots;
      means[i] += z / kPlots;
    }
  }
  for (std::size_t i = 0; i < rows.size(); ++i) {
    EXPECT_GT(std::sqrt(squares[i]), rms_low) << rows[i].name;
    EXPECT_LT(std::sqrt(squares[i]), rms_high) << rows[i].name;
    EXPECT_LT(std::abs(means[i]), 0.45) << rows[i].name;
  }
}

TEST(StandFigures, DeviationsAreThoseOfTheErrorsOfMeasurement) {
  expect_calibrated(50.0, 0.0, 0.75, 1.3);
}

TEST(StandFigures, DeviationsHoldWhatWasNotSeenOrMissed) {
  expect_calibrated(30.0, 0.05, 0.75, 1.3);
}

}  // namespace
}  // namespace understory
