#include "understory/preprocess/carried_returns.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

namespace understory {
namespace {

const Eigen::Vector3d kUp = Eigen::Vector3d::UnitZ();

void put(double x, double y, double z, Scan& scan) {
  ScanPoint point;
  point.x = static_cast<float>(x);
  point.y = static_cast<float>(y);
  point.z = static_cast<float>(z);
  scan.points.push_back(point);
}

// Ground 1.5 m below the lidar in rings 0.1 m apart, out to 8 m. What is nearer than `from_m` is
// hidden.
void put_ground(double from_m, Scan& scan) {
  for (double radius = from_m; radius < 8.0; radius += 0.1) {
    for (int degree = 0; degree < 360; degree += 2) {
      const double angle = degree * std::numbers::pi / 180.0;
      put(radius * std::cos(angle), radius * std::sin(angle), -1.5, scan);
    }
  }
}

// The visible half of an upright cylinder, 0.1 m in radius, from 1.1 m below to 0.7 m above.
void put_post(double x, double y, Scan& scan) {
  for (double z = -1.1; z < 0.7; z += 0.05) {
    for (int step = -8; step <= 8; ++step) {
      const double angle = std::atan2(-y, -x) + step * std::numbers::pi / 18.0;
      put(x + 0.1 * std::cos(angle), y + 0.1 * std::sin(angle), z, scan);
    }
  }
}

// Which points of a scan are marked, of those that `part` added.
struct Marked {
  std::size_t marked = 0;
  std::size_t points = 0;
};
Marked marked_of(const CarriedReturns& carried, Scan scan, const std::function<void(Scan&)>& part) {
  const std::size_t before = scan.points.size();
  part(scan);
  const std::vector<std::uint8_t> marks = carried.mark(scan);
  Marked result{0, scan.points.size() - before};
  for (std::size_t i = before; i < marks.size(); ++i)
    result.marked += marks[i];
  return result;
}

// What carries the lidar: a post 1 m to its right.
void put_carrier(Scan& scan) {
  put_post(0.3, -1.0, scan);
}

// The lidar has driven so far. A stem stands 1.5 m beside the start of its way.
Scan seen_after(double way_m) {
  Scan scan;
  put_ground(1.2, scan);
  put_post(0.5 - way_m, 1.5, scan);
  put_carrier(scan);
  return scan;
}

TEST(CarriedReturns, APostIsMarkedFromTheFirstScanAndTheGroundIsNot) {
  CarriedReturns carried({});
  for (int scan = 0; scan < 40; ++scan) {
    carried.learn(seen_after(0.1 * scan), kUp);
    const Marked post = marked_of(carried, seen_after(0.1 * scan), put_carrier);
    EXPECT_EQ(post.marked, post.points) << scan;
    const Marked ground =
        marked_of(carried, seen_after(0.1 * scan), [](Scan& to) { put_ground(1.2, to); });
    EXPECT_LT(ground.marked, ground.points / 200) << scan;  // at its rim it is a line
  }
}

TEST(CarriedReturns, AStemIsMarkedOnlyUntilTheLidarHasMovedOn) {
  CarriedReturns carried({});
  const auto stem_after = [&](double way_m) {
    return marked_of(carried, seen_after(way_m), [&](Scan& to) { put_post(0.5 - way_m, 1.5, to); });
  };
  for (int scan = 0; scan < 20; ++scan)
    carried.learn(seen_after(0.0), kUp);
  EXPECT_EQ(stem_after(0.0).marked, stem_after(0.0).points);
  for (int scan = 1; scan <= 12; ++scan) {
    carried.learn(seen_after(0.06 * scan), kUp);
    if (0.06 * scan < 0.4) continue;
    EXPECT_EQ(stem_after(0.06 * scan).marked, 0U) << scan;
  }
  // Its old place is free again: another stem there is none of the carrier's parts.
  Scan another = seen_after(0.8);
  put_post(0.5, 1.5, another);
  carried.learn(another, kUp);
  EXPECT_EQ(stem_after(0.0).marked, 0U);
}

// A level plate with a side below it, such as a bonnet. The ground begins behind it.
void put_bonnet(Scan& scan) {
  for (double x = 0.6; x < 1.4; x += 0.04) {
    for (double y = -0.5; y < 0.5; y += 0.04)
      put(x, y, -0.5, scan);
  }
}

TEST(CarriedReturns, ALevelSurfaceWithSomethingSteeplyBelowIsNoGround) {
  CarriedReturns carried({});
  Scan scan;
  put_ground(2.0, scan);
  put_bonnet(scan);
  for (int i = 0; i < 3; ++i)
    carried.learn(scan, kUp);
  const Marked bonnet = marked_of(carried, scan, put_bonnet);
  EXPECT_EQ(bonnet.marked, bonnet.points);
  const Marked ground = marked_of(carried, scan, [](Scan& to) { put_ground(2.0, to); });
  EXPECT_LT(ground.marked, ground.points / 200);
}

// A level board, 4 cm wide, with nothing below it: too narrow for ground.
void put_board(Scan& scan) {
  for (double x = -0.5; x < 0.5; x += 0.02) {
    for (double y = -1.04; y < -0.995; y += 0.02)
      put(x, y, -0.5, scan);
  }
}

TEST(CarriedReturns, ABoardIsNoGround) {
  CarriedReturns carried({});
  Scan scan;
  put_ground(3.2, scan);
  put_board(scan);
  carried.learn(scan, kUp);
  const Marked board = marked_of(carried, scan, put_board);
  EXPECT_EQ(board.marked, board.points);
}

// Up is not the lidar's z axis.
TEST(CarriedReturns, GroundIsKnownFromATiltedLidar) {
  const Eigen::AngleAxisd tilt(0.6, Eigen::Vector3d::UnitY());
  const auto tilted = [&](Scan scan) {
    for (ScanPoint& point : scan.points) {
      const Eigen::Vector3d p = tilt * Eigen::Vector3d(point.x, point.y, point.z);
      point.x = static_cast<float>(p.x());
      point.y = static_cast<float>(p.y());
      point.z = static_cast<float>(p.z());
    }
    return scan;
  };
  CarriedReturns carried({});
  carried.learn(tilted(seen_after(0.0)), tilt * kUp);
  const std::vector<std::uint8_t> marks = carried.mark(tilted(seen_after(0.0)));
  Scan ground;
  put_ground(1.2, ground);
  std::size_t marked = 0;
  for (std::size_t i = 0; i < ground.points.size(); ++i)
    marked += marks[i];
  EXPECT_LT(marked, ground.points.size() / 200);
  EXPECT_GT(std::count(marks.begin(), marks.end(), 1), 500);
}

TEST(CarriedReturns, WhereMostIsNearNothingIsMarked) {
  Scan tunnel;
  for (double x = -1.0; x < 1.0; x += 0.2)
    put_post(x, 1.0, tunnel);
  CarriedReturns carried({});
  carried.learn(tunnel, kUp);
  EXPECT_TRUE(carried.mark(tunnel).empty());
}

TEST(CarriedReturns, WithoutReachNothingIsMarked) {
  CarriedReturns carried({.reach_m = 0.0});
  carried.learn(seen_after(0.0), kUp);
  EXPECT_TRUE(carried.mark(seen_after(0.0)).empty());
}

TEST(CarriedReturns, GoesOnAsBeforeAfterACheckpoint) {
  CarriedReturns carried({});
  for (int scan = 0; scan < 7; ++scan)
    carried.learn(seen_after(0.05 * scan), kUp);
  BinaryWriter writer;
  carried.save(writer);
  CarriedReturns loaded({});
  BinaryReader reader(writer.bytes(), "checkpoint");
  loaded.load(reader);
  for (int scan = 7; scan < 20; ++scan) {
    const Scan seen = seen_after(0.05 * scan);
    EXPECT_EQ(carried.mark(seen), loaded.mark(seen)) << scan;
    carried.learn(seen, kUp);
    loaded.learn(seen, kUp);
  }
}

}  // namespace
}  // namespace understory
