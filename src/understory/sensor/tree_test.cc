#include "understory/sensor/tree.h"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "understory/util/files/csv.h"

namespace understory {
namespace {

TEST(TreeColumns, ARowHasTheCellsOfItsHeaderEmptyWhereUnknown) {
  Tree tree;
  tree.id = 3;
  tree.x = 1.5;
  tree.y = -0.0001;
  tree.z = 12.25;
  tree.dbh_m = 0.23456;
  tree.observations = 99;
  EXPECT_EQ(tree_csv_header().rfind("id,x,y,z,dbh_m,dbh_sd_m,", 0), 0U) << tree_csv_header();
  EXPECT_EQ(tree_csv_row(tree).rfind("3,1.500,0.000,12.250,0.2346,,", 0), 0U) << tree_csv_row(tree);
  EXPECT_EQ(tree_csv_row(tree, 1).rfind("3,1.5000,-0.0001,12.2500,0.23456,,", 0), 0U);
  EXPECT_EQ(split(tree_csv_row(tree), ",", false).size(), kTreeColumns.size());
  EXPECT_EQ(split(tree_csv_header(), ",", false).size(), kTreeColumns.size());
}

TEST(TreeColumns, EachIsExplainedToTheUser) {
  std::ifstream file(UNDERSTORY_SOURCE_DIR "/docs/reference/outputs.md");
  std::stringstream page;
  page << file.rdbuf();
  ASSERT_TRUE(file);
  std::string explained;  // first cells of all rows of tables
  for (std::string line; std::getline(page, line);)
    if (line.rfind("| ", 0) == 0) explained += " " + line.substr(2, line.find(" |", 2) - 2) + ",";
  for (const TreeColumn& column : kTreeColumns)
    EXPECT_NE(explained.find(" " + std::string(column.name) + ","), std::string::npos)
        << column.name << " is in no table of outputs.md";
}

}  // namespace
}  // namespace understory
