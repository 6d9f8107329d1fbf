#include "understory/preprocess/point_order.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <utility>

#include "understory/util/random.h"

namespace understory {
namespace {

void add_return(Scan& scan, const Eigen::Vector3d& direction, double range, double t_s) {
  const Eigen::Vector3d p = range * direction;
  ScanPoint point;
  point.x = static_cast<float>(p.x());
  point.y = static_cast<float>(p.y());
  point.z = static_cast<float>(p.z());
  point.t_ns = static_cast<std::uint32_t>(1e9 * t_s);
  scan.points.push_back(point);
}

// Beams of a spinning lidar fire one after another or at once; some give nothing.
Scan spinning(int beams, bool at_once, const Eigen::Matrix3d& mount) {
  Random random(3);
  Scan scan;
  for (int column = 0; column < 900; ++column) {
    for (int beam = 0; beam < beams; ++beam) {
      if (random.uniform(0.0, 1.0) < 0.4) continue;
      const double azimuth = 2.0 * M_PI * column / 900.0;
      const double elevation = (beam * 7 % beams - 0.5 * beams) * 0.7 / beams;
      add_return(
          scan,
          mount * Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth),
                                  std::cos(elevation) * std::sin(azimuth), std::sin(elevation)),
          random.uniform(3.0, 30.0), (column + (at_once ? 0.0 : 0.9 * beam / beams)) / 9000.0);
    }
  }
  return scan;
}

// Two prisms that turn at different rates: a rosette that does not repeat, over 70 degrees.
Scan rosette() {
  Random random(4);
  Scan scan;
  for (int i = 0; i < 20'000; ++i) {
    const double t = i / 2e5;
    const double a = 2.0 * M_PI * 121.6 * t;
    const double b = -2.0 * M_PI * 77.3 * t;
    const Eigen::Vector2d at(0.31 * (std::cos(a) + std::cos(b)),
                             0.31 * (std::sin(a) + std::sin(b)));
    add_return(scan, Eigen::Vector3d(1.0, at.x(), at.y()).normalized(), random.uniform(3.0, 30.0),
               t);
  }
  return scan;
}

void shuffle_rows(Scan& scan) {
  for (std::size_t i = scan.points.size(); i > 1; --i)
    std::swap(scan.points[i - 1], scan.points[hash_numbers(i, 5) % i]);
}

void shuffle_times(Scan& scan) {
  for (std::size_t i = scan.points.size(); i > 1; --i)
    std::swap(scan.points[i - 1].t_ns, scan.points[hash_numbers(i, 6) % i].t_ns);
}

TEST(PointOrder, LidarsSweepAndMixedTimesDoNot) {
  const Eigen::Matrix3d level = Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d aslant =
      Eigen::AngleAxisd(0.6, Eigen::Vector3d(0.3, 0.9, 0.1).normalized()).toRotationMatrix();
  for (Scan scan : {spinning(16, false, level), spinning(64, true, level),
                    spinning(128, true, aslant), rosette()}) {
    EXPECT_FALSE(times_in_no_order(scan));
    shuffle_rows(scan);
    EXPECT_FALSE(times_in_no_order(scan));
    shuffle_times(scan);
    EXPECT_TRUE(times_in_no_order(scan));
  }
}

TEST(PointOrder, BackwardsIsAnOrder) {
  Scan scan = spinning(16, false, Eigen::Matrix3d::Identity());
  for (ScanPoint& point : scan.points)
    point.t_ns = 100'000'000U - point.t_ns;
  EXPECT_FALSE(times_in_no_order(scan));
}

TEST(PointOrder, TooFewPointsOrTimesTellNothing) {
  Scan scan = spinning(16, false, Eigen::Matrix3d::Identity());
  shuffle_times(scan);
  Scan few = scan;
  few.points.resize(100);
  EXPECT_FALSE(times_in_no_order(few));
  Scan untimed = scan;
  untimed.has_point_times = false;
  EXPECT_FALSE(times_in_no_order(untimed));
  for (ScanPoint& point : scan.points)
    point.t_ns = point.t_ns / 10'000'000U * 10'000'000U;  // ten times a turn
  EXPECT_FALSE(times_in_no_order(scan));
  EXPECT_FALSE(times_in_no_order(Scan()));
}

}  // namespace
}  // namespace understory
