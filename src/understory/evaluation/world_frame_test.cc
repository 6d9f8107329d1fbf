#include "understory/evaluation/world_frame.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <fstream>
#include <sstream>

#include "understory/evaluation/trajectory.h"
#include "understory/evaluation/trees/tree_errors.h"
#include "understory/evaluation/trees/tree_falls.h"
#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

constexpr const char* kPath =
    "1.000000000 0.000000000 0.000000000 0.000000000 0.000000000 0.000000000 0.000000000 "
    "1.000000000\n"
    "1.100000000 1.234567891 -2.500000000 0.750000000 0.182574186 0.365148372 0.547722558 "
    "0.730296743\n"
    "1.200000000 -3.000000000 4.000000000 -1.000000000 -0.500000000 0.500000000 -0.500000000 "
    "0.500000000\n";

class WorldFrameTest : public ::testing::Test {
 protected:
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
  }
  [[nodiscard]] std::string text(const std::string& name) const {
    std::ifstream file(folder_ / name);
    std::ostringstream content;
    content << file.rdbuf();
    return content.str();
  }
  // As a run that has turned its files.
  void turn(const std::string& name) const {
    turn_to_ned(folder_.path());
    write("run.json", R"({"frames": {")" + name + R"(": "world_ned"}})");
  }

  const test::TemporaryFolder folder_;
};

// By rotation matrices, not by quaternions as the program does it.
TEST_F(WorldFrameTest, APoseTurnsAboutTheWorldNotAboutTheBody) {
  write("trajectory.tum", kPath);
  const Trajectory before = read_trajectory(folder_ / "trajectory.tum");
  turn_to_ned(folder_.path());  // without run.json its numbers are read as they are
  const Trajectory after = read_trajectory(folder_ / "trajectory.tum");
  Eigen::Matrix3d ned_from_enu;
  ned_from_enu << 0, 1, 0, 1, 0, 0, 0, 0, -1;
  ASSERT_EQ(after.size(), 3U);
  for (std::size_t i = 0; i < before.size(); ++i) {
    const Pose& enu = before[i].world_from_body;
    const Pose& ned = after[i].world_from_body;
    EXPECT_EQ(ned.translation(), ned_from_enu * enu.translation());
    EXPECT_TRUE(ned.rotation().toRotationMatrix().isApprox(
        ned_from_enu * enu.rotation().toRotationMatrix(), 2e-9));
    EXPECT_EQ(after[i].stamp, before[i].stamp);
  }
  EXPECT_EQ(text("trajectory.tum").find("-0.000000000 "), std::string::npos);
}

TEST_F(WorldFrameTest, AReaderGetsTheNumbersOfBefore) {
  write("trajectory.tum", kPath);
  const Trajectory before = read_trajectory(folder_ / "trajectory.tum");
  turn("trajectory.tum");
  EXPECT_NE(text("trajectory.tum"), kPath);
  const Trajectory after = read_trajectory(folder_ / "trajectory.tum");
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_EQ(after[i].world_from_body.translation(), before[i].world_from_body.translation());
    EXPECT_EQ(after[i].world_from_body.rotation().coeffs(),
              before[i].world_from_body.rotation().coeffs());
  }
  EXPECT_EQ(world_frame_of_run(folder_.path()), WorldFrame::kNed);
}

TEST_F(WorldFrameTest, OfATableOnlyWhatIsOfTheWorldTurns) {
  write("gnss.csv",
        "timestamp,x,y,z,latitude_deg,c00,residual_x,residual_y,residual_z,used,reason\n"
        "5.000000000,1.5,2.5,-3.5,61.2,0.04,0.1,-0.2,0.0,0,\"far, \"\"very\"\"\"\n"
        "6.000000000,,,,61.3,0.05,,,,0,no fit\n");
  turn_to_ned(folder_.path());
  EXPECT_EQ(text("gnss.csv"),
            "timestamp,x,y,z,latitude_deg,c00,residual_x,residual_y,residual_z,used,reason\n"
            "5.000000000,2.5,1.5,3.5,61.2,0.04,-0.2,0.1,0.0,0,\"far, \"\"very\"\"\"\n"
            "6.000000000,,,,61.3,0.05,,,,0,no fit\n");
}

// Biases are of the IMU, and covariances of right perturbations: both are in the body's axes.
TEST_F(WorldFrameTest, VelocitiesTurnAndBiasesStay) {
  const std::string rows =
      "timestamp,vx,vy,vz,gx,gy,gz,ax,ay,az,c00,c01\n"
      "1.000000000,0.1,0.2,0.3,4,5,6,7,8,9,1e-3,2e-4\n";
  write("states.csv.gz", rows);  // plain: readers go by the content
  const std::vector<StampedVelocity> before = read_velocities(folder_ / "states.csv.gz");
  turn("states.csv.gz");
  EXPECT_EQ(read_velocities(folder_ / "states.csv.gz")[0].velocity_in_world,
            before[0].velocity_in_world);
  write("run.json", "{}");
  EXPECT_EQ(read_velocities(folder_ / "states.csv.gz")[0].velocity_in_world,
            Eigen::Vector3d(0.2, 0.1, -0.3));
}

TEST_F(WorldFrameTest, TreesAndFallsKeepWhatHasNoDirection) {
  write("trees.csv", "id,x,y,z,dbh_m,height_m,x_sd_m,y_sd_m\n7,1,2,0.5,0.3,20,0.01,0.04\n");
  write("felled.csv", "id,x,y,seen_until,gone_since,missed\n7,1,2,3.0,4.0,5\n");
  turn_to_ned(folder_.path());
  EXPECT_EQ(text("trees.csv"),
            "id,x,y,z,dbh_m,height_m,x_sd_m,y_sd_m\n7,2,1,-0.5,0.3,20,0.04,0.01\n");
  write("run.json", R"({"frames": {"trees.csv": "world_ned", "felled.csv": "world_ned"}})");
  const Tree tree = read_trees(folder_ / "trees.csv").at(0);
  EXPECT_EQ(Eigen::Vector3d(tree.x, tree.y, tree.z), Eigen::Vector3d(1, 2, 0.5));
  EXPECT_EQ(tree.x_sd_m, 0.01);
  EXPECT_EQ(tree.y_sd_m, 0.04);
  const TreeFall fall = read_tree_falls(folder_ / "felled.csv").at(0);
  EXPECT_EQ(fall.x, 1.0);
  EXPECT_EQ(fall.y, 2.0);
}

TEST_F(WorldFrameTest, EdgesOfTheGraphLeadFromBodyToBody) {
  const std::string edge = "EDGE_SE3:QUAT 0 1 1.0 2.0 3.0 0.0 0.0 0.0 1.0 5.0 6.0\n";
  write("graph.g2o", "VERTEX_SE3:QUAT 0 1.0 2.0 3.0 0.0 0.0 0.0 1.0\nFIX 0\n" + edge);
  turn_to_ned(folder_.path());
  EXPECT_EQ(text("graph.g2o"),
            "VERTEX_SE3:QUAT 0 2.0 1.0 -3.0 0.707106781187 0.707106781187 0.000000000000 "
            "0.000000000000\nFIX 0\n" +
                edge);
}

TEST_F(WorldFrameTest, OtherFilesBesideItStay) {
  write("trajectory.tum", kPath);
  write("mine.tum", kPath);
  turn("trajectory.tum");
  EXPECT_EQ(text("mine.tum"), kPath);
  EXPECT_EQ(world_frame_of(folder_ / "mine.tum"), WorldFrame::kEnu);
  EXPECT_EQ(read_trajectory(folder_ / "mine.tum")[1].world_from_body.translation().x(),
            1.234567891);
}

TEST_F(WorldFrameTest, ADamagedRunThatTellsOfNedIsRefused) {
  write("trajectory.tum", kPath);
  write("run.json", R"({"frames": {"trajectory.tum": "world_ned")");
  EXPECT_THROW((void)read_trajectory(folder_ / "trajectory.tum"), InputError);
  write("run.json", R"({"config": {"output": {"world_frame": "ned"}, "geo)");
  EXPECT_THROW((void)read_trajectory(folder_ / "trajectory.tum"), InputError);
  write("run.json", R"({"status": "comp)");
  EXPECT_EQ(read_trajectory(folder_ / "trajectory.tum").size(), 3U);
}

TEST_F(WorldFrameTest, AReaderStillNamesTheLineThatIsBad) {
  write("trajectory.tum", std::string(kPath) + "2 0 nan 0 0 0 0 1\n");
  write("run.json", R"({"frames": {"trajectory.tum": "world_ned"}})");
  try {
    (void)read_trajectory(folder_ / "trajectory.tum");
    FAIL() << "no error";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("line 4"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace understory
