#include "understory/evaluation/trajectory.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <fstream>

#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

class TrajectoryFile : public ::testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path write(const std::string& text) {
    std::ofstream(path_) << text;
    return path_;
  }

  std::string message_of(const std::string& text) {
    try {
      (void)read_trajectory(write(text));
    } catch (const InputError& error) {
      return error.what();
    }
    return "no error";
  }

  const test::TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "path.tum";
};

TEST_F(TrajectoryFile, KeepsEveryNanosecondAndPassesOverComments) {
  const Trajectory poses =
      read_trajectory(write("# a comment\n\n1700000000.123456789 1 2 3 0 0 0 1\n"
                            "1700000000.2,4,5,6,0,0,2,0\r\n"
                            "1.7000000003e9\t7 8 9 0 0 0 1  \n"));
  ASSERT_EQ(poses.size(), 3u);
  EXPECT_EQ(poses[0].stamp, 1700000000123456789);
  EXPECT_EQ(poses[1].stamp, 1700000000200000000);
  EXPECT_EQ(poses[2].stamp, 1700000000300000000);
  EXPECT_EQ(poses[1].world_from_body.translation(), Eigen::Vector3d(4, 5, 6));
  EXPECT_NEAR(poses[1].world_from_body.rotation().z(), 1.0, 1e-15) << "not normalised";
}

TEST_F(TrajectoryFile, SortsByTime) {
  const Trajectory poses = read_trajectory(write("2 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n"));
  EXPECT_EQ(poses[0].stamp, kNsPerSecond);
}

TEST_F(TrajectoryFile, NamesTheLineThatIsBad) {
  const std::string good = "1 0 0 0 0 0 0 1\n";
  EXPECT_NE(message_of(good + "2 0 0 0 0 0 1\n").find("line 2"), std::string::npos);
  EXPECT_NE(message_of(good + good + "2 0 nan 0 0 0 0 1\n").find("line 3"), std::string::npos);
  EXPECT_NE(message_of("2 0 0 0 0 0 0 0\n").find("quaternion"), std::string::npos);
  EXPECT_NE(message_of("x 0 0 0 0 0 0 1\n").find("'x' for a time"), std::string::npos);
  EXPECT_NE(message_of("# nothing\n").find("at least one pose"), std::string::npos);
  EXPECT_THROW((void)read_trajectory("/no/such/file.tum"), InputError);
}

TEST_F(TrajectoryFile, ReadsVelocitiesByColumnNamePlainOrGzip) {
  const std::string text = "timestamp,gx,vz,vy,vx\n1.5,9,3,2,1\n0.5,9,6,5,4\n2.5,9,,,\n";
  const std::vector<StampedVelocity> plain = read_velocities(write(text));
  ASSERT_EQ(plain.size(), 2u);
  EXPECT_EQ(plain[0].velocity_in_world, Eigen::Vector3d(4, 5, 6));
  gzFile file = gzopen(path_.c_str(), "wb");
  gzwrite(file, text.data(), static_cast<unsigned>(text.size()));
  gzclose(file);
  const std::vector<StampedVelocity> packed = read_velocities(path_);
  ASSERT_EQ(packed.size(), 2u);
  EXPECT_EQ(packed[1].velocity_in_world, plain[1].velocity_in_world);
  std::filesystem::resize_file(path_, std::filesystem::file_size(path_) / 2);
  EXPECT_THROW((void)read_velocities(path_), InputError) << "a truncated stream";
  EXPECT_THROW((void)read_velocities(write("timestamp,vx,vy\n")), InputError);
  EXPECT_THROW((void)read_velocities(write("timestamp,vx,vy,vz\n1,2,x,4\n")), InputError);
}

}  // namespace
}  // namespace understory
