#include "understory/pipeline/georeferencing/moved_tables.h"

#include <gtest/gtest.h>

#include <fstream>
#include <numbers>
#include <sstream>

#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

void write_table(const fs::path& path, const std::string& text) {
  std::ofstream(path) << text;
}

std::string table_at(const fs::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

// These tables were left behind, though the whole run is moved.
TEST(MovedTables, PlacesMoveAndAllElseStays) {
  const test::TemporaryFolder both;
  const fs::path from = both / "run";
  const fs::path to = both / "result";
  fs::create_directory(from);
  fs::create_directory(to);
  write_table(from / "stem_curves.csv",
              "tree_id,height_m,x,y,diameter_m\n7,1.30,2.000,1.000,0.2\n");
  write_table(from / "dead_wood.csv",
              "id,kind,x,y,z,x_to,y_to,z_to,length_m\n1,log,1.000,0.000,5.000,3,0,6,2.24\n");
  write_table(from / "plots.csv", "plot,kind,x,y,trees\nseen,seen,,,9\n\"A, b\",circle,4,5,3\n");
  write_table(from / "plot_classes.csv", "plot,trees\nseen,9\n");
  Tree tree;
  tree.id = 7;
  tree.z = 2.0;
  // A quarter of a turn to the left, 10 m east, 1 m down.
  const Pose motion(
      Eigen::Quaterniond(Eigen::AngleAxisd(0.5 * std::numbers::pi, Eigen::Vector3d::UnitZ())),
      Eigen::Vector3d(10.0, 0.0, -1.0));
  write_moved_tables(from, to, {tree}, motion);
  EXPECT_EQ(table_at(to / "stem_curves.csv"),
            "tree_id,height_m,x,y,diameter_m\n7,1.30,9.000,2.000,0.2\n");
  EXPECT_EQ(table_at(to / "dead_wood.csv"),
            "id,kind,x,y,z,x_to,y_to,z_to,length_m\n"
            "1,log,10.000,1.000,4.000,10.000,3.000,5.000,2.24\n");
  EXPECT_EQ(table_at(to / "plots.csv"),
            "plot,kind,x,y,trees\nseen,seen,,,9\n\"A, b\",circle,5.000,4.000,3\n");
  EXPECT_EQ(table_at(to / "plot_classes.csv"), "plot,trees\nseen,9\n");
}

// The centre of a leaning axis is moved at its own height.
TEST(MovedTables, StemCurvesTiltWithTheirTree) {
  const test::TemporaryFolder both;
  const fs::path from = both / "run";
  const fs::path to = both / "result";
  fs::create_directory(from);
  fs::create_directory(to);
  write_table(from / "stem_curves.csv",
              "tree_id,height_m,x,y,diameter_m\n7,3.00,0.000,1.000,0.2\n");
  Tree tree;
  tree.id = 7;
  tree.z = 2.0;
  const Pose motion(
      Eigen::Quaterniond(Eigen::AngleAxisd(0.5 * std::numbers::pi, Eigen::Vector3d::UnitX())),
      Eigen::Vector3d::Zero());
  write_moved_tables(from, to, {tree}, motion);
  EXPECT_EQ(table_at(to / "stem_curves.csv"),
            "tree_id,height_m,x,y,diameter_m\n7,3.00,0.000,-5.000,0.2\n");
}

}  // namespace
}  // namespace understory
