#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/registration/global/feature_search.h"
#include "understory/registration/global/match_verdict.h"
#include "understory/registration/global/search_cloud.h"
#include "understory/registration/global/test_scans.h"
#include "understory/registration/test_stand.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using testing::upright;

// Sheds on level ground: walls, and nothing that stands upright and alone.
struct Sheds {
  struct Shed {
    Eigen::Vector2d middle;
    Eigen::Vector2d half;
    double yaw;
    double height;
  };
  std::vector<Shed> sheds;

  explicit Sheds(std::uint64_t seed) {
    Random random(seed);
    while (sheds.size() < 16) {
      const Shed shed{{random.uniform(-28.0, 28.0), random.uniform(-28.0, 28.0)},
                      {random.uniform(1.5, 4.5), random.uniform(1.5, 4.5)},
                      random.uniform(0.0, 3.0),
                      random.uniform(2.5, 6.0)};
      bool free = shed.middle.norm() > 14.0;  // a yard in the middle
      for (const Shed& other : sheds)
        free = free && (other.middle - shed.middle).norm() > 9.0;
      if (free) sheds.push_back(shed);
    }
  }
  // Range along a unit ray to the nearest wall or the ground; 0: nothing within 50 m.
  [[nodiscard]] double cast(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray) const {
    double best = ray.z() < 0.0 ? -eye.z() / ray.z() : 50.0;
    for (const Shed& shed : sheds) {
      const Eigen::Rotation2Dd back(-shed.yaw);
      const Eigen::Vector2d from = back * (eye.head<2>() - shed.middle);
      const Eigen::Vector2d along = back * Eigen::Vector2d(ray.head<2>());
      double in = 0.0;
      double out = 1e9;
      for (int k = 0; k < 2; ++k) {
        const double a = (-shed.half[k] - from[k]) / along[k];
        const double b = (shed.half[k] - from[k]) / along[k];
        in = std::max(in, std::min(a, b));
        out = std::min(out, std::max(a, b));
      }
      if (in < out && in < best && eye.z() + in * ray.z() < shed.height) best = in;
    }
    return best < 50.0 ? best : 0.0;
  }
  [[nodiscard]] Points scan(const Pose& world_from_lidar, std::uint64_t seed) const {
    return testing::scan_rings(*this, world_from_lidar, 900, seed);
  }
};

TEST(FeatureSearch, FindsThePoseWhereNothingStandsAlone) {
  const Sheds sheds(4);
  const Pose first = upright(0.0, 0.0, 2.0, 0.3);
  const Pose second = upright(4.0, -3.0, 2.1, 2.2);
  SearchCloud target = prepare_search(sheds.scan(first, 1));
  const SearchCloud source = prepare_search(sheds.scan(second, 2));
  target.uprights.clear();  // what little stands alone at the ends of walls
  const GlobalRegistration done = register_globally(target, source);
  const Pose off = (first.inverse() * second).inverse() * done.result.target_from_source;
  EXPECT_LT(off.translation().norm(), 0.1) << done.verdict.reason;
  EXPECT_LT(off.angle(), 0.01);
  EXPECT_TRUE(done.verdict.trusted) << done.verdict.reason;
}

TEST(FeatureSearch, HelpsWhereUprightsTellNothing) {
  const Sheds sheds(4);
  const Pose first = upright(0.0, 0.0, 2.0, 0.3);
  const Pose second = upright(5.0, 4.0, 2.0, -1.2);
  const GlobalRegistration done = register_globally(sheds.scan(first, 1), sheds.scan(second, 2));
  const Pose off = (first.inverse() * second).inverse() * done.result.target_from_source;
  EXPECT_TRUE(done.verdict.trusted) << done.verdict.reason;
  EXPECT_LT(off.translation().norm(), 0.1);
}

TEST(FeatureSearch, AnotherPlaceIsNotTrusted) {
  const SearchCloud target = prepare_search(Sheds(4).scan(upright(0.0, 0.0, 2.0, 0.3), 1));
  const SearchCloud source = prepare_search(Sheds(5).scan(upright(0.0, 0.0, 2.0, 0.3), 2));
  EXPECT_FALSE(register_globally(target, source).verdict.trusted);
}

TEST(FeatureSearch, CornersAreFeaturesAndTheMiddleOfAWallIsNone) {
  Points points;
  std::vector<float> above;
  for (int k = 0; k < 100; ++k) {  // two walls of 20 m that meet at the origin
    for (int level = 0; level < 15; ++level) {
      const float along = 0.2F * static_cast<float>(k);
      const float height = 0.2F * static_cast<float>(level);
      points.insert(points.end(), {{along, 0.0F, height}, {0.0F, along, height}});
      above.insert(above.end(), {height, height});
    }
  }
  int corner = 0;
  for (const LocalFeature& feature : find_local_features(points, above, 700)) {
    const double from_corner = feature.at.head<2>().norm();
    EXPECT_TRUE(from_corner < 2.5 || from_corner > 18.0) << from_corner;
    corner += from_corner < 2.5 ? 1 : 0;
  }
  EXPECT_GT(corner, 0);
}

TEST(FeatureSearch, ConsistentPairsWinAmongStrangers) {
  Random random(7);
  const Pose truth = upright(3.0, -8.0, 0.4, 2.5);
  std::vector<LocalFeature> target;
  std::vector<LocalFeature> source;
  for (int i = 0; i < 60; ++i) {
    LocalFeature feature;
    feature.at = {random.uniform(-20.0, 20.0), random.uniform(-20.0, 20.0), 0.5};
    float squared = 0.0F;
    for (float& value : feature.image) {
      value = static_cast<float>(random.uniform());
      squared += value * value;
    }
    for (float& value : feature.image)
      value /= std::sqrt(squared);
    source.push_back(feature);
    feature.at =
        i < 15 ? truth * feature.at  // three in four look alike and lie elsewhere
               : Eigen::Vector3d(random.uniform(-20.0, 20.0), random.uniform(-20.0, 20.0), 0.5);
    target.push_back(feature);
  }
  const std::vector<FeatureMatch> found = match_local_features(target, source, 5);
  ASSERT_FALSE(found.empty());
  const Pose off = truth.inverse() * found.front().target_from_source;
  EXPECT_LT(off.translation().norm(), 0.2);
  EXPECT_LT(off.angle(), 0.02);
  EXPECT_GE(found.front().matched, 15);
  EXPECT_TRUE(match_local_features({}, source, 5).empty());
}

}  // namespace
}  // namespace understory
