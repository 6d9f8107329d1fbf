#include "understory/preprocess/streams/event_orderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "understory/preprocess/streams/test_streams.h"
#include "understory/util/random.h"

namespace understory {
namespace {

TEST(EventOrderer, PassesAnOrderlyRecordingOnUnchanged) {
  const std::vector<Event> events = recording(5.0);
  const Outcome outcome = run(events);
  EXPECT_EQ(outcome.events.size(), events.size());
  EXPECT_TRUE(outcome.warnings.empty());
  expect_sound(outcome);
  EXPECT_EQ(outcome.report.scans_without_imu, 0U);
}

TEST(EventOrderer, NothingLagsBehindWithoutWindow) {
  EventOrderer::Config config;
  config.window_s = 0.0;
  Log log;
  EventOrderer orderer(config, log);
  // Until the first scan nobody needs the IMU, and the sample after it tells how its clock runs.
  orderer.push(imu(kEpoch));
  EXPECT_FALSE(orderer.pop().has_value());
  orderer.push(scan(kEpoch - 50 * kMs));  // ends 49 ms past the last IMU sample
  EXPECT_FALSE(orderer.pop().has_value());
  orderer.push(imu(kEpoch + 40 * kMs));
  EXPECT_EQ(orderer.pop()->index(), EventOrderer::kImu);
  EXPECT_EQ(orderer.pop()->index(), EventOrderer::kImu);
  EXPECT_FALSE(orderer.pop().has_value());
  orderer.push(imu(kEpoch + 50 * kMs));
  EXPECT_EQ(orderer.pop()->index(), EventOrderer::kImu);
  EXPECT_EQ(orderer.pop()->index(), EventOrderer::kLidar);
  orderer.push(imu(kEpoch + 60 * kMs));
  EXPECT_TRUE(orderer.pop().has_value());
}

// Where there is no IMU, only the first scan waits for it.
TEST(EventOrderer, NothingLagsBehindWithoutImu) {
  EventOrderer::Config config;
  config.window_s = 0.0;
  Log log;
  EventOrderer orderer(config, log);
  orderer.push(scan(kEpoch));
  orderer.push(scan(kEpoch + 200 * kMs));
  EXPECT_FALSE(orderer.pop().has_value());
  orderer.push(scan(kEpoch + 400 * kMs));
  for (int k = 0; k < 3; ++k)
    EXPECT_TRUE(orderer.pop().has_value());
  orderer.push(scan(kEpoch + 600 * kMs));
  EXPECT_TRUE(orderer.pop().has_value());
  // One that shows up later is waited for again.
  orderer.push(imu(kEpoch + 700 * kMs));
  orderer.push(scan(kEpoch + 700 * kMs));
  EXPECT_FALSE(orderer.pop().has_value());
  orderer.push(imu(kEpoch + 800 * kMs));
  for (int k = 0; k < 3; ++k)
    EXPECT_TRUE(orderer.pop().has_value());
  orderer.push(scan(kEpoch + 800 * kMs));
  EXPECT_FALSE(orderer.pop().has_value());
}

// A scan of other content than all others.
ScanPtr scan_apart(TimeNs stamp, int number) {
  auto made = std::make_shared<Scan>(*scan(stamp));
  made->points[0].x = static_cast<float>(number);
  return made;
}

// A message recorded twice loses nothing; a clock that stands still loses what the sensor saw.
TEST(EventOrderer, AClockThatStandsStillIsNoMessageRecordedTwice) {
  std::vector<Event> twice;
  std::vector<Event> still;
  for (int k = 0; k < 50; ++k) {
    const ScanPtr each = scan_apart(kEpoch + k * 100 * kMs, k);
    twice.emplace_back(each);
    twice.emplace_back(std::make_shared<Scan>(*each));
    still.emplace_back(scan_apart(kEpoch + std::min(k, 20) * 100 * kMs, k));
    for (int i = 0; i < 10; ++i) {
      const ImuSample sample = imu(kEpoch + (k * 100 + 10 * i) * kMs + 101 * kMs);
      twice.emplace_back(sample);
      still.emplace_back(sample);
    }
  }
  const auto lidar_of = [](const std::vector<Event>& events) {
    return run(events).report.streams[EventOrderer::kLidar];
  };
  EXPECT_EQ(lidar_of(twice).duplicates, 50U);
  EXPECT_EQ(lidar_of(twice).stamp_taken, 0U);
  EXPECT_EQ(lidar_of(twice).released, 50U);
  EXPECT_EQ(lidar_of(still).duplicates, 0U);
  EXPECT_EQ(lidar_of(still).stamp_taken, 29U);
  EXPECT_EQ(lidar_of(still).released, 21U);
}

TEST(EventOrderer, SensorsWhoseClocksStandStillAreCounted) {
  std::vector<Event> events = recording(3.0);
  for (int k = 0; k < 7; ++k) {
    GnssFix same = fix(kEpoch + 2000 * kMs);
    same.latitude_deg = 61.0 + k;
    events.emplace_back(same);
  }
  EXPECT_EQ(run(events).report.streams[EventOrderer::kGnss].stamp_taken, 7U);
}

TEST(EventOrderer, TellsWhereEachStreamEnds) {
  const Outcome outcome = run(recording(3.0));
  const auto& streams = outcome.report.streams;
  EXPECT_EQ(streams[EventOrderer::kImu].newest, kEpoch + 2993 * kMs);
  EXPECT_EQ(streams[EventOrderer::kLidar].newest, kEpoch + 2899 * kMs);
  EXPECT_EQ(streams[EventOrderer::kMag].newest, 0);
}

TEST(EventOrderer, PutsShuffledMessagesInOrderAndDropsDuplicates) {
  const std::vector<Event> clean = recording(6.0);
  std::vector<Event> events = clean;
  Random random(5);
  for (std::size_t i = 0; i + 8 < events.size(); i += 4)
    std::swap(events[i], events[i + 1 + random.below(7)]);
  for (int i = 0; i < 20; ++i) {
    const auto at = static_cast<std::ptrdiff_t>(random.below(events.size() - 5));
    events.insert(events.begin() + at + 3, events[static_cast<std::size_t>(at)]);
  }
  const Outcome outcome = run(events);
  EXPECT_EQ(stamps(outcome.events), stamps(run(clean).events));
  std::uint64_t duplicates = 0;
  std::uint64_t reordered = 0;
  for (const auto& stream : outcome.report.streams) {
    duplicates += stream.duplicates;
    reordered += stream.reordered;
  }
  EXPECT_EQ(duplicates, 20U);
  EXPECT_GT(reordered, 10U);
}

TEST(EventOrderer, ShiftsAnImuWhoseClockJumpsAndComesBack) {
  std::vector<Event> events = recording(10.0);
  const std::vector<Event> clean = events;
  for (Event& event : events) {
    auto* sample = std::get_if<ImuSample>(&event);
    if (sample != nullptr && sample->stamp > kEpoch + 3000 * kMs &&
        sample->stamp < kEpoch + 7000 * kMs)
      sample->stamp += 1'000'000 * kMs;
  }
  const Outcome outcome = run(events);
  EXPECT_EQ(outcome.report.streams[EventOrderer::kImu].clock_jumps, 2U);
  ASSERT_EQ(outcome.events.size(), clean.size());
  const auto expected = stamps(run(clean).events);
  const auto got = stamps(outcome.events);
  for (std::size_t i = 0; i < got.size(); ++i) {
    EXPECT_EQ(got[i].first, expected[i].first);
    EXPECT_LE(std::llabs(got[i].second - expected[i].second), kMs);
  }
  EXPECT_EQ(outcome.report.scans_without_imu, 0U);
}

TEST(EventOrderer, ShiftsEverythingWhenAllClocksGoBack) {
  std::vector<Event> events = recording(10.0);
  for (Event& event : events) {
    if (event_time(event) < kEpoch + 5000 * kMs) continue;
    if (auto* sample = std::get_if<ImuSample>(&event)) sample->stamp -= 100'000 * kMs;
    if (auto* made = std::get_if<ScanPtr>(&event)) *made = scan((*made)->stamp - 100'000 * kMs);
    if (auto* made = std::get_if<GnssFix>(&event)) made->stamp -= 100'000 * kMs;
  }
  const Outcome outcome = run(events);
  expect_sound(outcome);
  EXPECT_GE(outcome.events.size() + 4, events.size());  // those at the very moment may be lost
  for (const Event& event : outcome.events) {
    EXPECT_GT(event_time(event), kEpoch - 200 * kMs);
    EXPECT_LT(event_time(event), kEpoch + 10'200 * kMs);
  }
}

TEST(EventOrderer, ALidarAloneThatGoesBackGoesOn) {
  std::vector<Event> events;
  for (int i = 0; i < 40; ++i)
    events.emplace_back(scan(kEpoch + (i < 20 ? i : i - 600) * 100 * kMs));
  const Outcome outcome = run(events);
  ASSERT_EQ(outcome.events.size(), 40U);
  for (int i = 0; i < 40; ++i)
    EXPECT_EQ(stamp_of(outcome.events[static_cast<std::size_t>(i)]), kEpoch + i * 100 * kMs);
}

TEST(EventOrderer, AGapOfTheRecordingIsNoJump) {
  std::vector<Event> events;
  for (const Event& event : recording(20.0)) {
    const TimeNs since = event_time(event) - kEpoch;
    if (since < 5000 * kMs || since > 15'000 * kMs) events.push_back(event);
  }
  const Outcome outcome = run(events);
  EXPECT_EQ(outcome.events.size(), events.size());
  for (const auto& stream : outcome.report.streams) {
    EXPECT_EQ(stream.clock_jumps, 0U);
    EXPECT_EQ(stream.glitches, 0U);
  }
  EXPECT_EQ(outcome.report.streams[EventOrderer::kLidar].gaps, 1U);
  EXPECT_EQ(outcome.report.streams[EventOrderer::kImu].gaps, 1U);
}

TEST(EventOrderer, AnOutageOfTheLidarIsNoJump) {
  std::vector<Event> events;
  for (const Event& event : recording(20.0)) {
    const TimeNs since = event_time(event) - kEpoch;
    if (event.index() != EventOrderer::kLidar || since < 5000 * kMs || since > 15'000 * kMs)
      events.push_back(event);
  }
  const Outcome outcome = run(events);
  EXPECT_EQ(outcome.events.size(), events.size());
  EXPECT_EQ(outcome.report.streams[EventOrderer::kLidar].clock_jumps, 0U);
  EXPECT_EQ(outcome.report.streams[EventOrderer::kLidar].gaps, 1U);
  expect_sound(outcome);
}

TEST(EventOrderer, ASingleWildStampIsDropped) {
  std::vector<Event> events = recording(4.0);
  events.insert(events.begin() + 150, imu(kEpoch + 50'000'000 * kMs));
  const Outcome outcome = run(events);
  EXPECT_EQ(outcome.report.streams[EventOrderer::kImu].glitches, 1U);
  EXPECT_EQ(outcome.events.size(), events.size() - 1);
  expect_sound(outcome);
}

TEST(EventOrderer, ReleasesScansWhenTheImuFallsSilent) {
  std::vector<Event> events;
  for (const Event& event : recording(6.0)) {
    if (event.index() != EventOrderer::kImu || event_time(event) < kEpoch + 3000 * kMs)
      events.push_back(event);
  }
  const Outcome outcome = run(events);
  EXPECT_EQ(outcome.events.size(), events.size());
  EXPECT_GT(outcome.report.scans_without_imu, 25U);
  EXPECT_LT(outcome.report.scans_without_imu, 32U);
}

// Regression: after the IMU had died every gap of the lidar made 1,000 scans wait.
TEST(EventOrderer, AGapOfTheLidarIsSeenAtOnceWhereTheImuHasDied) {
  for (const double window : {0.5, 0.0}) {
    EventOrderer::Config config;
    config.window_s = window;
    Log log;
    EventOrderer orderer(config, log);
    std::size_t waiting = 0;
    std::size_t most = 0;
    for (const Event& event : recording(30.0)) {
      const TimeNs since = event_time(event) - kEpoch;
      const bool lidar = event.index() == EventOrderer::kLidar;
      if (!lidar && since > 3000 * kMs) continue;
      if (lidar && since > 8000 * kMs && since % (6000 * kMs) < 3000 * kMs) continue;
      orderer.push(event);
      waiting += lidar ? 1 : 0;
      while (auto ready = orderer.pop())
        waiting -= ready->index() == EventOrderer::kLidar ? 1 : 0;
      most = std::max(most, waiting);
    }
    EXPECT_LE(most, window > 0.0 ? 8U : 4U);
    EXPECT_EQ(orderer.report().streams[EventOrderer::kLidar].clock_jumps, 0U);
    EXPECT_GE(orderer.report().streams[EventOrderer::kLidar].gaps, 3U);
    EXPECT_GT(orderer.report().streams[EventOrderer::kLidar].unused, 8000 * kMs);
    EXPECT_GT(orderer.report().streams[EventOrderer::kImu].unused, 10'000 * kMs);
  }
}

// An IMU that dies at the moment of the gap is waited for by a second of scans, not by 1,000.
TEST(EventOrderer, AGapThatTheImuDoesNotSurviveIsDecidedWithinASecond) {
  Log log;
  EventOrderer orderer({}, log);
  std::size_t held = 0;
  std::size_t most = 0;
  for (const Event& event : recording(20.0)) {
    const TimeNs since = event_time(event) - kEpoch;
    if (since > 3000 * kMs && (event.index() != EventOrderer::kLidar || since < 6000 * kMs))
      continue;
    orderer.push(event);
    held += event.index() == EventOrderer::kLidar ? 1 : 0;
    while (auto ready = orderer.pop())
      held -= ready->index() == EventOrderer::kLidar ? 1 : 0;
    most = std::max(most, held);
  }
  EXPECT_LE(most, 16U);
  EXPECT_EQ(orderer.report().streams[EventOrderer::kLidar].clock_jumps, 0U);
}

TEST(EventOrderer, GoesOnFromASavedStateAsIfNothingHadHappened) {
  std::vector<Event> events = recording(8.0);
  Random random(9);
  for (std::size_t i = 0; i + 8 < events.size(); i += 4)
    std::swap(events[i], events[i + 1 + random.below(7)]);
  for (Event& event : events) {
    auto* sample = std::get_if<ImuSample>(&event);
    if (sample != nullptr && sample->stamp > kEpoch + 3000 * kMs) sample->stamp += 1'000'000 * kMs;
    if (sample != nullptr) sample->stamp -= 3'000 * kMs;  // held for the first two seconds
    if (auto* made = std::get_if<GnssFix>(&event)) made->stamp += 2'000 * kMs;
  }
  const auto expected = stamps(run(events).events);
  for (const std::size_t cut :
       {std::size_t{5}, std::size_t{150}, events.size() / 3, events.size() / 2}) {
    Log log;
    EventOrderer first({}, log);
    std::vector<Event> got;
    for (std::size_t i = 0; i < cut; ++i) {
      first.push(events[i]);
      while (auto event = first.pop())
        got.push_back(std::move(*event));
    }
    BinaryWriter writer;
    first.save(writer);
    EventOrderer second({}, log);
    BinaryReader reader(writer.bytes(), "test");
    second.load(reader);
    EXPECT_TRUE(reader.at_end());
    for (std::size_t i = cut; i <= events.size(); ++i) {
      if (i < events.size())
        second.push(events[i]);
      else
        second.finish();
      while (auto event = second.pop())
        got.push_back(std::move(*event));
    }
    EXPECT_EQ(stamps(got), expected);
  }
}

}  // namespace
}  // namespace understory
