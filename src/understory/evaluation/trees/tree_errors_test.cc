#include "understory/evaluation/trees/tree_errors.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/random.h"

namespace understory {
namespace {

std::vector<Tree> stand_on_slope(std::uint64_t seed, int n, double extent_m) {
  Random random(seed);
  std::vector<Tree> trees;
  for (int i = 0; i < n; ++i) {
    Tree tree;
    tree.id = i + 1;
    tree.x = random.uniform(0.0, extent_m);
    tree.y = random.uniform(0.0, extent_m);
    tree.z = 0.05 * tree.x + 0.02 * tree.y;
    tree.dbh_m = random.uniform(0.1, 0.4);
    trees.push_back(tree);
  }
  return trees;
}

Tree tree_at(double x, double y) {
  Tree tree;
  tree.x = x;
  tree.y = y;
  return tree;
}

TEST(TreeErrors, MatchesOneToOneNearestFirst) {
  const std::vector<Tree> a = {tree_at(0.0, 0.0), tree_at(0.3, 0.0)};
  const std::vector<Tree> b = {tree_at(0.2, 0.0), tree_at(5.0, 0.0)};
  const std::vector<TreePair> pairs = match_trees(a, b, 0.5);
  ASSERT_EQ(pairs.size(), 1u) << "b[0] serves only once";
  EXPECT_EQ(pairs[0], TreePair(1, 0));
}

TEST(TreeErrors, FiguresAgreeWithWhatWasPutIn) {
  std::vector<Tree> b = stand_on_slope(4, 50, 200.0);
  std::vector<Tree> a(b.begin(), b.begin() + 40);
  for (std::size_t i = 0; i < a.size(); ++i) {
    a[i].x += i % 2 == 0 ? 0.03 : -0.03;
    a[i].y += 0.04;
    a[i].dbh_m += i % 2 == 0 ? 0.03 : 0.01;
    a[i].height_m = 20.0;
    b[i].height_m = 21.0;
  }
  a.push_back(tree_at(-50.0, -50.0));
  a[0].dbh_m = NAN;
  a[1].dbh_m = NAN;
  const TreeErrors errors = compare_trees(a, b, 0.5);
  EXPECT_EQ(errors.trees_a, 41u);
  EXPECT_EQ(errors.matched, 40u);
  EXPECT_NEAR(errors.recall, 0.8, 1e-12);
  EXPECT_NEAR(errors.precision, 40.0 / 41.0, 1e-12);
  EXPECT_NEAR(errors.position_rmse_m, 0.05, 1e-9);
  EXPECT_NEAR(errors.dbh_bias_m, 0.02, 1e-9);
  EXPECT_NEAR(errors.dbh_rmse_m, std::sqrt(0.0005), 1e-9);
  EXPECT_NEAR(errors.height_rmse_m, 1.0, 1e-12);
  EXPECT_TRUE(std::isnan(compare_trees({}, b, 0.5).precision));
}

TEST(TreeErrors, AlignsWithoutAStartAmongMissingAndFalseTrees) {
  for (std::uint64_t seed = 20; seed < 25; ++seed) {
    const std::vector<Tree> b = stand_on_slope(seed, 120, 60.0);
    Random random(seed, 1);
    std::vector<Tree> seen;
    for (const Tree& tree : b) {
      if (random.uniform() < 0.25) continue;
      seen.push_back(tree);
      seen.back().x += random.normal(0.0, 0.03);
      seen.back().y += random.normal(0.0, 0.03);
    }
    for (int i = 0; i < 10; ++i)
      seen.push_back(tree_at(random.uniform(0.0, 60.0), random.uniform(0.0, 60.0)));
    const Pose b_from_a(so3_exp({0, 0, random.uniform(-3.0, 3.0)}), Eigen::Vector3d(70, -30, 4));
    const std::vector<Tree> a = moved(seen, b_from_a.inverse());
    const auto found = align_trees(a, b, Alignment::kYaw, 0.5);
    ASSERT_TRUE(found.has_value());
    EXPECT_LT((b_from_a.inverse() * *found).angle(), 2e-3);
    EXPECT_GE(compare_trees(moved(a, *found), b, 0.5).matched, seen.size() - 10);
  }
}

TEST(TreeErrors, NoAlignmentBetweenStandsThatShareNothing) {
  EXPECT_FALSE(align_trees({tree_at(0, 0), tree_at(10, 0)}, stand_on_slope(1, 30, 50.0),
                           Alignment::kYaw, 0.5)
                   .has_value());
  EXPECT_FALSE(align_trees({}, {}, Alignment::kSe3, 0.5).has_value());
}

TEST(TreeErrors, OnlyVisibleTreesNearThePathAreExpected) {
  std::vector<Tree> b = {tree_at(1, 0), tree_at(2, 3), tree_at(3, -3), tree_at(40, 0)};
  for (std::size_t i = 0; i < b.size(); ++i)
    b[i].id = static_cast<int>(i) + 1;
  // Tree 3 is seen too little to be expected, yet finding it is no error; one is invented.
  const std::vector<Tree> a = {tree_at(1.1, 0), tree_at(3, -3), tree_at(6, 6), tree_at(45, 0)};
  Visibility visibility;
  visibility.returns_by_tree = {{1, 30}, {2, 500}, {3, 29}, {4, 1000}};
  visibility.path = {{0, Pose(Eigen::Quaterniond::Identity(), {0, 0, 0})}};
  const VisibleTreeErrors errors = compare_visible_trees(a, b, match_trees(a, b, 0.5), visibility);
  EXPECT_EQ(errors.expected, 2u);
  EXPECT_EQ(errors.found, 1u);
  EXPECT_EQ(errors.reported, 3u);
  EXPECT_EQ(errors.false_trees, 1u);
  EXPECT_NEAR(errors.recall, 0.5, 1e-12);
  EXPECT_NEAR(errors.false_share, 1.0 / 3.0, 1e-12);
}

TEST(TreeErrors, FelledTreesAreNeitherMissedNorFalse) {
  std::vector<Tree> b = {tree_at(1, 0), tree_at(2, 3), tree_at(3, -3), tree_at(4, 1)};
  for (std::size_t i = 0; i < b.size(); ++i)
    b[i].id = static_cast<int>(i) + 1;
  b[1].felled = b[3].felled = true;
  // The first stands and is found, one of the felled ones is listed, the other is not.
  const std::vector<Tree> a = {tree_at(1, 0.1), tree_at(2, 3.1)};
  const TreeErrors errors = compare_trees(a, b, 0.5);
  EXPECT_EQ(errors.trees_b, 2u);
  EXPECT_EQ(errors.trees_a, 1u);
  EXPECT_EQ(errors.matched, 1u);
  EXPECT_NEAR(errors.recall, 0.5, 1e-12);
  EXPECT_NEAR(errors.precision, 1.0, 1e-12);
  Visibility visibility;
  visibility.returns_by_tree = {{1, 90}, {2, 90}, {3, 90}, {4, 90}};
  visibility.path = {{0, Pose(Eigen::Quaterniond::Identity(), {0, 0, 0})}};
  const VisibleTreeErrors visible = compare_visible_trees(a, b, match_trees(a, b, 0.5), visibility);
  EXPECT_EQ(visible.expected, 2u);
  EXPECT_EQ(visible.found, 1u);
  EXPECT_EQ(visible.false_trees, 0u);
}

TEST(TreeErrors, AgreementOfTwoMapsNearAPath) {
  Trajectory path;
  for (int k = 0; k <= 10; ++k)
    path.push_back({k, Pose(Eigen::Quaterniond::Identity(), {10.0 * k, 0.0, 0.0})});
  // Ten trees beside the path in both maps, two of them missed by B, one false in B. Far trees of A
  // alone do not count. One pair lies across the limit.
  std::vector<Tree> a;
  std::vector<Tree> b;
  for (int k = 0; k < 10; ++k) {
    a.push_back(tree_at(10.0 * k, 5.0));
    if (k < 8) b.push_back(tree_at(10.0 * k + 0.2, 5.0));
    a.push_back(tree_at(10.0 * k, 40.0));
  }
  b.push_back(tree_at(55.0, -3.0));
  a.push_back(tree_at(50.0, 14.9));
  b.push_back(tree_at(50.0, 15.1));
  const MapAgreement found = compare_maps(a, b, match_trees(a, b, 0.5), path, 15.0);
  EXPECT_EQ(found.trees_a, 11U);
  EXPECT_EQ(found.trees_b, 9U);
  EXPECT_EQ(found.paired_a, 9U);
  EXPECT_EQ(found.paired_b, 8U);
  EXPECT_DOUBLE_EQ(found.agreement, 17.0 / 20.0);
  EXPECT_TRUE(std::isnan(compare_maps({}, {}, {}, path, 15.0).agreement));
}

TEST(TreeErrors, ReadsTheColumnsByName) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "trees.csv";
  std::ofstream(path) << "id,x,y,z,dbh_m,height_m,species\n7,1.5,-2,0.1,,21.5,pine\n";
  const std::vector<Tree> trees = read_trees(path);
  ASSERT_EQ(trees.size(), 1u);
  EXPECT_EQ(trees[0].id, 7);
  EXPECT_EQ(trees[0].y, -2.0);
  EXPECT_TRUE(std::isnan(trees[0].dbh_m));
  EXPECT_EQ(trees[0].height_m, 21.5);
  EXPECT_FALSE(trees[0].felled);
  std::ofstream(path) << "id,x,y,felled_at\n7,1.5,-2,\n8,3,4,1700000026.48\n";
  EXPECT_FALSE(read_trees(path).at(0).felled);
  EXPECT_TRUE(read_trees(path).at(1).felled);
  std::ofstream(path) << "id,x\n1,2\n";
  EXPECT_THROW((void)read_trees(path), InputError);
  // Bug: a name that stood twice in the header let rows through that were too short.
  std::ofstream(path) << "x,x,y\n1,2\n";
  EXPECT_THROW((void)read_trees(path), InputError);
  std::ofstream(path) << "id,x,y\n1e300,1,2\n";
  EXPECT_THROW((void)read_trees(path), InputError);
  std::ofstream(path) << "timestamp,tree_id,rings,rings_with_3,returns\n0,5,1,1,20\n1,5,1,1,11\n";
  EXPECT_EQ(read_returns(path).at(5), 31);
  std::filesystem::remove(path);
}

// What reading a list says, that has six trees with `usual` in a column and one with `last` in
// line 8.
std::string complaint_of(const char* column, double usual, const std::string& last) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "trees.csv";
  std::ofstream list(path);
  list << "x,y," << column << "\n";
  for (int k = 0; k < 6; ++k)
    list << 3 * k << ",0," << usual << "\n";
  list << "1,5," << last << "\n";
  list.close();
  try {
    (void)read_trees(path);
  } catch (const InputError& error) {
    return error.what();
  }
  return {};
}

std::string complaint_of_diameter(const std::string& dbh, double unit = 1.0) {
  return complaint_of("dbh_m", 0.3 * unit, dbh);
}

// Bug: a dbh of -9999 counted as a diameter, and a list of negative ones ended the program.
TEST(TreeErrors, ADiameterThatIsNoneIsRefused) {
  for (const char* dbh : {"0", "-1", "-9999", "-inf"}) {
    const std::string complaint = complaint_of_diameter(dbh);
    EXPECT_NE(complaint.find("line 8"), std::string::npos) << complaint;
    EXPECT_NE(complaint.find("empty cell"), std::string::npos) << complaint;
  }
  for (const char* dbh : {"25", "1e6", "inf"})
    EXPECT_NE(complaint_of_diameter(dbh).find("line 8"), std::string::npos) << dbh;
  for (const char* dbh : {"", "nan", "0.004", "11.6"})
    EXPECT_EQ(complaint_of_diameter(dbh), "") << dbh;
  // A list in centimetres is read: who compares it says which unit it is in.
  EXPECT_EQ(complaint_of_diameter("25", 100.0), "");
}

// Bug: heights of -9999 were taken as numbers.
TEST(TreeErrors, AHeightThatIsNoneIsRefused) {
  for (const char* height : {"0", "-1", "-9999"}) {
    const std::string complaint = complaint_of("height_m", 20.0, height);
    EXPECT_NE(complaint.find("line 8"), std::string::npos) << complaint;
    EXPECT_NE(complaint.find("'height_m'"), std::string::npos) << complaint;
  }
  EXPECT_EQ(complaint_of("height_m", 20.0, ""), "");
  EXPECT_NE(complaint_of("z", 150.0, "-9999").find("line 8"), std::string::npos);
  EXPECT_EQ(complaint_of("z", 150.0, "-430"), "");
}

}  // namespace
}  // namespace understory
