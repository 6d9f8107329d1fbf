#include "understory/forest/cloud_shape.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <vector>

#include "understory/forest/test_plot.h"
#include "understory/util/random.h"

namespace understory {
namespace {

// A plot of 30 m on a slope: rolling ground, stems of 20 m with crowns that start half way up.
Cloud stand_on_slope(double slope = 0.15) {
  Random random(5);
  const auto ground = [&](double x, double y) { return slope * x + 0.5 * std::sin(0.3 * y); };
  Cloud points;
  for (int i = 0; i < 40'000; ++i) {
    const double x = random.uniform(0.0, 30.0);
    const double y = random.uniform(0.0, 30.0);
    points.emplace_back(x, y, ground(x, y) + random.normal(0.0, 0.02));
  }
  for (int tree = 0; tree < 60; ++tree) {
    const double x = random.uniform(0.0, 30.0);
    const double y = random.uniform(0.0, 30.0);
    for (int i = 0; i < 800; ++i) {
      const double h = random.uniform(0.0, 20.0);
      const double a = random.uniform(0.0, 2.0 * M_PI);
      const double r = h < 10.0 ? 0.12 : random.uniform(0.0, 0.2 * (21.0 - h));
      points.emplace_back(x + r * std::cos(a), y + r * std::sin(a), ground(x, y) + h);
    }
  }
  return points;
}

Cloud changed(const Cloud& points, const Eigen::Matrix3d& change) {
  Cloud result;
  for (const Eigen::Vector3d& point : points)
    result.emplace_back(change * point + Eigen::Vector3d(4.1e5, 6.7e6, 120.0));
  return result;
}

CloudShape shape_of(const Cloud& points) {
  return understory::shape_of([&](const PointVisitor& visit) { visit(points); });
}

TEST(CloudShape, AStandInMetresIsLeftAlone) {
  for (const double slope : {0.0, 0.15, 0.8}) {
    const CloudShape shape = shape_of(changed(stand_on_slope(slope), Eigen::Matrix3d::Identity()));
    EXPECT_EQ(up_complaint(shape), "") << slope;
    EXPECT_EQ(unit_complaint(shape), "") << slope;
    EXPECT_LT(shape.roughness[0], 0.1) << slope;
    EXPECT_NEAR(shape.column_height, 18.0, 4.0) << slope;
    EXPECT_NEAR(shape.ground_slope_deg, std::atan(slope) * 180.0 / M_PI, 3.0);
  }
}

TEST(CloudShape, TheAxisThatIsUpIsNamed) {
  for (const UpAxis axis : kUpAxes) {
    // upright_from_cloud undoes what this does.
    const Cloud turned = changed(stand_on_slope(), upright_from_cloud(axis).transpose());
    const auto found = other_up_axis(shape_of(turned));
    if (axis == UpAxis::kZ) {
      EXPECT_FALSE(found.has_value());
      continue;
    }
    ASSERT_TRUE(found.has_value()) << to_string(axis);
    EXPECT_EQ(*found, axis) << to_string(*found);
    EXPECT_NE(up_complaint(shape_of(turned)).find("along " + to_string(axis)), std::string::npos);
    EXPECT_NEAR(upright_from_cloud(axis).determinant(), 1.0, 1e-12);
  }
}

TEST(CloudShape, GroundThatIsSteeperThanForestsStandOnIsNotLevel) {
  const CloudShape shape = shape_of(changed(stand_on_slope(1.5), Eigen::Matrix3d::Identity()));
  EXPECT_NE(up_complaint(shape).find("inclined by 5"), std::string::npos)
      << shape.ground_slope_deg << ' ' << shape.roughness[0];
}

TEST(CloudShape, OtherUnitsAreTold) {
  const Cloud points = stand_on_slope();
  const auto complaint = [&](double scale) {
    return unit_complaint(shape_of(changed(points, scale * Eigen::Matrix3d::Identity())));
  };
  EXPECT_NE(complaint(1000.0).find("millimetres"), std::string::npos);
  EXPECT_NE(complaint(100.0).find("centimetres"), std::string::npos);
  EXPECT_EQ(complaint(1.0 / 0.3048), "");  // feet are suspected at most
  const Eigen::Matrix3d degrees = Eigen::Vector3d(1e-5, 1e-5, 1.0).asDiagonal();
  EXPECT_NE(unit_complaint(shape_of(changed(points, degrees))).find("degrees"), std::string::npos);
}

TEST(CloudShape, FeetAreSuspectedWhereAStandIsTall) {
  const auto suspicion = [&](double scale) {
    return feet_suspicion(shape_of(changed(stand_on_slope(), scale * Eigen::Matrix3d::Identity())));
  };
  EXPECT_EQ(suspicion(1.0), "");
  EXPECT_NE(suspicion(1.0 / 0.3048).find("usual for feet"), std::string::npos);
  EXPECT_EQ(suspicion(1000.0), "");  // refused already
}

// Scanners that stood aslant: the ground tells nothing below 50 degrees, the stems do.
TEST(CloudShape, TheDirectionOfStemsTellsATiltedScanner) {
  for (const double slope : {0.0, 0.3}) {
    for (const double tilt : {20.0, 35.0, 60.0}) {
      for (const double around : {0.2, 2.3}) {
        const Eigen::Vector3d hinge(std::cos(around), std::sin(around), 0.0);
        const Eigen::Matrix3d turn = Eigen::AngleAxisd(tilt * M_PI / 180.0, hinge).matrix();
        const CloudShape shape = shape_of(changed(stand_on_slope(slope), turn));
        if (other_up_axis(shape)) continue;  // told already
        const auto axis = leaning_axis(shape);
        ASSERT_TRUE(axis.has_value()) << slope << ' ' << tilt << ' ' << around;
        EXPECT_LT(std::acos(axis->dot(turn.col(2))) * 180.0 / M_PI, 4.0);
        EXPECT_NE(up_complaint(shape).find("stems lean by"), std::string::npos);
      }
    }
  }
}

TEST(CloudShape, ASliceHasNoGroundAndIsNoDefect) {
  Cloud slice;
  for (const Eigen::Vector3d& point : stand_on_slope(0.0))
    if (point.z() > 1.2 && point.z() < 1.4) slice.push_back(point);
  ASSERT_GT(slice.size(), 100U);
  const CloudShape shape = shape_of(slice);
  EXPECT_EQ(up_complaint(shape), "");
  EXPECT_EQ(unit_complaint(shape), "");
  EXPECT_EQ(unit_complaint(shape_of(Cloud(3, Eigen::Vector3d(1, 2, 3)))), "");
  EXPECT_EQ(up_complaint(shape_of(Cloud())), "");
}

}  // namespace
}  // namespace understory
