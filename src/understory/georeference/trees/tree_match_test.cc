#include "understory/georeference/trees/tree_match.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <numbers>

#include "understory/georeference/trees/forest_test_support.h"
#include "understory/georeference/trees/pattern_fit.h"
#include "understory/georeference/trees/pattern_grid.h"
#include "understory/georeference/trees/place_search.h"
#include "understory/georeference/trees/source_part.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using Eigen::Vector2d;

// A stand and what the air shows of its forest.
struct Scene {
  ForestPlan plan;
  std::vector<Tree> from_air;
  GroundView view;
  TreeSearchArea area;
};

Scene make_scene(std::uint64_t seed, std::size_t trees, ForestPlan plan = {}) {
  Scene scene;
  scene.plan = plan;
  Random random(seed);
  const std::vector<Tree> forest = make_forest(plan, random);
  scene.from_air = seen_from_air(forest, plan, {}, random);
  scene.view = seen_from_below(forest, plan, trees, random);
  scene.area = {scene.view.centre_in_map, scene.view.centre_in_forest + Vector2d(45.0, -60.0),
                100.0};
  return scene;
}

// Turn, x and y by which the match is off at its centre: rad, m, m.
Eigen::Vector3d error_of(const GroundView& view, const TreeMatch& match) {
  const Eigen::Vector3d centre(match.centre_in_source.x(), match.centre_in_source.y(), 0.0);
  const Vector2d at = (match.target_from_source * centre).head<2>();
  const Vector2d truth = view.centre_in_forest + Eigen::Rotation2Dd(view.yaw_rad) *
                                                     (match.centre_in_source - view.centre_in_map);
  const Eigen::Matrix3d rotation = match.target_from_source.rotation_matrix();
  const double turn = std::remainder(std::atan2(rotation(1, 0), rotation(0, 0)) - view.yaw_rad,
                                     2.0 * std::numbers::pi);
  return {turn, at.x() - truth.x(), at.y() - truth.y()};
}

TEST(TreeMatch, FindsAStandAtAnyHeading) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    const Scene scene = make_scene(seed, 150);
    const TreeMatch match = match_tree_maps(scene.view.trees, scene.from_air, scene.area, {});
    ASSERT_TRUE(match.trusted) << match.reason;
    const Eigen::Vector3d error = error_of(scene.view, match);
    EXPECT_LT(error.tail<2>().norm(), 0.3);
    EXPECT_LT(std::abs(error[0]), 0.5 * std::numbers::pi / 180.0);
    EXPECT_GT(match.pairs.size(), 60U);
    EXPECT_LT(match.chance, 1e-6);
    // The feet in the map are 90 m lower.
    EXPECT_NEAR(match.target_from_source.translation().z(), 90.0, 0.1);
    EXPECT_LT(match.height_sd_m, 0.1);
  }
}

TEST(TreeMatch, StatesItsErrorHonestly) {
  double sum = 0.0;
  int count = 0;
  for (std::uint64_t seed = 1; seed <= 16; ++seed) {
    const Scene scene = make_scene(seed, 120);
    const TreeMatch match = match_tree_maps(scene.view.trees, scene.from_air, scene.area, {});
    if (!match.trusted) continue;
    const Eigen::Vector3d error = error_of(scene.view, match);
    sum += error.dot(match.covariance.inverse() * error) / 3.0;
    ++count;
  }
  ASSERT_GT(count, 12);
  EXPECT_GT(sum / count, 0.4);
  EXPECT_LT(sum / count, 2.0);
}

TEST(TreeMatch, DoesNotTrustAnotherForest) {
  for (const std::uint64_t seed : {1, 2, 3, 4}) {
    ForestPlan plan;
    if (seed == 4) plan = {400.0, 600.0, 0.0, 3.0, 4.0};  // rows look alike everywhere
    const Scene scene = make_scene(seed, 120, plan);
    const Scene other = make_scene(seed + 100, 120, plan);
    const TreeMatch match = match_tree_maps(other.view.trees, scene.from_air, scene.area, {});
    EXPECT_FALSE(match.trusted);
    EXPECT_GT(match.chance, 0.01);
    EXPECT_NE(match.reason.find("chance"), std::string::npos) << match.reason;
  }
}

TEST(TreeMatch, DoesNotTrustAMirroredStand) {
  Scene scene = make_scene(5, 150);
  for (Tree& tree : scene.view.trees)
    tree.x = 2.0 * scene.view.centre_in_map.x() - tree.x;
  EXPECT_FALSE(match_tree_maps(scene.view.trees, scene.from_air, scene.area, {}).trusted);
}

TEST(TreeMatch, ThinTreesBelowDoNotHide) {
  Scene scene = make_scene(6, 120);
  Random random(60);
  const std::size_t tall = scene.view.trees.size();
  for (std::size_t k = 0; k < 3 * tall; ++k) {
    Tree tree = scene.view.trees[k % tall];
    tree.x += random.uniform(-5.0, 5.0);
    tree.y += random.uniform(-5.0, 5.0);
    tree.height_m = random.uniform(4.0, 9.0);
    tree.dbh_m = random.uniform(0.05, 0.09);
    scene.view.trees.push_back(tree);
  }
  const TreeMatch match = match_tree_maps(scene.view.trees, scene.from_air, scene.area, {});
  EXPECT_TRUE(match.trusted) << match.reason;
  EXPECT_LT(error_of(scene.view, match).tail<2>().norm(), 0.5);
}

TEST(TreeMatch, AMapThatIsLongerThanTheSearchIsFittedWhole) {
  const Scene scene = make_scene(7, 600);
  TreeMatchConfig config;
  config.most_trees = 120;
  const TreeMatch match = match_tree_maps(scene.view.trees, scene.from_air, scene.area, config);
  ASSERT_TRUE(match.trusted) << match.reason;
  EXPECT_NEAR(static_cast<double>(match.searched_trees), 120.0, 5.0);
  EXPECT_GT(match.pairs.size(), 300U);
  EXPECT_LT(error_of(scene.view, match).tail<2>().norm(), 0.2);
}

TEST(TreeMatch, SaysWhyItCannotSearch) {
  const Scene scene = make_scene(8, 60);
  const std::vector<Tree> three(scene.view.trees.begin(), scene.view.trees.begin() + 3);
  EXPECT_EQ(match_tree_maps(three, scene.from_air, scene.area, {}).reason,
            "expected 10 trees with a place at least, found 3");
  EXPECT_EQ(match_tree_maps(scene.view.trees, {}, scene.area, {}).reason,
            "expected 10 trees at least in the area that is searched, found 0");
  TreeSearchArea far = scene.area;
  far.target_point.x() += 5000.0;
  EXPECT_FALSE(match_tree_maps(scene.view.trees, scene.from_air, far, {}).found);
  far = scene.area;
  far.radius_m = 1e5;
  EXPECT_FALSE(match_tree_maps(scene.view.trees, scene.from_air, far, {}).found);
}

TEST(TreeMatch, IsTheSameForAnyNumberOfThreads) {
  const Scene scene = make_scene(9, 100);
  TreeMatch first;
  with_threads(1,
               [&] { first = match_tree_maps(scene.view.trees, scene.from_air, scene.area, {}); });
  with_threads(3, [&] {
    const TreeMatch again = match_tree_maps(scene.view.trees, scene.from_air, scene.area, {});
    EXPECT_EQ(again.score, first.score);
    EXPECT_EQ(again.target_from_source.translation(), first.target_from_source.translation());
    EXPECT_EQ(again.pairs.size(), first.pairs.size());
  });
}

TEST(PatternGrid, NearTreesAreThoseOfASearchThroughAll) {
  Random random(3);
  std::vector<PatternTree> trees;
  for (int k = 0; k < 500; ++k)
    trees.push_back({{random.uniform(0.0, 90.0), random.uniform(0.0, 40.0)}, 0.0});
  const PatternGrid grid(trees);
  for (int k = 0; k < 50; ++k) {
    const Vector2d at(random.uniform(-10.0, 100.0), random.uniform(-10.0, 50.0));
    std::vector<bool> found(trees.size(), false);
    grid.near(at, 6.0, [&](std::size_t i, double square) {
      found[grid.given_index(i)] = true;
      EXPECT_NEAR(square, (trees[grid.given_index(i)].at - at).squaredNorm(), 1e-9);
    });
    for (std::size_t i = 0; i < trees.size(); ++i)
      EXPECT_EQ(found[i], (trees[i].at - at).norm() <= 6.0);
  }
  EXPECT_NEAR(grid.density({45.0, 20.0}), 500.0 / 3600.0, 0.04);
  EXPECT_EQ(grid.density({200.0, 20.0}), 0.0);
}

TEST(PatternGrid, RanksAreNormalScores) {
  EXPECT_NEAR(normal_quantile(0.975), 1.959964, 1e-6);
  EXPECT_NEAR(normal_quantile(0.001), -3.090232, 1e-6);
  std::vector<Vector2d> places;
  std::vector<double> sizes;
  for (int k = 0; k < 9; ++k) {
    places.emplace_back(k, 0.0);
    sizes.push_back(10.0 + k);
  }
  const std::vector<double> ranks = local_ranks(places, sizes, 100.0);
  EXPECT_NEAR(ranks[4], 0.0, 1e-9);
  EXPECT_NEAR(ranks[8], normal_quantile(8.5 / 9.0), 1e-9);
  EXPECT_TRUE(std::isnan(local_ranks(places, sizes, 1.5)[4]));
}

// By numeric integration: the ratio has the mean 1 over all places, which the judgement needs.
TEST(TreeLikeness, RatiosHaveTheMeanOne) {
  TreeLikeness likeness;
  likeness.rank_correlation = 0.6;
  double mean = 0.0;
  const double step = 0.05;
  for (double v = -6.0; v < 6.0; v += step)
    mean += step * std::exp(-0.5 * v * v) / std::sqrt(2.0 * std::numbers::pi) *
            likeness.rank_ratio(0.8, v);
  EXPECT_NEAR(mean, 1.0, 1e-6);
  EXPECT_GT(likeness.rank_ratio(1.5, 1.5), likeness.rank_ratio(1.5, -1.5));
}

TEST(PlaceSearch, PutsTheTruePlaceFirst) {
  const Scene scene = make_scene(10, 150);
  std::vector<PatternTree> source;
  for (const Tree& tree : scene.view.trees)
    source.push_back({Vector2d(tree.x, tree.y) - scene.view.centre_in_map, 0.0});
  std::vector<PatternTree> target;
  for (const Tree& tree : scene.from_air)
    target.push_back({{tree.x, tree.y}, 0.0});
  const PlaceSearch search =
      search_places(source, PatternGrid(target), {scene.area.target_point, 100.0}, {});
  const PlaneMotion& best = search.candidates.front().target_from_source;
  EXPECT_LT((best.at - scene.view.centre_in_forest).norm(), 1.5);
  EXPECT_LT(std::abs(std::remainder(best.yaw_rad - scene.view.yaw_rad, 2.0 * std::numbers::pi)),
            0.04);
}

// The information of a fit against the curvature of its score, by differences.
TEST(PatternFit, InformationIsTheCurvatureOfTheScore) {
  Random random(11);
  std::vector<PatternTree> target;
  std::vector<PatternTree> source;
  for (int k = 0; k < 60; ++k) {
    target.push_back({{random.uniform(-30.0, 30.0), random.uniform(-30.0, 30.0)}, 0.0});
    source.push_back({target.back().at + 0.5 * Vector2d(random.normal(), random.normal()), 0.0});
  }
  const PatternGrid grid(target);
  const PatternFit fit = fit_pattern(source, grid, {}, {}, 200);
  const auto score = [&](const Eigen::Vector3d& off) {
    PlaneMotion motion = fit.target_from_source;
    motion.yaw_rad += off[0];
    motion.at += off.tail<2>();
    return fit_pattern(source, grid, motion, fit.likeness, 0).score;
  };
  const Eigen::Vector3d steps(0.015, 0.25, 0.25);
  for (int i = 0; i < 3; ++i) {
    Eigen::Vector3d off = Eigen::Vector3d::Zero();
    off[i] = steps[i];
    const double curvature =
        (2.0 * score(Eigen::Vector3d::Zero()) - score(off) - score(-off)) / (steps[i] * steps[i]);
    // Trees at the edge of the reach and changes of density between cells make it a little rough.
    EXPECT_NEAR(fit.information(i, i) / curvature, 1.0, 0.25) << i;
  }
}

TEST(SourcePart, PartsAreCompactAndApart) {
  Random random(12);
  std::vector<PatternTree> trees;
  for (int k = 0; k < 1000; ++k)
    trees.push_back({{random.uniform(0.0, 500.0), random.uniform(0.0, 20.0)}, 0.0});
  const std::vector<SourcePart> parts = parts_of(trees, 100, 3);
  ASSERT_EQ(parts.size(), 3U);
  for (const SourcePart& part : parts) {
    EXPECT_NEAR(static_cast<double>(part.trees.size()), 100.0, 2.0);
    EXPECT_LT(part.reach_m, 45.0);
  }
  EXPECT_EQ(parts_of(trees, 2000, 3).size(), 1U);
}

}  // namespace
}  // namespace understory
