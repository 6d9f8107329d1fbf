#include "understory/pipeline/run_folder/relative_path.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <vector>

#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

// 20 poses a scan, each with a turn and a way of its own.
RelativePose relative_pose(int i) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.01 * i, Eigen::Vector3d::UnitZ()));
  return {1'000'000'000 + i * TimeNs{5'000'000}, static_cast<std::uint64_t>(i / 20),
          Pose(turn, {0.1 * i, 0.0, 0.5})};
}

std::string bytes_in(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

Trajectory turned_scans(int count) {
  Trajectory scans;
  for (int i = 0; i < count; ++i) {
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.5 * i, Eigen::Vector3d::UnitX()));
    scans.push_back({i * TimeNs{100'000'000}, Pose(turn, {10.0 * i, 1.0, 2.0})});
  }
  return scans;
}

class RelativePathTest : public ::testing::Test {
 protected:
  const test::TemporaryFolder folder_;
  const fs::path path_ = folder_ / "imu_path.bin";
};

TEST_F(RelativePathTest, PosesAreThoseOfTheirScansTimesTheMotionSince) {
  RelativePath path(path_);
  for (int i = 0; i < 150; ++i)
    path.add(relative_pose(i));
  const Trajectory scans = turned_scans(8);
  EXPECT_EQ(write_relative_path(folder_ / "imu.tum", path, scans), 150U);
  const Trajectory written = read_trajectory(folder_ / "imu.tum");
  ASSERT_EQ(written.size(), 150U);
  for (int i : {0, 63, 64, 149}) {
    const RelativePose relative = relative_pose(i);
    const Pose& scan = scans[relative.scan].world_from_body;
    EXPECT_EQ(written[static_cast<std::size_t>(i)].stamp, relative.stamp);
    // By hand: R_scan t + t_scan.
    const Eigen::Vector3d expected =
        scan.rotation() * relative.scan_from_body.translation() + scan.translation();
    const Pose& found = written[static_cast<std::size_t>(i)].world_from_body;
    EXPECT_LT((found.translation() - expected).norm(), 2e-9);
    const Eigen::Quaterniond turned = scan.rotation() * relative.scan_from_body.rotation();
    EXPECT_LT(found.rotation().angularDistance(turned), 1e-8);
  }
}

TEST_F(RelativePathTest, ARunThatWasCutAndGoesOnWritesTheSameBytes) {
  RelativePath whole(folder_ / "whole.bin");
  for (int i = 0; i < 100; ++i)
    whole.add(relative_pose(i));
  RecordCount known;
  {
    RelativePath cut(path_);
    for (int i = 0; i < 70; ++i)
      cut.add(relative_pose(i));
    cut.sync();
    known = cut.count();
    for (int i = 70; i < 90; ++i)  // after the checkpoint: done again
      cut.add(relative_pose(i));
    cut.sync();
  }
  RelativePath resumed(path_, known);
  for (int i = 70; i < 100; ++i)
    resumed.add(relative_pose(i));
  const Trajectory scans = turned_scans(5);
  (void)write_relative_path(folder_ / "whole.tum", whole, scans);
  (void)write_relative_path(folder_ / "resumed.tum", resumed, scans);
  EXPECT_EQ(bytes_in(folder_ / "whole.tum"), bytes_in(folder_ / "resumed.tum"));
}

TEST_F(RelativePathTest, RecordsOfAnotherLengthAreDamage) {
  {
    RecordFile file(path_);
    file.append({bytes_of(std::string("short"))});
  }
  RecordFile other(folder_ / "again.bin");
  other.append({bytes_of(std::string("short"))});
  RelativePath path(path_, other.count());
  EXPECT_THROW(path.for_each([](const RelativePose&) {}), InputError);
}

}  // namespace
}  // namespace understory
