#include "understory/map/keyframes/keyframe_history.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

Keyframe keyframe_at(double x) {
  Keyframe keyframe;
  keyframe.stamp = static_cast<TimeNs>(10.0 * x);
  keyframe.world_from_body = Pose(so3_exp({0.0, 0.1, x}), {x, 2.0, 3.0});
  keyframe.previous_from_this = Pose(so3_exp({0.1, 0.0, 0.0}), {1.0, 0.0, 0.1 * x});
  keyframe.covariance = Matrix6d::Identity() * x;
  return keyframe;
}

class KeyframeHistoryTest : public ::testing::Test {
 protected:
  void add(int count) {
    for (int i = 0; i < count; ++i)
      growth_.keyframes.push_back(keyframe_at(static_cast<double>(growth_.keyframes.size())));
  }
  void move() {
    for (Keyframe& keyframe : growth_.keyframes)
      keyframe.world_from_body =
          Pose(so3_exp({0.0, 0.0, 0.3}), {0.0, 1.0, 0.0}) * keyframe.world_from_body;
  }
  std::string sync(KeyframeHistory& history, bool moved) {
    history.sync(growth_.keyframes, growth_.segment_starts, growth_.loops, moved);
    BinaryWriter writer;
    history.save(writer);
    return writer.bytes();
  }
  void expect_read_back(const std::string& state) {
    BinaryReader reader(state, "state");
    KeyframeGrowth read;
    const KeyframeHistory history(folder_.path(), reader, read);
    EXPECT_TRUE(reader.at_end());
    ASSERT_EQ(read.keyframes.size(), growth_.keyframes.size());
    for (std::size_t i = 0; i < read.keyframes.size(); ++i) {
      const Keyframe& a = read.keyframes[i];
      const Keyframe& b = growth_.keyframes[i];
      EXPECT_EQ(a.stamp, b.stamp);
      EXPECT_EQ(a.world_from_body.matrix(), b.world_from_body.matrix()) << i;
      EXPECT_EQ(a.previous_from_this.matrix(), b.previous_from_this.matrix());
      EXPECT_EQ(a.covariance, b.covariance);
    }
    EXPECT_EQ(read.segment_starts, growth_.segment_starts);
    ASSERT_EQ(read.loops.size(), growth_.loops.size());
    for (std::size_t i = 0; i < read.loops.size(); ++i) {
      EXPECT_EQ(read.loops[i].to, growth_.loops[i].to);
      EXPECT_EQ(read.loops[i].edge.to, growth_.loops[i].to);
      EXPECT_EQ(read.loops[i].reason, growth_.loops[i].reason);
    }
  }
  [[nodiscard]] bool there(const char* file) const {
    return std::filesystem::exists(folder_ / file);
  }
  const test::TemporaryFolder folder_;
  KeyframeGrowth growth_{{}, {0}, {}};
};

TEST_F(KeyframeHistoryTest, GivesBackWhatGrewAndWhatMoved) {
  std::string state;
  {
    KeyframeHistory history(folder_.path());
    add(3);
    expect_read_back(sync(history, false));
    add(2);
    growth_.loops.push_back({0, 4, true, 0.5, {0, 4, Pose(), Matrix6d::Identity()}, ""});
    move();
    expect_read_back(sync(history, true));
    add(1);
    growth_.segment_starts.push_back(5);
    growth_.loops.push_back({1, 5, false, 0.0, {1, 5, Pose(), Matrix6d::Zero()}, "too far"});
    state = sync(history, false);
    expect_read_back(state);
  }
  BinaryReader reader(state, "state");
  KeyframeGrowth read;
  KeyframeHistory again(folder_.path(), reader, read);
  add(4);
  expect_read_back(sync(again, false));
}

// Two checkpoints may count on two files of poses; a third is there only until the next.
TEST_F(KeyframeHistoryTest, KeepsThePosesThatTheCheckpointBeforeCountsOn) {
  KeyframeHistory history(folder_.path());
  add(3);
  std::string before;
  for (int i = 0; i < 5; ++i) {
    before = sync(history, true);
    move();
  }
  EXPECT_FALSE(there("poses.2.bin"));
  EXPECT_TRUE(there("poses.4.bin") && there("poses.5.bin"));
  sync(history, true);
  KeyframeGrowth read;
  BinaryReader reader(before, "state");
  EXPECT_NO_THROW(KeyframeHistory(folder_.path(), reader, read));
}

TEST_F(KeyframeHistoryTest, WhatACheckpointHoldsDoesNotGrow) {
  KeyframeHistory history(folder_.path());
  add(3);
  const std::size_t few = sync(history, true).size();
  add(3'000);
  EXPECT_EQ(sync(history, true).size(), few);
}

TEST_F(KeyframeHistoryTest, LoopsToKeyframesThatAreNotThereAreRefused) {
  KeyframeHistory history(folder_.path());
  add(3);
  growth_.loops.push_back({0, 3, true, 0.5, {}, ""});
  BinaryReader reader(sync(history, false), "state");
  KeyframeGrowth read;
  EXPECT_THROW(KeyframeHistory(folder_.path(), reader, read), InputError);
}

TEST(Insertions, TakeFewBytesWhereTheyFollowEachOther) {
  std::vector<LocalMapInsertion> insertions;
  for (std::uint64_t k = 3; k < 40; ++k)
    insertions.push_back({k, 0});
  insertions.back().forget = 1;
  insertions.push_back({50, 1});
  for (std::uint64_t k = 51; k < 5000; ++k)
    insertions.push_back({k, k % kForgetEvery == 0 ? 1U : 0U});
  BinaryWriter writer;
  put_insertions(writer, insertions);
  EXPECT_LE(writer.bytes().size(), 8 + 3 * 24U);
  BinaryReader reader(writer.bytes(), "state");
  const std::vector<LocalMapInsertion> read = get_insertions(reader, 5000);
  ASSERT_EQ(read.size(), insertions.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read[i].keyframe, insertions[i].keyframe);
    EXPECT_EQ(read[i].forget, insertions[i].forget) << i;
  }
  BinaryReader again(writer.bytes(), "state");
  EXPECT_THROW(static_cast<void>(get_insertions(again, 4999)), InputError);
}

}  // namespace
}  // namespace understory
