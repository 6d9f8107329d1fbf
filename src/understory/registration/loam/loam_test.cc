#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "understory/registration/loam/loam_matcher.h"
#include "understory/registration/loam/ring_features.h"
#include "understory/registration/matchers.h"
#include "understory/registration/test_stand.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using testing::upright;

// P4 (39), worked out term by term.
TEST(RingFeatures, SmoothnessIsThatOfItsEquation) {
  Random random(3);
  Points ring;
  for (int i = 0; i < 40; ++i) {
    const double a = 0.01 * i;
    const double r = 8.0 + 0.3 * random.normal();
    ring.emplace_back(static_cast<float>(r * std::cos(a)), static_cast<float>(r * std::sin(a)),
                      -0.5F);
  }
  const std::vector<double> c = ring_smoothness(ring, 5);
  EXPECT_EQ(c[4], std::numeric_limits<double>::infinity());
  EXPECT_EQ(c[35], std::numeric_limits<double>::infinity());
  for (const std::size_t i : {5U, 17U, 34U}) {
    double x = 0.0;
    double y = 0.0;
    double z = 0.0;
    for (std::size_t j = i - 5; j <= i + 5; ++j) {
      if (j == i) continue;
      x += static_cast<double>(ring[i].x()) - static_cast<double>(ring[j].x());
      y += static_cast<double>(ring[i].y()) - static_cast<double>(ring[j].y());
      z += static_cast<double>(ring[i].z()) - static_cast<double>(ring[j].z());
    }
    const double norm = std::sqrt(x * x + y * y + z * z);
    EXPECT_NEAR(c[i], norm / (10.0 * static_cast<double>(ring[i].norm())), 1e-12);
  }
}

// A scan with its rings: in these the elevation tells the ring.
struct RingScan {
  Points points;
  std::vector<std::uint16_t> ring;
};

RingScan with_rings(Points points, const testing::Pattern& pattern) {
  RingScan scan{std::move(points), {}};
  for (const Eigen::Vector3f& p : scan.points) {
    const double elevation =
        std::asin(static_cast<double>(p.z() / p.norm())) * 180.0 / std::numbers::pi;
    const double share = (elevation - pattern.low_deg) / (pattern.high_deg - pattern.low_deg);
    scan.ring.push_back(static_cast<std::uint16_t>(std::lround(share * (pattern.rings - 1))));
  }
  return scan;
}

// Two walls that meet 5 m ahead, seen by two rings of 1 degree.
RingScan corner() {
  RingScan scan;
  for (std::uint16_t ring = 0; ring < 2; ++ring) {
    for (int i = -40; i <= 40; ++i) {
      const double a = i * std::numbers::pi / 180.0;
      // The walls run back from (5, 0) at 45 degrees.
      const double r = 5.0 / (std::cos(a) + std::abs(std::sin(a)));
      scan.points.emplace_back(static_cast<float>(r * std::cos(a)),
                               static_cast<float>(r * std::sin(a)),
                               0.3F * static_cast<float>(ring));
      scan.ring.push_back(ring);
    }
  }
  return scan;
}

TEST(RingFeatures, ACornerIsAnEdgeAndItsWallsArePlanes) {
  const RingScan scan = corner();
  const RingFeatureFinder finder({}, false);
  const std::vector<PointFeature> features = finder.find({&scan.points, &scan.ring});
  for (const std::size_t first : {0U, 81U}) {
    EXPECT_EQ(features[first + 40], PointFeature::kEdge);  // the corner itself
    for (std::size_t i = first; i < first + 81; ++i) {
      if (i == first + 40) continue;
      EXPECT_NE(features[i], PointFeature::kEdge) << i;
    }
    EXPECT_EQ(features[first + 15], PointFeature::kPlane);
    EXPECT_EQ(features[first + 65], PointFeature::kPlane);
    EXPECT_EQ(features[first + 2], PointFeature::kNone);  // too near the end to tell
  }
}

// A wall behind a post goes on unseen: its points beside the post are no edges, the post's are.
TEST(RingFeatures, WhatSomethingNearerHidesIsNoEdge) {
  RingScan scan;
  for (std::uint16_t ring = 0; ring < 2; ++ring) {
    for (int i = -40; i <= 40; ++i) {
      const double a = 0.5 * i * std::numbers::pi / 180.0;
      const double r = std::abs(i) <= 3 ? 4.0 : 9.0 / std::cos(a);
      scan.points.emplace_back(static_cast<float>(r * std::cos(a)),
                               static_cast<float>(r * std::sin(a)),
                               0.2F * static_cast<float>(ring));
      scan.ring.push_back(ring);
    }
  }
  const std::vector<PointFeature> features =
      RingFeatureFinder({}, false).find({&scan.points, &scan.ring});
  int edges = 0;
  for (std::size_t i = 0; i < features.size(); ++i) {
    if (features[i] != PointFeature::kEdge) continue;
    ++edges;
    EXPECT_LT(scan.points[i].norm(), 5.0F);
  }
  EXPECT_GE(edges, 2);
}

TEST(RingFeatures, GroundIsWhereRingsRiseLittle) {
  testing::Stand stand = testing::make_stand({.half_width_m = 20.0, .crowns = false}, 3);
  stand.bump_m = 0.0;
  const testing::Pattern pattern = testing::os0_128();
  const RingScan scan =
      with_rings(testing::scan_stand(stand, upright(0, 0, 1.6), pattern, 1), pattern);
  const std::vector<PointFeature> features =
      RingFeatureFinder({}, true).find({&scan.points, &scan.ring});
  double ground = 0.0;
  double low = 0.0;
  for (std::size_t i = 0; i < features.size(); ++i) {
    if (features[i] != PointFeature::kGround) continue;
    ++ground;
    if (std::abs(scan.points[i].z() + 1.6F) < 0.15F) ++low;
  }
  ASSERT_GT(ground, 2000.0);
  EXPECT_GT(low / ground, 0.95);
}

TEST(RingFeatures, TheHighestAndTheLowestRingOnTheGroundAreGround) {
  // Rings of a level floor around the lidar: those at both ends have one neighbour each.
  RingScan scan;
  for (std::uint16_t ring = 0; ring < 4; ++ring) {
    for (int i = 0; i < 720; ++i) {
      const double turn = i * M_PI / 360.0;
      const double range = 3.0 + 0.5 * ring;
      scan.points.emplace_back(static_cast<float>(range * std::cos(turn)),
                               static_cast<float>(range * std::sin(turn)), -1.6F);
      scan.ring.push_back(ring);
    }
  }
  const std::vector<PointFeature> features =
      RingFeatureFinder({}, true).find({&scan.points, &scan.ring});
  std::array<int, 4> ground{};
  for (std::size_t i = 0; i < features.size(); ++i)
    ground[scan.ring[i]] += features[i] == PointFeature::kGround ? 1 : 0;
  for (std::size_t ring = 0; ring < 4; ++ring)
    EXPECT_GT(ground[ring], 450) << "ring " << ring;
}

TEST(RingFeatures, ACloudWithoutRingsIsAnInputError) {
  RingScan scan = corner();
  std::fill(scan.ring.begin(), scan.ring.end(), std::uint16_t{0});
  try {
    static_cast<void>(RingFeatureFinder({}, false).find({&scan.points, &scan.ring}));
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("ring"), std::string::npos);
  }
}

class AnyLoam : public ::testing::TestWithParam<std::string> {
 protected:
  AnyLoam() {
    pattern_ = testing::os0_128();
    pattern_.rings = 64;
    pattern_.columns = 720;
    stand_ = testing::make_stand({.half_width_m = 20.0, .crowns = false}, 3);
    stand_.bump_m = 0.3;
    matcher_ = make_matcher(MatcherConfig(), GetParam());
    source_ = scan(truth_, 99);
  }
  [[nodiscard]] FeaturePoints scan(const Pose& world_from_sensor, std::uint64_t seed) const {
    // Cast once for all tests; a seed belongs to a pose.
    static std::map<std::uint64_t, RingScan> known;
    if (known.count(seed) == 0) {
      known[seed] =
          with_rings(testing::scan_stand(stand_, world_from_sensor, pattern_, seed), pattern_);
    }
    RingScan rings = known[seed];
    const std::vector<PointFeature> features =
        matcher_->feature_finder()->find({&rings.points, &rings.ring});
    return {std::move(rings.points), features};
  }
  [[nodiscard]] MatchTargetPtr path_target() const {
    const auto builder = matcher_->make_builder({});
    for (int i = 0; i < 5; ++i) {
      const Pose pose = upright(0.5 * i, 0.1 * i, 1.6, 0.03 * i);
      builder->insert_features(scan(pose, static_cast<std::uint64_t>(i)), pose, std::nullopt);
    }
    return builder->snapshot();
  }
  void expect_truth(const RegistrationResult& result) const {
    EXPECT_TRUE(result.usable()) << result.reason;
    const Vector6d off = right_difference(result.target_from_source, truth_);
    EXPECT_LT(off.tail<3>().norm(), 0.05);
    EXPECT_LT(off.head<3>().norm(), 0.005);
    EXPECT_GT(result.inlier_ratio, 0.3);
    EXPECT_EQ(result.degenerate_directions.cols(), 0);
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix6d>(result.information).eigenvalues()[0], 0.0);
  }

  testing::Stand stand_;
  testing::Pattern pattern_;
  std::unique_ptr<const Matcher> matcher_;
  Pose truth_ = upright(1.3, 0.2, 1.65, 0.05);
  FeaturePoints source_;
};

TEST_P(AnyLoam, FindsAScanInAMapOfKeyframesFromNearAndFromFar) {
  const MatchTargetPtr target = path_target();
  const auto guess = [&](double turn, double shift) {
    return truth_ *
           Pose::exp((Vector6d() << turn, -turn, turn, shift, -shift, 0.5 * shift).finished());
  };
  expect_truth(target->match_features(source_, guess(0.005, 0.05), {}, MatchStart::kNear));
  expect_truth(target->match_features(source_, guess(0.01, 0.3), {}, MatchStart::kFar));
}

TEST_P(AnyLoam, GivesTheSameBitsForAnyNumberOfThreads) {
  Eigen::Matrix4d found[2];
  for (int i = 0; i < 2; ++i) {
    with_threads(i + 1, [&] {
      found[i] = path_target()
                     ->match_features(source_, upright(1.25, 0.25, 1.6), {}, MatchStart::kFar)
                     .target_from_source.matrix();
    });
  }
  EXPECT_EQ(found[0], found[1]);
}

TEST_P(AnyLoam, PointsWithoutFeaturesMatchNothing) {
  const RegistrationResult result =
      path_target()->match(source_.points, truth_, {}, MatchStart::kNear);
  EXPECT_EQ(result.status, RegistrationStatus::kTooFewPoints);
  EXPECT_FALSE(result.reason.empty());
  EXPECT_EQ(result.target_from_source.matrix(), truth_.matrix());
}

TEST_P(AnyLoam, ItsCostLeadsBackToTheMatch) {
  const MatchTargetPtr target = path_target();
  const auto cost = target->cost_of_features(source_, MatchStart::kNear);
  ASSERT_NE(cost, nullptr);
  for (const double aside : {-0.06, 0.06}) {
    const Vector6d away = (Vector6d() << 0, 0, 0, aside, -aside, 0.5 * aside).finished();
    const PoseCost at = cost->at(truth_ * Pose::exp(away));
    EXPECT_GT(at.cost, cost->at(truth_).cost);
    EXPECT_GT(at.gradient.dot(away), 0.0);
  }
}

INSTANTIATE_TEST_SUITE_P(Loam, AnyLoam, ::testing::Values("loam", "loam_ground"),
                         [](const auto& tested) { return tested.param; });

// One edge and one plane of the map, LOAM (2, 3): distance from a line, distance from a plane.
TEST(Loam, EdgesCountAcrossTheirLineAndPlanesAlongTheirNormal) {
  Random random(7);
  Points pole;
  Points floor;
  for (int i = 0; i < 400; ++i) {
    pole.emplace_back(1.125F + 0.01F * static_cast<float>(random.normal()),
                      2.125F + 0.01F * static_cast<float>(random.normal()),
                      0.01F * static_cast<float>(i));
    floor.emplace_back(static_cast<float>(random.uniform(-2.0, 4.0)),
                       static_cast<float>(random.uniform(-2.0, 4.0)), 0.0F);
  }
  IcpMapConfig map;
  map.planes = false;
  map.covariances = true;
  IcpMapBuilder edges(map);
  IcpMapBuilder planes(map);
  edges.insert(pole, Pose());
  planes.insert(floor, Pose());
  LoamConfig config;
  config.steps.loss.kind = LossKind::kNone;
  const IcpMapPtr floor_map = planes.snapshot();
  const LoamTarget target({edges.snapshot(), floor_map, floor_map}, config);
  GaussianSource source;
  source.means = {{1.325F, 2.225F, 2.0F}, {0.5F, 0.5F, 0.13F}};
  source.features = {PointFeature::kEdge, PointFeature::kPlane};
  std::vector<LoamTarget::Known> known(2);
  const MatchSums sums = internal::gaussian_sums(target, source, Pose(), config.steps, known);
  EXPECT_EQ(sums.matched, 2U);
  const double across = 0.2 * 0.2 + 0.1 * 0.1;
  EXPECT_NEAR(sums.cost, 0.5 * (across + 0.13 * 0.13) / (0.03 * 0.03), 2.0);
}

// A corner of a room with smooth points on its three sides.
FeaturePoints corner_of_a_room(PointFeature feature) {
  FeaturePoints room;
  for (int i = 0; i <= 40; ++i) {
    for (int k = 0; k <= 40; ++k) {
      const float a = -2.0F + 0.1F * static_cast<float>(i);
      const float b = -2.0F + 0.1F * static_cast<float>(k);
      room.points.emplace_back(a, b, 2.0F);
      room.points.emplace_back(a, 2.0F, b);
      room.points.emplace_back(2.0F, a, b);
    }
  }
  room.features.assign(room.points.size(), feature);
  return room;
}

// Ground is not laid on other planes, as LOAM would lay it.
TEST(LoamGround, GroundMeetsGroundAlone) {
  const auto overlap = [](const std::string& method, PointFeature feature) {
    const auto builder = make_matcher(MatcherConfig(), method)->make_builder({});
    builder->insert_features(corner_of_a_room(PointFeature::kPlane), Pose(), std::nullopt);
    return builder->snapshot()
        ->match_features(corner_of_a_room(feature), Pose(), {}, MatchStart::kNear)
        .inlier_ratio;
  };
  EXPECT_EQ(overlap("loam_ground", PointFeature::kGround), 0.0);
  EXPECT_GT(overlap("loam_ground", PointFeature::kPlane), 0.9);
  EXPECT_GT(overlap("loam", PointFeature::kGround), 0.9);
}

// Walls and a ceiling, and no ground: the two steps alone could move nothing.
TEST(LoamGround, AllFeaturesCountAtTheEnd) {
  const FeaturePoints room = corner_of_a_room(PointFeature::kPlane);
  const auto matcher = make_matcher(MatcherConfig(), "loam_ground");
  const auto builder = matcher->make_builder({});
  builder->insert_features(room, Pose(), std::nullopt);
  const Pose guess = upright(0.05, -0.05, 0.05, 0.005);
  const RegistrationResult result =
      builder->snapshot()->match_features(room, guess, {}, MatchStart::kNear);
  EXPECT_TRUE(result.usable()) << result.reason;
  EXPECT_LT(result.target_from_source.translation().norm(), 0.005);
}

}  // namespace
}  // namespace understory
