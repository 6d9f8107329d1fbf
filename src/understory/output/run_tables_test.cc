#include "understory/output/run_tables.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <utility>

#include "understory/recording/clouds/stems_file.h"
#include "understory/util/error.h"
#include "understory/util/files/csv.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/log.h"

namespace understory {
namespace {

// What a reader of the tables gets.
class RunTablesTest : public ::testing::Test {
 protected:
  test::TemporaryFolder folder_;
  static constexpr TimeNs kStamp = 1'700'000'000'123'456'789;
};

TEST_F(RunTablesTest, TreesComeBackToTheDecimalsOfTheirColumns) {
  Tree tree;
  double next = 1.23456;
  for (const TreeColumn& column : kTreeColumns) {
    if (const auto* member = std::get_if<double Tree::*>(&column.member))
      tree.*(*member) = -(next += 10.0);
  }
  tree.id = 7;
  tree.observations = 12;
  tree.species = "pine, old";
  tree.quality = "good";
  Tree unknown;
  unknown.id = 8;
  write_trees_csv(folder_ / "trees.csv", {tree, unknown});
  CsvReader table(folder_ / "trees.csv");
  ASSERT_EQ(table.names().size(), kTreeColumns.size());
  ASSERT_TRUE(table.next());
  for (const TreeColumn& column : kTreeColumns) {
    if (const auto* whole = std::get_if<int Tree::*>(&column.member)) {
      EXPECT_EQ(table.number(column.name), tree.*(*whole)) << column.name;
      continue;
    }
    if (const auto* text = std::get_if<std::string Tree::*>(&column.member)) {
      EXPECT_EQ(table.text(column.name), tree.*(*text)) << column.name;
      continue;
    }
    const double value = tree.*std::get<double Tree::*>(column.member);
    EXPECT_NEAR(table.number(column.name), value, 0.51 * std::pow(10.0, -column.decimals))
        << column.name;
    if (column.decimals == 0) continue;
    EXPECT_NE(table.number(column.name), std::round(value)) << column.name << " lost its decimals";
  }
  ASSERT_TRUE(table.next());
  EXPECT_EQ(table.text("dbh_m"), "");
  EXPECT_EQ(table.number("x"), 0.0);
  EXPECT_FALSE(table.next());
}

TEST_F(RunTablesTest, AnEmptyListIsAHeader) {
  write_trees_csv(folder_ / "trees.csv", {});
  write_tree_falls(folder_ / "felled.csv", {});
  CsvReader trees(folder_ / "trees.csv", {"id", "x", "y", "dbh_m"});
  EXPECT_FALSE(trees.next());
  CsvReader falls(folder_ / "felled.csv", {"id", "seen_until", "gone_since"});
  EXPECT_FALSE(falls.next());
}

TEST_F(RunTablesTest, TreeFallsKeepTheirTimesToTheNanosecond) {
  TreeFall fall;
  fall.tree_id = 3;
  fall.x = -12.3454;
  fall.y = 7.5;
  fall.seen_until = kStamp;
  fall.gone_since = kStamp + 5 * kNsPerSecond;
  fall.missed = 9;
  write_tree_falls(folder_ / "felled.csv", {fall});
  CsvReader table(folder_ / "felled.csv");
  ASSERT_TRUE(table.next());
  EXPECT_EQ(table.text("seen_until"), "1700000000.123456789");
  EXPECT_EQ(table.text("gone_since"), "1700000005.123456789");
  EXPECT_EQ(table.number("id"), 3.0);
  EXPECT_EQ(table.number("x"), -12.345);
  EXPECT_EQ(table.number("y"), 7.5);
  EXPECT_EQ(table.number("missed"), 9.0);
}

TEST_F(RunTablesTest, APoseIsReturnedAsTheFileHasIt) {
  TumWriter writer(folder_ / "trajectory.tum");
  const Pose pose(Eigen::Quaterniond(0.1, -0.2, 0.3, 0.927), {1.0 / 3.0, -2.0 / 3.0, 1e-12});
  const StampedPose read = writer.add({kStamp, pose});
  writer.commit();
  EXPECT_EQ(read.stamp, kStamp);
  EXPECT_EQ(read.world_from_body.translation().x(), 0.333333333);
  EXPECT_EQ(read.world_from_body.translation().y(), -0.666666667);
  EXPECT_EQ(read.world_from_body.translation().z(), 0.0);
  EXPECT_LT((pose.inverse() * read.world_from_body).angle(), 1e-8);
}

TEST_F(RunTablesTest, StatesAreReadByTheirColumns) {
  StateRow row;
  row.stamp = kStamp;
  row.velocity_in_world = {1.0, -2.0, 0.5};
  row.gyro_bias = {0.001, 0.002, 0.003};
  row.accel_bias = {0.1, 0.2, 0.3};
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j)
      row.pose_covariance(i, j) = 1e-7 * (10 * std::min(i, j) + std::max(i, j));
  }
  StatesWriter writer(folder_ / "states.csv.gz");
  writer.add(row);
  writer.commit();
  CsvReader table(folder_ / "states.csv.gz");
  ASSERT_EQ(table.names().size(), 10U + 21U);
  ASSERT_TRUE(table.next());
  EXPECT_EQ(table.text("timestamp"), "1700000000.123456789");
  EXPECT_EQ(table.number("vy"), -2.0);
  EXPECT_EQ(table.number("gz"), 0.003);
  EXPECT_EQ(table.number("ax"), 0.1);
  for (int i = 0; i < 6; ++i) {
    for (int j = i; j < 6; ++j)
      EXPECT_NEAR(table.number("c" + std::to_string(i) + std::to_string(j)),
                  row.pose_covariance(i, j), 1e-15);
  }
}

TEST_F(RunTablesTest, FixesKeepTheirPlaceToTheTenthOfAMillimetre) {
  GnssRow row;
  row.fix.stamp = kStamp;
  row.fix.latitude_deg = 61.123456789;
  row.fix.longitude_deg = -24.987654321;
  row.fix.height_m = 151.2345;
  row.fix.satellites = 17;
  row.fix.heading_deg = 359.9876;
  row.fix.heading_sd_deg = 0.25;
  row.position_in_world = {1.25, -2.5, 3.75};
  row.used = true;
  row.reason = "two words, \"quoted\"";
  GnssWriter writer(folder_ / "gnss.csv");
  writer.add(row);
  writer.commit();
  CsvReader table(folder_ / "gnss.csv");
  ASSERT_TRUE(table.next());
  EXPECT_EQ(table.number("latitude_deg"), 61.123456789);
  EXPECT_EQ(table.number("longitude_deg"), -24.987654321);
  EXPECT_EQ(table.number("height_m"), 151.2345);
  EXPECT_EQ(table.number("satellites"), 17.0);
  EXPECT_EQ(table.number("y"), -2.5);
  EXPECT_TRUE(std::isnan(table.number("residual_x"))) << "not known";
  EXPECT_EQ(table.number("used"), 1.0);
  EXPECT_EQ(table.number("heading_deg"), 359.9876);
  EXPECT_EQ(table.number("heading_sd_deg"), 0.25);
  EXPECT_EQ(table.text("reason"), "two words, \"quoted\"");
}

// `understory correct` makes of the file what `map` made of the stems themselves.
TEST_F(RunTablesTest, StemsComeBackAsTheWriterSaid) {
  Stem known;
  known.point = {1.23456F, -7.65432F, 0.5F};
  known.axis = Eigen::Vector3f(0.1F, -0.05F, 1.0F).normalized();
  known.length_m = 3.456F;
  known.dbh_m = 0.2345F;
  known.score = 0.87654F;
  known.radius_m = 0.1172F;
  known.radius_sd_m = 0.00456F;
  known.xx = 0.000123F;
  known.xy = -0.0000456F;
  known.yy = 0.000789F;
  known.zz = 0.0123F;
  Stem place_only;
  place_only.point = {4.0F, 5.0F, 6.0F};
  StemsWriter writer(folder_ / "stems.csv.gz");
  std::vector<Stem> said = {writer.add(12, kStamp, known), writer.add(12, kStamp, place_only)};
  said.push_back(writer.add(20, kStamp + kNsPerSecond, known));
  writer.commit();
  Log log;
  const std::vector<StemView> views = read_stem_views(folder_ / "stems.csv.gz", log);
  ASSERT_EQ(views.size(), 2U);
  EXPECT_EQ(views[0].frame, 12);
  EXPECT_EQ(views[0].stamp, kStamp);
  EXPECT_EQ(views[1].frame, 20);
  ASSERT_EQ(views[0].stems.size(), 2U);
  const auto same = [](float a, float b) { return a == b || (std::isnan(a) && std::isnan(b)); };
  for (const auto& [read, expected] : {std::pair{views[0].stems[0], said[0]},
                                       {views[0].stems[1], said[1]},
                                       {views[1].stems[0], said[2]}}) {
    EXPECT_EQ(read.point, expected.point);
    for (int i = 0; i < 3; ++i)
      EXPECT_TRUE(same(read.axis[i], expected.axis[i])) << i;
    for (const auto member : {&Stem::length_m, &Stem::dbh_m, &Stem::score, &Stem::radius_m,
                              &Stem::radius_sd_m, &Stem::xx, &Stem::xy, &Stem::yy, &Stem::zz})
      EXPECT_TRUE(same(read.*member, expected.*member)) << read.*member;
  }
  EXPECT_NEAR(said[0].point.x(), known.point.x(), 0.0006);
  EXPECT_NEAR(said[0].axis.dot(known.axis), 1.0, 1e-6);
}

TEST_F(RunTablesTest, NothingAppearsWithoutCommit) {
  {
    TumWriter writer(folder_ / "trajectory.tum");
    (void)writer.add({});
    StatesWriter states(folder_ / "states.csv.gz");
    states.add({});
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
  EXPECT_THROW(write_trees_csv(folder_ / "missing" / "trees.csv", {}), OutputError);
  EXPECT_THROW(GnssWriter(folder_ / "missing" / "gnss.csv"), OutputError);
}

}  // namespace
}  // namespace understory
