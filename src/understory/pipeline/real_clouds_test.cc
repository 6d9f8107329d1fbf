// Real clouds (README of the example data): none is refused, and turned or scaled each one is.

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <filesystem>

#include "understory/forest/cloud_shape.h"
#include "understory/recording/clouds/cloud_file.h"
#include "understory/recording/recording_test_support.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

using test::data_folder;

PointBlocks blocks_of(const PointCloudFile& cloud, const Eigen::Matrix3d& change) {
  return [&cloud, change](const PointVisitor& visit) {
    std::vector<Eigen::Vector3d> points;
    for (const Eigen::Vector3f& point : cloud.points)
      points.emplace_back(change * (cloud.origin + point.cast<double>()));
    visit(points);
  };
}

const std::vector<std::string>& stands() {
  static const std::vector<std::string> names = {
      "spanner_mls_uas_als/MLS_Clip.laz", "spanner_mls_uas_als/UAS_Clip.laz",
      "spanner_mls_uas_als/ALS_Clip.laz", "treels/pine_plot.laz", "chablais3/las_chablais3.laz"};
  return names;
}

TEST(RealClouds, NoneIsRefused) {
  std::vector<std::string> names = stands();
  for (const char* slice :
       {"treels/pine.laz", "fortls/diameters.laz", "arbor_dbh_slices/complex_slice0.las",
        "arbor_dbh_slices/double_ring_slice0.las", "arbor_dbh_slices/ring50.las",
        "arbor_dbh_slices/slice_buttress.las"})
    names.emplace_back(slice);
  if (!fs::exists(data_folder() / names.front())) GTEST_SKIP();
  for (const std::string& name : names) {
    Log log;
    const PointCloudFile cloud = read_cloud((data_folder() / name).string(), log);
    const CloudShape shape = shape_of(blocks_of(cloud, Eigen::Matrix3d::Identity()));
    EXPECT_EQ(up_complaint(shape), "") << name;
    EXPECT_EQ(unit_complaint(shape), "") << name;
    RecordProperty(name, shape.column_height);
    std::printf(
        "%-42s roughness z %.3f -z %.3f x %.3f -x %.3f y %.3f -y %.3f, height %.1f, slope "
        "%.0f deg, alone %.3f\n",
        name.c_str(), shape.roughness[0], shape.roughness[1], shape.roughness[2],
        shape.roughness[3], shape.roughness[4], shape.roughness[5], shape.column_height,
        shape.ground_slope_deg, shape.alone_share);
  }
}

TEST(RealClouds, TurnedOrScaledEachStandIsNoticed) {
  if (!fs::exists(data_folder() / stands().front())) GTEST_SKIP();
  for (const std::string& name : stands()) {
    Log log;
    const PointCloudFile cloud = read_cloud((data_folder() / name).string(), log);
    for (const UpAxis axis : kUpAxes) {
      const auto found =
          other_up_axis(shape_of(blocks_of(cloud, upright_from_cloud(axis).transpose())));
      EXPECT_EQ(found.value_or(UpAxis::kZ), axis) << name << " with " << to_string(axis) << " up";
    }
    // The lower side up, mirrored: the cells of the grid fall otherwise.
    const Eigen::Matrix3d mirror = Eigen::Vector3d(1.0, 1.0, -1.0).asDiagonal();
    EXPECT_EQ(other_up_axis(shape_of(blocks_of(cloud, mirror))), UpAxis::kMinusZ) << name;
    for (const double scale : {1000.0, 100.0})
      EXPECT_NE(unit_complaint(shape_of(blocks_of(cloud, scale * Eigen::Matrix3d::Identity()))), "")
          << name << " times " << scale;
  }
}

// Those from aeroplanes (ALS, Chablais) show too few stems.
TEST(RealClouds, StemsTellATiltedScanner) {
  if (!fs::exists(data_folder() / stands().front())) GTEST_SKIP();
  for (const std::string& name : {stands()[0], stands()[1], stands()[3]}) {
    Log log;
    const PointCloudFile cloud = read_cloud((data_folder() / name).string(), log);
    for (const double tilt : {20.0, 40.0, 60.0}) {
      const Eigen::Matrix3d turn =
          Eigen::AngleAxisd(tilt * M_PI / 180.0, Eigen::Vector3d(0.6, 0.8, 0.0)).matrix();
      const CloudShape shape = shape_of(blocks_of(cloud, turn));
      EXPECT_NE(up_complaint(shape), "") << name << " tilted by " << tilt;
      if (const auto axis = leaning_axis(shape)) {
        EXPECT_GT(axis->dot(turn.col(2)), 0.995) << name;
      }
    }
  }
}

TEST(RealClouds, ASliceInMillimetresIsNoticed) {
  for (const char* name : {"fortls/diameters.laz"}) {
    if (!fs::exists(data_folder() / name)) GTEST_SKIP();
    Log log;
    const PointCloudFile cloud = read_cloud((data_folder() / name).string(), log);
    EXPECT_NE(unit_complaint(shape_of(blocks_of(cloud, 1000.0 * Eigen::Matrix3d::Identity()))), "")
        << name;
  }
}

}  // namespace
}  // namespace understory
