// Which scans become keyframes, and what the edges between keyframes know.
#include "understory/map/keyframes/keyframe_map.h"

#include <gtest/gtest.h>

#include "understory/util/files/folder_test_support.h"
#include "understory/util/random.h"

namespace understory {
namespace {

// Points within 10 m of the body. What they are like does not matter here.
FeaturePoints some_points() {
  Random random(1);
  FeaturePoints features;
  for (int i = 0; i < 500; ++i) {
    features.points.push_back(Eigen::Vector3d(random.uniform(-10.0, 10.0),
                                              random.uniform(-10.0, 10.0), random.uniform(-2, 8))
                                  .cast<float>());
  }
  return features;
}

// A map with one keyframe at the origin.
struct Begun {
  explicit Begun(const KeyframeMap::Config& config) : map(config, folder.path(), times, log) {
    map.start();
    (void)map.add(TimeNs{0}, {}, some_points());
  }

  test::TemporaryFolder folder;
  StageTimes times;
  Log log;
  KeyframeMap map;
};

KeyframeOffer offer_at(double x) {
  return {.world_from_body = Pose(Eigen::Quaterniond::Identity(), {x, 0.0, 0.0})};
}

TEST(KeyframeChoice, TheFirstScanIsOneHoweverItMatched) {
  KeyframeMap::Config config;
  config.keyframe.max_fitness_m2 = 0.01;
  const test::TemporaryFolder folder;
  StageTimes times;
  Log log;
  KeyframeMap map(config, folder.path(), times, log);
  map.start();
  KeyframeOffer offer = offer_at(0.0);
  offer.fitness_m2 = 1.0;
  EXPECT_TRUE(map.wants(offer));
}

TEST(KeyframeChoice, DistanceAloneDecidesByDefault) {
  const Begun begun({});
  KeyframeOffer offer = offer_at(0.4);
  offer.fitness_m2 = 50.0;
  offer.found_share = 0.1;
  EXPECT_FALSE(begun.map.wants(offer));
  offer.world_from_body = offer_at(0.6).world_from_body;
  EXPECT_TRUE(begun.map.wants(offer));
}

TEST(KeyframeChoice, AScanThatTheMapExplainsBadlyBecomesOneWhereAsked) {
  KeyframeMap::Config config;
  config.keyframe.above_fitness_m2 = 0.04;
  config.keyframe.below_found_share = 0.75;
  const Begun begun(config);
  KeyframeOffer offer = offer_at(0.1);
  offer.fitness_m2 = 0.03;
  EXPECT_FALSE(begun.map.wants(offer));
  offer.fitness_m2 = 0.05;
  EXPECT_TRUE(begun.map.wants(offer));
  offer.fitness_m2 = 0.0;
  offer.found_share = 0.7;
  EXPECT_TRUE(begun.map.wants(offer));
}

TEST(KeyframeChoice, ABadMatchBecomesNoneWhereAsked) {
  KeyframeMap::Config config;
  config.keyframe.max_fitness_m2 = 0.04;
  const Begun begun(config);
  KeyframeOffer offer = offer_at(2.0);
  offer.fitness_m2 = 0.05;
  EXPECT_FALSE(begun.map.wants(offer));
  offer.fitness_m2 = 0.03;
  EXPECT_TRUE(begun.map.wants(offer));
}

// The first piece is level, and a second one begins 10 m on, tilted.
TEST(KeyframeLevel, TurnsThePieceThatIsMappedAboutItsFirstKeyframe) {
  Begun begun({});
  KeyframeMap& map = begun.map;
  (void)map.add(kNsPerSecond, offer_at(1.0), some_points());
  map.start_segment();
  const Pose turn(so3_exp({0.0, 0.1, 0.0}), Eigen::Vector3d::Zero());
  const Pose before_keyframes = turn * offer_at(9.0).world_from_body;
  const std::optional<Pose> held = map.level(turn, before_keyframes);
  ASSERT_TRUE(held);
  EXPECT_LT(((*held * before_keyframes).translation() - Eigen::Vector3d(9.0, 0.0, 0.0)).norm(),
            1e-12);

  (void)map.add(2 * kNsPerSecond, offer_at(10.0), some_points());
  (void)map.add(3 * kNsPerSecond, offer_at(12.0), some_points());
  const Pose body = turn * offer_at(13.0).world_from_body;
  const std::optional<Pose> back = map.level(turn, body);
  ASSERT_TRUE(back);
  const std::vector<Keyframe>& keyframes = map.keyframes();
  EXPECT_EQ(keyframes[0].world_from_body.angle(), 0.0);
  EXPECT_EQ(keyframes[1].world_from_body.translation(), Eigen::Vector3d(1.0, 0.0, 0.0));
  const Eigen::Vector3d first(10.0, 0.0, 0.0);
  EXPECT_LT((keyframes[2].world_from_body.translation() - first).norm(), 1e-12);
  EXPECT_NEAR(keyframes[2].world_from_body.angle(), 0.1, 1e-9);
  const Eigen::Vector3d along = turn * Eigen::Vector3d(1.0, 0.0, 0.0);
  EXPECT_LT((keyframes[3].world_from_body.translation() - first - 2.0 * along).norm(), 1e-12);
  EXPECT_LT(((*back * body).translation() - first - 3.0 * along).norm(), 1e-12);
}

TEST(KeyframeLevel, TurnsTheOnlyPieceAboutTheOriginOfTheWorld) {
  Begun begun({});
  (void)begun.map.add(kNsPerSecond, offer_at(1.0), some_points());
  const Pose turn(so3_exp({0.0, 0.1, 0.0}), Eigen::Vector3d::Zero());
  EXPECT_FALSE(begun.map.level(turn, turn * offer_at(1.5).world_from_body));
  EXPECT_LT((begun.map.keyframes()[1].world_from_body.translation() -
             turn * Eigen::Vector3d(1.0, 0.0, 0.0))
                .norm(),
            1e-12);
}

// The match left one direction open: there the edge is weak, and nowhere else.
TEST(KeyframeEdges, AreWeakWhereTheMatchKnewNothing) {
  Begun begun({});
  (void)begun.map.add(TimeNs{1}, offer_at(1.0), some_points());
  KeyframeOffer open = offer_at(2.0);
  open.covariance(4, 4) = 0.25;
  (void)begun.map.add(TimeNs{2}, open, some_points());
  const std::vector<PoseEdge> edges = begun.map.graph().odometry;
  ASSERT_EQ(edges.size(), 2U);
  Matrix6d added = edges[1].covariance - edges[0].covariance;
  EXPECT_NEAR(added(4, 4), 0.25, 1e-12);
  added(4, 4) = 0.0;
  EXPECT_LT(added.cwiseAbs().maxCoeff(), 1e-12);
}

}  // namespace
}  // namespace understory
