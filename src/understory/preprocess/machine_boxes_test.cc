#include "understory/preprocess/machine_boxes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>

#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/random.h"

namespace understory {
namespace {

MachineBox boom() {
  MachineBox box;
  box.name = "boom";
  box.frame_from_box =
      Pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 1, 0).normalized())),
           Eigen::Vector3d(2.5, 0.4, 1.0));
  box.size_m = {4.0, 0.6, 0.5};
  box.joint = MachineBox::Joint::kRevolute;
  box.joint_origin = {0.2, 0.1, 0.5};
  box.joint_axis = Eigen::Vector3d(0.1, -0.2, 1.0).normalized();
  return box;
}

Eigen::Vector3d somewhere(Random& random) {
  return {random.uniform(-6, 6), random.uniform(-6, 6), random.uniform(-2, 4)};
}

// The swept box against a fine sampling of its values; points whose answer hangs on less than the
// sampling are left to chance and few.
void compare_with_sampling(MachineBox box, double low, double high) {
  box.value = MachineBox::Value::kSwept;
  box.low = low;
  box.high = high;
  Random random(4);
  int inside = 0;
  int differ = 0;
  for (int i = 0; i < 4000; ++i) {
    const Eigen::Vector3d p = somewhere(random);
    bool sampled = false;
    for (int k = 0; k <= 2000 && !sampled; ++k) {
      MachineBox fixed = box;
      fixed.value = MachineBox::Value::kConstant;
      fixed.constant = low + (high - low) * k / 2000.0;
      sampled = inside_box(fixed, p, 0);
    }
    const bool swept = inside_box(box, p, 0);
    EXPECT_TRUE(swept || !sampled) << "sampled inside but not swept";
    inside += swept ? 1 : 0;
    differ += swept != sampled ? 1 : 0;
  }
  EXPECT_GT(inside, 30);
  EXPECT_LE(differ, 4);
}

TEST(MachineBoxes, SweptTurnCoversExactlyItsPositions) {
  compare_with_sampling(boom(), -0.8, 1.1);
  compare_with_sampling(boom(), 2.5, 2.5 + 5.0);
}

TEST(MachineBoxes, SweptSlideCoversExactlyItsPositions) {
  MachineBox box = boom();
  box.joint = MachineBox::Joint::kPrismatic;
  compare_with_sampling(box, -1.0, 3.0);
}

TEST(MachineBoxes, SeriesFollowsTheJointBetweenItsSamples) {
  MachineBox box = boom();
  box.value = MachineBox::Value::kSeries;
  box.series = {{1'000'000'000, 0.0}, {2'000'000'000, 1.0}};
  const Eigen::Vector3d tip = box.frame_from_box * Eigen::Vector3d(1.9, 0, 0);
  const auto turned = [&](double value) -> Eigen::Vector3d {
    return box.joint_origin + Eigen::AngleAxisd(value, box.joint_axis) * (tip - box.joint_origin);
  };
  EXPECT_TRUE(inside_box(box, turned(0.0), 0));
  EXPECT_TRUE(inside_box(box, turned(0.5), 1'500'000'000));
  EXPECT_FALSE(inside_box(box, turned(0.0), 1'500'000'000));
  EXPECT_TRUE(inside_box(box, turned(1.0), 5'000'000'000));
}

TEST(MachineBoxes, ScanPointsAreTestedInTheFrameOfTheBox) {
  Rig rig;
  rig.body_from_lidar = Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, 2.0));
  MachineBox cabin;
  cabin.name = "cabin";
  cabin.size_m = {2, 2, 2};
  Scan scan;
  scan.points.resize(3);
  scan.points[0].z = -1.5F;  // 0.5 m above the body's origin
  scan.points[1].z = 0.5F;
  scan.points[2].x = 5.0F;
  EXPECT_EQ(outside_machine(scan, rig, {cabin}), (std::vector<std::uint8_t>{0, 1, 1}));
  cabin.frame = MachineBox::Frame::kLidar;
  EXPECT_EQ(outside_machine(scan, rig, {cabin}), (std::vector<std::uint8_t>{1, 0, 1}));
  EXPECT_EQ(outside_machine(scan, rig, {}), (std::vector<std::uint8_t>{1, 1, 1}));
}

class BoxFile : public ::testing::Test {
 protected:
  std::string write(const std::string& name, const std::string& text) {
    const std::string path = (folder_ / name).string();
    std::ofstream(path) << text;
    return path;
  }
  const test::TemporaryFolder folder_;
};

TEST_F(BoxFile, ReadsAllKinds) {
  write("boom.csv", "timestamp,value\n1.5,10\n2.5,20\n");
  const std::string path = write("boxes.yaml", R"(boxes:
  - name: cabin
    center_m: [0, 0, 1]
    size_m: [2, 2, 3]
  - name: boom
    frame: lidar
    center_m: [3, 0, 0]
    rotation_deg: [0, 0, 90]
    size_m: [6, 1, 1]
    joint: {type: revolute, axis: [0, 0, 2], series: boom.csv}
  - name: blade
    center_m: [3, 0, 0]
    size_m: [1, 3, 1]
    joint: {type: prismatic, axis: [0, 0, 1], range_m: [-0.5, 1]}
)");
  const std::vector<MachineBox> boxes = read_machine_boxes(path);
  ASSERT_EQ(boxes.size(), 3U);
  EXPECT_EQ(boxes[0].joint, MachineBox::Joint::kFixed);
  EXPECT_EQ(boxes[1].frame, MachineBox::Frame::kLidar);
  ASSERT_EQ(boxes[1].series.size(), 2U);
  EXPECT_EQ(boxes[1].series[0].stamp, 1'500'000'000);
  EXPECT_NEAR(boxes[1].series[1].value, 20.0 * std::numbers::pi / 180.0, 1e-12);
  EXPECT_EQ(boxes[1].joint_axis, Eigen::Vector3d::UnitZ());
  EXPECT_TRUE(inside_box(boxes[2], {3, 1, 1.4}, 0));
  EXPECT_FALSE(inside_box(boxes[2], {3, 1, 1.6}, 0));
}

TEST_F(BoxFile, ReportsAllProblemsAtOnce) {
  const std::string path = write("boxes.yaml", R"(boxes:
  - name: cabin
    centre_m: [0, 0, 1]
    size_m: [2, -2, 3]
  - name: boom
    center_m: [3, 0]
    size_m: [6, 1, 1]
    joint: {type: revolute, value_m: 1}
)");
  try {
    (void)read_machine_boxes(path);
    FAIL() << "no error";
  } catch (const ConfigError& error) {
    EXPECT_GE(error.problems().size(), 5U);
    const std::string all = error.what();
    EXPECT_NE(all.find("centre_m"), std::string::npos);
    EXPECT_NE(all.find("value_m"), std::string::npos);
    EXPECT_NE(all.find("line 6"), std::string::npos);
  }
}

TEST_F(BoxFile, ABrokenSeriesNamesTheLine) {
  write("boom.csv", "timestamp,value\n1.5,10\n1.5,x\n");
  const std::string path = write("boxes.yaml", R"(boxes:
  - {name: b, center_m: [0,0,0], size_m: [1,1,1], joint: {type: revolute, series: boom.csv}}
)");
  try {
    (void)read_machine_boxes(path);
    FAIL() << "no error";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("line 3"), std::string::npos);
  }
}

}  // namespace
}  // namespace understory
