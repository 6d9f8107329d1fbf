#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <thread>
#include <vector>

#include "understory/pipeline/mapping/realtime_player.h"
#include "understory/pipeline/run_folder/checkpoint.h"
#include "understory/pipeline/run_folder/journal.h"
#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

ScanRecord record_of(int i) {
  ScanRecord record;
  record.stamp = i;
  record.keyframe = i / 10;
  record.set_pose(Pose::exp((Vector6d() << 0.1 * i, 0.2, 0.3, i, 2, 3).finished()));
  Matrix6d covariance = Matrix6d::Identity() * i;
  covariance(1, 4) = covariance(4, 1) = 0.5;
  record.set_covariance(covariance);
  return record;
}

TEST(Journal, GivesBackWhatWasWrittenBitForBit) {
  const test::TemporaryFolder folder;
  Journal journal(folder / "journal");
  for (int i = 0; i < 20; ++i)
    journal.append(record_of(i));
  int i = 0;
  journal.for_each([&](const ScanRecord& record) {
    EXPECT_EQ(record.stamp, i);
    EXPECT_EQ(record.keyframe_from_body().matrix(), record_of(i).keyframe_from_body().matrix());
    EXPECT_EQ(record.pose_covariance(), record_of(i).pose_covariance());
    EXPECT_EQ(record.pose_covariance()(4, 1), 0.5);
    ++i;
  });
  EXPECT_EQ(i, 20);
}

TEST(Journal, ReopeningKeepsWhatTheCheckpointKnows) {
  const test::TemporaryFolder folder;
  const auto path = folder / "journal";
  RecordCount known;
  RecordCount more;
  {
    Journal journal(path);
    for (int i = 0; i < 20; ++i) {
      if (i == 5) known = journal.count();
      journal.append(record_of(i));
    }
    more = journal.count();
  }
  Journal journal(path, known);
  journal.append(record_of(77));
  std::vector<TimeNs> stamps;
  journal.for_each([&](const ScanRecord& record) { stamps.push_back(record.stamp); });
  EXPECT_EQ(stamps, (std::vector<TimeNs>{0, 1, 2, 3, 4, 77}));
  EXPECT_THROW(Journal(path, more), InputError);
}

class CheckpointTest : public ::testing::Test {
 protected:
  std::vector<std::string> read() {
    problems_.clear();
    std::vector<std::string> contents;
    for (const Checkpoint& checkpoint : read_checkpoints(folder_.path(), problems_))
      contents.push_back(checkpoint.bytes);
    return contents;
  }
  void spoil(std::uint64_t number, int from_end) {
    std::fstream file(checkpoint_file(folder_.path(), number),
                      std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(-from_end, std::ios::end);
    file.put('x');
  }
  const test::TemporaryFolder folder_;
  std::vector<std::string> problems_;
};

TEST_F(CheckpointTest, TheNewestTwoAreThereNewestFirst) {
  EXPECT_THROW(read(), InputError);
  std::string bytes = "state";
  bytes += '\0';
  write_checkpoint(folder_.path(), 0, bytes);
  EXPECT_EQ(read(), (std::vector<std::string>{bytes}));
  for (std::uint64_t number = 1; number < 4; ++number) {
    write_checkpoint(folder_.path(), number, "state " + std::to_string(number));
    EXPECT_TRUE(std::filesystem::exists(checkpoint_file(folder_.path(), 0)));
  }
  EXPECT_EQ(read(), (std::vector<std::string>{"state 3", "state 2"}));
  EXPECT_TRUE(problems_.empty());
}

TEST_F(CheckpointTest, ADamagedOneIsPassedOver) {
  write_checkpoint(folder_.path(), 4, "before");
  write_checkpoint(folder_.path(), 5, "newest");
  spoil(5, 1);
  EXPECT_EQ(read(), (std::vector<std::string>{"before"}));
  ASSERT_EQ(problems_.size(), 1U);
  EXPECT_NE(problems_[0].find("damaged"), std::string::npos);
  spoil(4, 25);  // its number
  EXPECT_TRUE(read().empty());
  EXPECT_EQ(problems_.size(), 2U);
}

TEST_F(CheckpointTest, WhatCannotBeWrittenIsAnOutputError) {
  EXPECT_THROW(write_checkpoint(folder_ / "missing", 0, "x"), OutputError);
}

// A recording of scans 10 ms apart, `count` of them.
class Ticks : public Recording {
 public:
  explicit Ticks(int count) : count_(count) {}
  std::optional<Event> next() override {
    if (i_ == count_) return std::nullopt;
    auto scan = std::make_shared<Scan>();
    scan->stamp = 1'000 * kNsPerSecond + 10'000'000 * TimeNs{i_++};
    return Event(ScanPtr(scan));
  }
  const Rig& rig() const override { return rig_; }
  std::vector<TopicReport> topics() const override { return {}; }
  std::string format() const override { return "ticks"; }
  double progress() const override { return 0.0; }

 private:
  Rig rig_;
  int count_;
  int i_ = 0;
};

TEST(RealtimePlayer, GivesEventsNoEarlierThanTheSensorWould) {
  const auto start = std::chrono::steady_clock::now();
  RealtimePlayer player(std::make_unique<Ticks>(11), 4);
  int scans = 0;
  while (player.next())
    ++scans;
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  EXPECT_EQ(scans + static_cast<int>(player.dropped_scans()), 11);
  EXPECT_GE(elapsed.count(), 0.1);
}

TEST(RealtimePlayer, DropsTheOldestScansForASlowConsumer) {
  RealtimePlayer player(std::make_unique<Ticks>(11), 2);
  const auto first = player.next();
  ASSERT_TRUE(first);
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  std::vector<TimeNs> rest;
  while (auto event = player.next())
    rest.push_back(event_time(*event));
  ASSERT_EQ(rest.size(), 2U);
  EXPECT_EQ(rest.back(), 1'000 * kNsPerSecond + 100'000'000);
  EXPECT_EQ(player.dropped_scans(), 8U);
  EXPECT_GT(player.latency_ms(rest.back()), 100.0);
}

// Any events, one after another.
class Listed : public Recording {
 public:
  explicit Listed(std::vector<Event> events) : events_(std::move(events)) {}
  std::optional<Event> next() override {
    if (i_ == events_.size()) return std::nullopt;
    return events_[i_++];
  }
  const Rig& rig() const override { return rig_; }
  std::vector<TopicReport> topics() const override { return {}; }
  std::string format() const override { return "list"; }
  double progress() const override { return 0.0; }

 private:
  Rig rig_;
  std::vector<Event> events_;
  std::size_t i_ = 0;
};

constexpr TimeNs kYear = 31'536'000 * kNsPerSecond;

// Scans 20 ms apart and IMU samples 10 ms apart whose clock is years behind; both jump by a year.
std::vector<Event> clocks_apart() {
  std::vector<Event> events;
  for (TimeNs i = 0; i < 20; ++i) {
    const TimeNs jump = i < 10 ? 0 : kYear;
    const TimeNs back = i < 15 ? 0 : -kYear;
    ImuSample sample;
    sample.stamp = 10'000'000 * i + jump + back;
    events.emplace_back(sample);
    if (i % 2 == 1) continue;
    auto scan = std::make_shared<Scan>();
    scan->stamp = 50 * kYear + 10'000'000 * i + jump;
    events.emplace_back(ScanPtr(scan));
  }
  return events;
}

// Regression: the second stream was waited for by the clock of the first, for years.
TEST(RealtimePlayer, PlaysEachStreamByItsOwnClock) {
  const auto start = std::chrono::steady_clock::now();
  RealtimePlayer player(std::make_unique<Listed>(clocks_apart()), 100);
  int events = 0;
  while (player.next())
    ++events;
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  EXPECT_EQ(events, 30);
  EXPECT_GE(elapsed.count(), 0.12);  // two jumps cost no more than the step that each replaces
  EXPECT_LT(elapsed.count(), 20.0);
}

TEST(RealtimePlayer, HearsTheUserWhileItWaits) {
  std::vector<Event> events(2);
  events[0] = ImuSample();
  ImuSample late;
  late.stamp = RealtimePlayer::kLongestWait - 1;
  events[1] = late;
  std::atomic<bool> stop = false;
  const auto start = std::chrono::steady_clock::now();
  {
    RealtimePlayer player(std::make_unique<Listed>(events), 2, [&] { return stop.load(); });
    EXPECT_TRUE(player.next());
    std::thread user([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      stop = true;
    });
    EXPECT_FALSE(player.next());
    user.join();
  }
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(8));
}

TEST(RealtimePlayer, CanBeLeftBeforeTheEnd) {
  const auto start = std::chrono::steady_clock::now();
  { RealtimePlayer player(std::make_unique<Ticks>(1'000), 2); }
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(5));
}

}  // namespace
}  // namespace understory
