#include "understory/pipeline/correction/head_cut_log.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "understory/evaluation/trees/tree_falls.h"
#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

class HeadLog : public ::testing::Test {
 protected:
  std::string log_of(const std::string& rows) const {
    const fs::path file = folder / "head.csv";
    std::ofstream(file) << "timestamp,x,y,z\n" << rows;
    return file.string();
  }
  static std::string text_of(const fs::path& file) {
    std::ifstream stream(file);
    return {std::istreambuf_iterator<char>(stream), {}};
  }

  const test::TemporaryFolder folder;
};

TEST_F(HeadLog, TheLogIsReadStrictly) {
  EXPECT_TRUE(read_head_log("").empty());
  const auto cuts = read_head_log(log_of("10.5,1,2,3\n10.5,2,2,3\n"));
  ASSERT_EQ(cuts.size(), 2U);
  EXPECT_EQ(cuts[0].stamp, from_seconds(10.5));
  EXPECT_EQ(cuts[1].head_in_body, Eigen::Vector3d(2.0, 2.0, 3.0));
  EXPECT_THROW((void)read_head_log(log_of("10,1,2,3\n9,1,2,3\n")), InputError);
  EXPECT_THROW((void)read_head_log(log_of("10,1,nan,3\n")), InputError);
  EXPECT_THROW((void)read_head_log(log_of("soon,1,2,3\n")), InputError);
  EXPECT_THROW((void)read_head_log((folder / "none.csv").string()), InputError);
}

TEST_F(HeadLog, CutsLieWhereThePathSaysThatTheMachineWas) {
  const Eigen::Quaterniond left(Eigen::AngleAxisd(0.5 * M_PI, Eigen::Vector3d::UnitZ()));
  const std::vector<StampedPose> path = {{from_seconds(10.0), Pose(left, {0.0, 0.0, 1.0})},
                                         {from_seconds(12.0), Pose(left, {4.0, 0.0, 1.0})}};
  Log log;
  const auto placed = place_cuts({{from_seconds(9.0), {0.0, 0.0, 0.0}},
                                  {from_seconds(10.0), {3.0, 0.0, 0.0}},
                                  {from_seconds(11.0), {3.0, 0.0, 0.0}},
                                  {from_seconds(12.5), {0.0, 0.0, 0.0}}},
                                 path, log);
  ASSERT_EQ(placed.size(), 2U);
  EXPECT_LT((placed[0].head_in_world - Eigen::Vector3d(0.0, 3.0, 1.0)).norm(), 1e-9);
  EXPECT_LT((placed[1].head_in_world - Eigen::Vector3d(2.0, 3.0, 1.0)).norm(), 1e-9);
  ASSERT_EQ(log.warnings().size(), 1U);
  EXPECT_EQ(log.warnings()[0].count, 2U);
}

// Two trees seen for a while and no more, too short to tell by the views alone: the head tells.
TEST_F(HeadLog, TheHeadTellsWhatTheViewsCannot) {
  std::vector<StemView> views(20);
  std::vector<Pose> poses(20);
  for (std::size_t i = 0; i < views.size(); ++i)
    views[i].stamp = from_seconds(10.0 * static_cast<double>(i));
  std::vector<MappedStem> stems(2);
  std::vector<Tree> trees(2);
  for (std::size_t t = 0; t < stems.size(); ++t) {
    stems[t].point_in_world = {5.0, 4.0 * static_cast<double>(t), 0.0};
    stems[t].last_view = 8;
    trees[t].id = static_cast<int>(t) + 1;
    trees[t].x = stems[t].point_in_world.x();
    trees[t].y = stems[t].point_in_world.y();
  }
  const std::vector<HeadCut> cuts = {{from_seconds(95.0), {5.2, 4.1, 1.0}},
                                     {from_seconds(150.0), {-7.0, 0.0, 1.0}}};
  RunSummary summary;
  Log log;
  HeadCutLogConfig config;
  config.head_log = "head.csv";
  (void)write_felled_trees(folder.path(), {views, poses, stems, trees}, cuts, config, summary, log);
  EXPECT_TRUE(std::isnan(trees[0].missing_since_s));
  EXPECT_EQ(trees[1].missing_since_s, 95.0);
  const auto falls = read_tree_falls(folder / "felled.csv");
  ASSERT_EQ(falls.size(), 1U);
  EXPECT_EQ(falls[0].tree_id, 2);
  EXPECT_EQ(falls[0].seen_until, from_seconds(95.0));
  EXPECT_EQ(falls[0].gone_since, from_seconds(95.0));
  EXPECT_EQ(text_of(folder / "cuts.csv"),
            "timestamp,x,y,z,tree_id,distance_m\n"
            "95.000000000,5.200,4.100,1.000,2,0.224\n"
            "150.000000000,-7.000,0.000,1.000,,\n");
  write_moved_cuts(folder / "cuts.csv", folder / "moved.csv",
                   Pose(Eigen::Quaterniond::Identity(), {100.0, 0.0, -1.0}));
  EXPECT_EQ(text_of(folder / "moved.csv"),
            "timestamp,x,y,z,tree_id,distance_m\n"
            "95.000000000,105.200,4.100,0.000,2,0.224\n"
            "150.000000000,93.000,0.000,0.000,,\n");
  EXPECT_EQ(std::get<std::int64_t>(summary.counts.at("head_cuts_without_tree")), 1);
}

// A tree that stands in the first 20 of 60 views from one place.
struct GoneStand {
  std::vector<StemView> views = std::vector<StemView>(60);
  std::vector<Pose> poses = std::vector<Pose>(60);
  std::vector<MappedStem> stems = std::vector<MappedStem>(20);
  std::vector<Tree> trees = std::vector<Tree>(20);

  GoneStand() {
    for (std::size_t t = 0; t < stems.size(); ++t) {
      const double angle = 0.3 * static_cast<double>(t);
      stems[t].point_in_world = {8.0 * std::cos(angle), 8.0 * std::sin(angle), 0.0};
      trees[t].id = static_cast<int>(t) + 1;
    }
    for (std::size_t v = 0; v < views.size(); ++v) {
      views[v].stamp = from_seconds(2.0 * static_cast<double>(v));
      for (std::size_t t = 0; t < stems.size(); ++t) {
        if (t == 7 && v >= 20) continue;
        Stem stem;
        stem.point = stems[t].point_in_world.cast<float>();
        views[v].stems.push_back(stem);
      }
    }
  }
};

// The log has another body frame than the path, as where the extrinsics of the lidar are missing.
// One cut lies near a tree by chance.
TEST_F(HeadLog, CutsThatLieAtNoTreesTellNoneOfThem) {
  GoneStand stand;
  for (MappedStem& stem : stand.stems)
    stem.last_view = 30;
  const FelledStand felled{stand.views, stand.poses, stand.stems, stand.trees};
  RunSummary summary;
  Log log;
  HeadCutLogConfig config;
  config.head_log = "head.csv";
  std::vector<HeadCut> cuts;
  for (std::size_t t = 0; t < 4; ++t)
    cuts.push_back({from_seconds(70.0), 0.7 * stand.stems[t].point_in_world});
  cuts[0].head_in_world = stand.stems[0].point_in_world;
  const auto falls = write_felled_trees(folder.path(), felled, cuts, config, summary, log);
  ASSERT_EQ(falls.size(), 1U);  // that of tree 8, which the views tell
  EXPECT_EQ(falls[0].tree_id, 8);
  EXPECT_EQ(std::get<std::int64_t>(summary.counts.at("head_cuts_without_tree")), 4);
  ASSERT_EQ(log.warnings().size(), 1U);
  EXPECT_EQ(log.warnings()[0].key, "felling.head_place");
  for (std::size_t t = 1; t < 4; ++t)
    cuts[t].head_in_world = stand.stems[t].point_in_world;
  Log silent;
  EXPECT_EQ(write_felled_trees(folder.path(), felled, cuts, config, summary, silent).size(), 5U);
  EXPECT_TRUE(silent.warnings().empty());
}

TEST_F(HeadLog, OnlyAMachineFells) {
  GoneStand stand;
  const FelledStand felled{stand.views, stand.poses, stand.stems, stand.trees};
  RunSummary summary;
  Log log;
  HeadCutLogConfig config;
  EXPECT_FALSE(fells_trees(config));
  EXPECT_TRUE(write_felled_trees(folder.path(), felled, {}, config, summary, log).empty());
  EXPECT_TRUE(read_tree_falls(folder / "felled.csv").empty());
  EXPECT_EQ(std::get<std::int64_t>(summary.counts.at("trees_felled")), 0);
  EXPECT_EQ(std::get<std::int64_t>(summary.counts.at("trees_missing")), 1);
  for (const Tree& tree : stand.trees)
    EXPECT_EQ(std::isfinite(tree.missing_since_s), tree.id == 8) << tree.id;
  EXPECT_EQ(stand.trees[7].missing_since_s, 40.0);
  config.fells = true;
  EXPECT_TRUE(fells_trees(config));
  const auto falls = write_felled_trees(folder.path(), felled, {}, config, summary, log);
  ASSERT_EQ(falls.size(), 1U);
  EXPECT_EQ(falls[0].tree_id, 8);
  EXPECT_EQ(falls[0].gone_since, from_seconds(40.0));
  EXPECT_EQ(stand.trees[7].missing_since_s, 40.0);
}

}  // namespace
}  // namespace understory
