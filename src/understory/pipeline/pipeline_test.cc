#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <thread>

#include "understory/pipeline/checkpoint.h"
#include "understory/pipeline/journal.h"
#include "understory/pipeline/realtime_player.h"
#include "understory/util/error.h"
#include "understory/util/folder_test_support.h"

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
  Journal journal(folder / "journal", 0);
  for (int i = 0; i < 20; ++i)
    journal.append(record_of(i));
  journal.flush();
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
  {
    Journal journal(path, 0);
    for (int i = 0; i < 20; ++i)
      journal.append(record_of(i));
    journal.flush();
  }
  Journal journal(path, 5);
  journal.append(record_of(77));
  journal.flush();
  std::vector<TimeNs> stamps;
  journal.for_each([&](const ScanRecord& record) { stamps.push_back(record.stamp); });
  EXPECT_EQ(stamps, (std::vector<TimeNs>{0, 1, 2, 3, 4, 77}));
  EXPECT_THROW(Journal(path, 50), InputError);
}

TEST(Checkpoint, RoundTripAndDamage) {
  const test::TemporaryFolder folder;
  const auto path = folder / "checkpoint";
  EXPECT_THROW(static_cast<void>(read_checkpoint(path)), InputError);
  std::string bytes = "state";
  bytes += '\0';
  bytes += "more";
  write_checkpoint(path, bytes);
  EXPECT_EQ(read_checkpoint(path), bytes);
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(-1, std::ios::end);
  file.put('x');
  file.close();
  EXPECT_THROW(static_cast<void>(read_checkpoint(path)), InputError);
}

TEST(Checkpoint, AFullDiskIsAnOutputErrorAndKeepsTheOldCheckpoint) {
  const test::TemporaryFolder folder;
  EXPECT_THROW(write_checkpoint(folder / "missing" / "folder" / "c", "x"), OutputError);
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

TEST(RealtimePlayer, CanBeLeftBeforeTheEnd) {
  const auto start = std::chrono::steady_clock::now();
  { RealtimePlayer player(std::make_unique<Ticks>(1'000), 2); }
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(5));
}

}  // namespace
}  // namespace understory
