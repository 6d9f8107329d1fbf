#include "understory/forest/dead_wood/log_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "understory/util/random.h"

namespace understory {
namespace {

// Ground that rises by 10 % towards the east, and what lies on it: noise of 1 cm.
class LogScene {
 public:
  LogScene() {
    ground_.cell_m = 1.0;
    ground_.x0 = ground_.y0 = -5.0;
    ground_.columns = ground_.rows = 60;
    for (int row = 0; row < ground_.rows; ++row) {
      for (int column = 0; column < ground_.columns; ++column)
        ground_.values.push_back(static_cast<float>(0.1 * (ground_.x0 + column + 0.5)));
    }
  }
  // The upper side of a log with its centre line over the ground by so much at its ends.
  void add_log(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double diameter_m,
               double diameter_to_m, double over_m, double over_to_m) {
    const Eigen::Vector2d way = to - from;
    const double length = way.norm();
    const Eigen::Vector2d across(-way.y() / length, way.x() / length);
    for (double t = 0.0; t < length; t += 0.02) {
      const double radius = 0.5 * (diameter_m + t / length * (diameter_to_m - diameter_m));
      const Eigen::Vector2d middle = from + t / length * way;
      for (double angle = -0.2 * M_PI; angle < 1.2 * M_PI; angle += 0.02 / radius) {
        const Eigen::Vector2d place = middle + radius * std::cos(angle) * across;
        const double over = over_m + t / length * (over_to_m - over_m);
        add(place, 0.1 * middle.x() + over + radius * std::sin(angle));
      }
    }
  }
  void forget_ground() { std::fill(ground_.values.begin(), ground_.values.end(), std::nanf("")); }
  // Points 5 to 12 cm above the terrain.
  void add_uneven_ground(const Eigen::Vector2d& low, const Eigen::Vector2d& high) {
    for (int i = 0; i < 8'000; ++i) {
      const Eigen::Vector2d place(random_.uniform(low.x(), high.x()),
                                  random_.uniform(low.y(), high.y()));
      add(place, 0.1 * place.x() + random_.uniform(0.05, 0.12));
    }
  }
  void add_plants(const Eigen::Vector2d& centre, int count) {
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector2d place =
          centre + Eigen::Vector2d(random_.normal(0.0, 0.4), random_.normal(0.0, 0.4));
      add(place, 0.1 * place.x() + random_.uniform(0.05, 0.8));
    }
  }
  // A board on edge, as the foot of a wall.
  void add_board(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    for (double t = 0.0; t < 1.0; t += 0.005) {
      const Eigen::Vector2d place = from + t * (to - from);
      for (double height = 0.0; height < 1.5; height += 0.03)
        add(place, 0.1 * place.x() + height);
    }
  }
  // One trace of a laser on even ground.
  void add_trace(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    for (double t = 0.0; t < 1.0; t += 0.002) {
      const Eigen::Vector2d place = from + t * (to - from);
      add(place, 0.1 * place.x() + 0.1);
    }
  }
  std::vector<LogFit> search(const std::vector<StemFit>& stems = {}, const GroundArea& area = {}) {
    std::vector<SlicePoint> points = points_;
    return find_logs(points, ground_, stems, area, {});
  }

 private:
  void add(const Eigen::Vector2d& place, double z) {
    const double x = place.x() + random_.normal(0.0, 0.01);
    const double y = place.y() + random_.normal(0.0, 0.01);
    const double height = z + random_.normal(0.0, 0.01) - ground_.interpolate(x, y);
    if (height < 0.05) return;
    points_.push_back(
        {static_cast<float>(x), static_cast<float>(y), static_cast<float>(height), 1});
  }
  Raster ground_;
  Random random_{7};
  std::vector<SlicePoint> points_;
};

TEST(LogSearch, FindsALogWithItsEnds) {
  LogScene scene;
  scene.add_log({5.0, 6.0}, {11.0, 9.0}, 0.3, 0.2, 0.12, 0.12);
  scene.add_plants({6.5, 7.5}, 400);
  const std::vector<LogFit> found = scene.search();
  ASSERT_EQ(found.size(), 1U);
  const LogFit& log = found[0];
  EXPECT_NEAR((log.from.head<2>() - Eigen::Vector2d(5.0, 6.0)).norm(), 0.0, 0.1);
  EXPECT_NEAR((log.to.head<2>() - Eigen::Vector2d(11.0, 9.0)).norm(), 0.0, 0.1);
  EXPECT_NEAR(log.from.z(), 0.5 + 0.12, 0.02);
  EXPECT_NEAR(log.diameter_m, 0.3, 0.02);
  EXPECT_NEAR(log.diameter_to_m, 0.2, 0.02);
}

TEST(LogSearch, BeginsAtItsThickEnd) {
  for (const bool turned : {false, true}) {
    const Eigen::Vector2d thick = turned ? Eigen::Vector2d(11.0, 9.0) : Eigen::Vector2d(5.0, 6.0);
    const Eigen::Vector2d thin = turned ? Eigen::Vector2d(5.0, 6.0) : Eigen::Vector2d(11.0, 9.0);
    LogScene scene;
    scene.add_log(thick, thin, 0.3, 0.2, 0.12, 0.12);
    const std::vector<LogFit> found = scene.search();
    ASSERT_EQ(found.size(), 1U);
    EXPECT_LT((found[0].from.head<2>() - thick).norm(), 0.1);
    EXPECT_GT(found[0].diameter_m, found[0].diameter_to_m);
  }
}

// Uneven ground around it does not make it longer.
TEST(LogSearch, EndsWhereTheGroundGoesOn) {
  LogScene scene;
  scene.add_log({5.0, 6.0}, {10.0, 6.0}, 0.24, 0.2, 0.05, 0.05);
  scene.add_uneven_ground({2.0, 4.0}, {13.0, 8.0});
  const std::vector<LogFit> found = scene.search();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR((found[0].to - found[0].from).norm(), 5.0, 1.0);
  EXPECT_NEAR(found[0].diameter_m, 0.24, 0.04);
}

TEST(LogSearch, PointsOfListedStemsAreNone) {
  LogScene scene;
  scene.add_log({5.0, 6.0}, {7.5, 6.0}, 0.3, 0.3, 0.12, 0.12);
  std::vector<StemFit> stems;
  for (double x = 5.0; x < 7.6; x += 0.2) {
    StemFit stem;
    stem.centre = {x, 6.0};
    stem.radius_m = 0.15;
    stems.push_back(stem);
  }
  EXPECT_EQ(scene.search().size(), 1U);
  EXPECT_TRUE(scene.search(stems).empty());
}

TEST(LogSearch, TwoThatCrossAreTwo) {
  LogScene scene;
  scene.add_log({5.0, 6.0}, {11.0, 9.0}, 0.3, 0.24, 0.12, 0.12);
  scene.add_log({8.0, 4.5}, {7.0, 11.0}, 0.16, 0.12, 0.07, 0.9);
  EXPECT_EQ(scene.search().size(), 2U);
}

TEST(LogSearch, WallsTracesAndPlantsAreNone) {
  LogScene scene;
  scene.add_board({2.0, 2.0}, {9.0, 3.0});
  scene.add_trace({2.0, 8.0}, {10.0, 9.0});
  for (int i = 0; i < 20; ++i)
    scene.add_plants({3.0 + i, 14.0 + 0.5 * i}, 200 + 20 * i);
  EXPECT_TRUE(scene.search().empty());
}

// A rail of a fence is round and straight, too.
TEST(LogSearch, WhatHangsClearOfTheGroundIsNone) {
  LogScene scene;
  scene.add_log({5.0, 6.0}, {11.0, 9.0}, 0.2, 0.2, 0.8, 0.8);
  EXPECT_TRUE(scene.search().empty());
}

TEST(LogSearch, AShortPieceIsNone) {
  LogScene scene;
  scene.add_log({5.0, 6.0}, {6.2, 6.0}, 0.2, 0.2, 0.1, 0.1);
  EXPECT_TRUE(scene.search().empty());
}

TEST(LogSearch, CountsWhereItsMiddleLies) {
  LogScene scene;
  scene.add_log({5.0, 6.0}, {11.0, 9.0}, 0.3, 0.2, 0.12, 0.12);
  EXPECT_EQ(scene.search({}, {{8.0 - 0.5, 0.0}, {20.0, 20.0}}).size(), 1U);
  EXPECT_TRUE(scene.search({}, {{8.0 + 0.5, 0.0}, {20.0, 20.0}}).empty());
}

TEST(LogSearch, PointsBesideTheTerrainAreLeftOut) {
  LogScene scene;
  scene.add_log({5.0, 6.0}, {11.0, 9.0}, 0.3, 0.2, 0.12, 0.12);
  EXPECT_EQ(scene.search().size(), 1U);
  scene.forget_ground();
  EXPECT_TRUE(scene.search().empty());
}

TEST(LogSearch, NothingIsFoundInNothing) {
  EXPECT_TRUE(LogScene().search().empty());
}

}  // namespace
}  // namespace understory
