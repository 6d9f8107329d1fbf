#include "understory/pipeline/judgement/stand_notes.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

Tree tree_with(int id, double dbh_m, double dbh_sd_m, double height_m) {
  Tree tree;
  tree.id = id;
  tree.dbh_m = dbh_m;
  tree.dbh_sd_m = dbh_sd_m;
  tree.height_m = height_m;
  return tree;
}

// A run was "complete" without a word, and 57 of its 221 diameters were guesses.
TEST(StandNotes, DoubtfulTreesAreCountedAndTheVerdictStays) {
  constexpr double kUnknown = Tree::kUnknown;
  InventoryResult inventory;
  inventory.trees = {tree_with(1, 0.2, 0.01, 12.0), tree_with(2, 0.2, 0.07, kUnknown),
                     tree_with(3, 0.1, 0.05, 8.0), tree_with(4, kUnknown, kUnknown, 15.0)};
  inventory.look_again.resize(1);
  inventory.look_again[0].trees = {3, 2};
  inventory.thin.share = 0.42;
  RunSummary summary;
  note_doubts(inventory, summary);
  ASSERT_EQ(summary.notes.size(), 3U);
  EXPECT_EQ(summary.notes[0],
            "2 of 3 diameters are doubtful (standard deviation over 30 %); 1 of 4 trees have no "
            "height; 1 of 4 trees were found by their crowns alone");
  EXPECT_EQ(summary.notes[1].rfind("walk here: 1 place would show 2 of the 2 doubtful stems", 0),
            0U);
  EXPECT_NE(summary.notes[2].find("thin on 42 % of the area"), std::string::npos);
  EXPECT_EQ(std::get<std::int64_t>(summary.counts["diameters_doubtful"]), 2);
  EXPECT_EQ(std::get<std::int64_t>(summary.counts["heights_missing"]), 1);
  EXPECT_EQ(std::get<std::int64_t>(summary.counts["trees_by_crown"]), 1);
  EXPECT_EQ(std::get<std::int64_t>(summary.counts["look_again_trees"]), 2);
  EXPECT_EQ(summary.status, RunStatus::kComplete);
  EXPECT_NE(run_json(summary).find("\"notes\": [\n    \"2 of 3"), std::string::npos);
  EXPECT_EQ(terminal_notes(inventory), summary.notes[0] + "\n" + summary.notes[1] + "\n");
}

// Bug: the report of a cloud with 3 cm of noise had this far below its verdict "Complete".
TEST(StandNotes, ABlurredCloudIsToldFirst) {
  InventoryResult inventory;
  inventory.trees = {tree_with(1, 0.2, 0.07, 12.0)};
  inventory.blur_m = 0.04;
  RunSummary summary;
  note_doubts(inventory, summary);
  ASSERT_EQ(summary.notes.size(), 2U);
  EXPECT_EQ(summary.notes[0].rfind("the cloud is blurred: points scatter by 4 cm", 0), 0U);
  EXPECT_EQ(terminal_notes(inventory), summary.notes[0] + "\n" + summary.notes[1] + "\n");
}

TEST(StandNotes, NothingInDoubtGivesNoNote) {
  InventoryResult inventory;
  inventory.trees = {tree_with(1, 0.2, 0.01, 12.0)};
  RunSummary summary;
  note_doubts(inventory, summary);
  EXPECT_TRUE(summary.notes.empty());
  EXPECT_TRUE(terminal_notes(inventory).empty());
}

}  // namespace
}  // namespace understory
