#include "understory/map/keyframes/returning_keyframes.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace understory {
namespace {

constexpr double kCircleRadiusM = 80.0;

// A way out along x and back, a keyframe each metre.
struct Way {
  void go_to(double x, bool held) {
    Keyframe keyframe;
    keyframe.world_from_body = Pose(Eigen::Quaterniond::Identity(), {x, 0.0, 0.0});
    keyframes.push_back(keyframe);
    returning.add(held);
  }
  std::vector<std::size_t> out_to(double metres, bool held) {
    std::vector<std::size_t> came;
    for (double x = 0.0; x < metres; x += 1.0) {
      go_to(x, held);
      for (const std::size_t i : returning.take(keyframes, 0, kCircleRadiusM))
        came.push_back(i);
    }
    return came;
  }
  std::vector<std::size_t> jump_to(double x, bool held) {
    go_to(x, held);
    return returning.take(keyframes, 0, kCircleRadiusM);
  }

  std::vector<Keyframe> keyframes;
  ReturningKeyframes returning;
};

TEST(ReturningKeyframes, ComeBackOnceNearestFirst) {
  Way way;
  EXPECT_TRUE(way.out_to(150.0, true).empty()) << "nothing has been left behind and met again";
  EXPECT_EQ(way.jump_to(10.2, true), (std::vector<std::size_t>{10, 11, 9}));
  EXPECT_EQ(way.jump_to(10.2, true), (std::vector<std::size_t>{12, 8, 13})) << "each once";
}

TEST(ReturningKeyframes, NoneComesWhereOdometryAloneHoldsThePlace) {
  Way odometry;
  (void)odometry.out_to(150.0, false);
  EXPECT_TRUE(odometry.jump_to(10.2, false).empty());
  Way lost_later;
  (void)lost_later.out_to(150.0, true);
  EXPECT_TRUE(lost_later.jump_to(10.2, false).empty()) << "the newest may have drifted";
  EXPECT_FALSE(lost_later.jump_to(10.2, true).empty());
}

// The first stretch lays the world; its own keyframes come before any is held.
TEST(ReturningKeyframes, TheWayBeforeTheFirstOneHeldIsHeldToo) {
  Way way;
  (void)way.out_to(100.0, false);
  (void)way.jump_to(100.0, true);
  for (double x = 101.0; x < 250.0; x += 1.0)
    (void)way.jump_to(x, true);
  // As far as the odometry went, not as far as the crow flies.
  Way around;
  for (int round = 0; round < 4; ++round)
    (void)around.out_to(30.0, false);
  for (double x = 0.0; x < 200.0; x += 1.0)
    (void)around.jump_to(x, true);
  for (int k = 0; k < 60; ++k) {
    for (const std::size_t i : around.jump_to(10.2, true))
      EXPECT_GE(i, 120U - 80U);
  }
  EXPECT_TRUE(way.jump_to(-30.0, true).empty()) << "farther than the radius before the first held";
  EXPECT_EQ(way.jump_to(60.2, true).front(), 60U);
}

TEST(ReturningKeyframes, AMapMadeAnewHoldsAllWithinItsRadius) {
  Way way;
  (void)way.out_to(150.0, true);
  way.go_to(10.2, true);
  std::vector<LocalMapInsertion> in_map;
  for (std::size_t i = 0; i < 90; ++i)
    in_map.push_back({i, 0});
  in_map.push_back({150, 0});
  way.returning.note_made_anew(in_map);
  EXPECT_TRUE(way.returning.take(way.keyframes, 0, kCircleRadiusM).empty());
  way.returning.note_made_anew({});
  const std::vector<std::size_t> lacking = way.returning.take(way.keyframes, 0, kCircleRadiusM);
  ASSERT_FALSE(lacking.empty()) << "what it lacks comes";
  EXPECT_EQ(lacking.front(), 10U);
}

TEST(ReturningKeyframes, GoOnFromTheirState) {
  Way way;
  (void)way.out_to(150.0, true);
  BinaryWriter writer;
  way.returning.save(writer);
  const std::string state = writer.bytes();
  Way other = way;
  other.returning = {};
  BinaryReader reader(state, "state");
  other.returning.load(reader, way.keyframes.size());
  EXPECT_EQ(other.jump_to(30.0, true), way.jump_to(30.0, true));
  BinaryReader again(state, "state");
  EXPECT_THROW(other.returning.load(again, 3), InputError);
}

}  // namespace
}  // namespace understory
