#include "understory/preprocess/event_orderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <map>

#include "understory/util/random.h"

namespace understory {
namespace {

constexpr TimeNs kMs = 1'000'000;
constexpr TimeNs kEpoch = 1'700'000'000'000 * kMs;

ImuSample imu(TimeNs stamp) {
  ImuSample sample;
  sample.stamp = stamp;
  sample.angular_rate.x() = static_cast<double>(stamp % 1000);
  return sample;
}

ScanPtr scan(TimeNs stamp) {
  auto made = std::make_shared<Scan>();
  made->stamp = stamp;
  made->points.resize(3);
  made->points[2].t_ns = 99 * kMs;
  return made;
}

GnssFix fix(TimeNs stamp) {
  GnssFix made;
  made.stamp = stamp;
  return made;
}

// Scans at 10 Hz, IMU at 100 Hz, GNSS at 1 Hz, each as it would be written when complete.
std::vector<Event> recording(double seconds) {
  std::vector<Event> events;
  const auto end = static_cast<TimeNs>(seconds * 1e9);
  for (TimeNs t = 0; t < end; t += 10 * kMs) {
    events.emplace_back(imu(kEpoch + t + 3 * kMs));
    if (t % (100 * kMs) == 0 && t > 0) events.emplace_back(scan(kEpoch + t - 100 * kMs));
    if (t % (1000 * kMs) == 0) events.emplace_back(fix(kEpoch + t));
  }
  return events;
}

TimeNs stamp_of(const Event& event) {
  if (const auto* p = std::get_if<ScanPtr>(&event)) return (*p)->stamp;
  if (const auto* p = std::get_if<ImuSample>(&event)) return p->stamp;
  if (const auto* p = std::get_if<GnssFix>(&event)) return p->stamp;
  return std::get<MagSample>(event).stamp;
}

struct Outcome {
  std::vector<Event> events;
  EventOrderer::Report report;
  std::vector<Log::Warning> warnings;
};

Outcome run(const std::vector<Event>& events, const EventOrderer::Config& config = {}) {
  Log log;
  EventOrderer orderer(config, log);
  Outcome outcome;
  const auto drain = [&] {
    while (auto event = orderer.pop())
      outcome.events.push_back(std::move(*event));
  };
  for (const Event& event : events) {
    orderer.push(event);
    drain();
  }
  orderer.finish();
  drain();
  outcome.report = orderer.report();
  outcome.warnings = log.warnings();
  return outcome;
}

std::vector<std::pair<std::size_t, TimeNs>> stamps(const std::vector<Event>& events) {
  std::vector<std::pair<std::size_t, TimeNs>> all;
  for (const Event& event : events)
    all.emplace_back(event.index(), stamp_of(event));
  return all;
}

// Every scan comes after an IMU sample at or past its end, and IMU and scans each in order.
void expect_sound(const Outcome& outcome) {
  TimeNs last_imu = 0;
  TimeNs last_scan = 0;
  for (const Event& event : outcome.events) {
    if (event.index() == EventOrderer::kImu) {
      EXPECT_GT(stamp_of(event), last_imu);
      last_imu = stamp_of(event);
    }
    if (event.index() == EventOrderer::kLidar) {
      EXPECT_GT(stamp_of(event), last_scan);
      last_scan = stamp_of(event);
      EXPECT_GE(last_imu, event_time(event));
    }
  }
}

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

TEST(EventOrderer, ClocksThatNeverAgreedAreBroughtTogether) {
  std::vector<Event> events = recording(5.0);
  for (Event& event : events) {
    if (auto* sample = std::get_if<ImuSample>(&event)) sample->stamp -= kEpoch;
  }
  const Outcome outcome = run(events);
  EXPECT_GE(outcome.events.size() + 2, events.size());
  EXPECT_LE(outcome.report.scans_without_imu, 2U);
}

// The stamps of one stream moved; the order of arrival stays.
std::vector<Event> shifted(std::vector<Event> events, std::size_t stream, TimeNs offset) {
  for (Event& event : events) {
    if (event.index() != stream) continue;
    if (auto* p = std::get_if<ImuSample>(&event)) p->stamp += offset;
    if (auto* p = std::get_if<GnssFix>(&event)) p->stamp += offset;
    if (auto* p = std::get_if<MagSample>(&event)) p->stamp += offset;
    if (auto* p = std::get_if<ScanPtr>(&event)) *p = scan((*p)->stamp + offset);
  }
  return events;
}

std::vector<Event> with_mag(const std::vector<Event>& events) {
  std::vector<Event> all;
  for (const Event& event : events) {
    all.push_back(event);
    const TimeNs since = event_time(event) - kEpoch;
    if (event.index() != EventOrderer::kImu || since % (20 * kMs) != 3 * kMs) continue;
    MagSample sample;
    sample.stamp = event_time(event) + kMs;
    all.emplace_back(sample);
  }
  return all;
}

std::vector<TimeNs> stamps_of(const std::vector<Event>& events, std::size_t stream) {
  std::vector<TimeNs> all;
  for (const Event& event : events) {
    if (event.index() == stream) all.push_back(stamp_of(event));
  }
  return all;
}

constexpr double kOffsetsS[] = {-1.7e9, -60.0, -5.0, -2.0, -0.5, 0.5, 2.0, 5.0, 60.0, 1.7e9};

// Regression: a GNSS whose stamps ran ahead made the IMU late, and the run went on without it.
TEST(EventOrderer, AClockThatRunsAheadOrBehindMakesNoOtherStreamLate) {
  const std::vector<Event> clean = with_mag(recording(12.0));
  const Outcome expected = run(clean);
  for (const double window : {0.5, 0.0}) {
    EventOrderer::Config config;
    config.window_s = window;
    for (const std::size_t stream : {EventOrderer::kGnss, EventOrderer::kMag}) {
      for (const double offset : kOffsetsS) {
        const Outcome outcome = run(shifted(clean, stream, from_seconds(offset)), config);
        for (const std::size_t other :
             {EventOrderer::kLidar, EventOrderer::kImu, EventOrderer::kGnss, EventOrderer::kMag}) {
          SCOPED_TRACE("stream " + std::to_string(other) + " where " + std::to_string(stream) +
                       " is off by " + std::to_string(offset));
          EXPECT_EQ(outcome.report.streams[other].late, 0U);
          EXPECT_EQ(outcome.report.streams[other].released, outcome.report.streams[other].received);
          if (other == stream) continue;
          EXPECT_EQ(stamps_of(outcome.events, other), stamps_of(expected.events, other));
        }
        EXPECT_LE(outcome.report.scans_without_imu, 1U);
        // A fix or field that comes half a second late may have been computed for so long.
        const bool mended = std::abs(offset) > 0.6 || offset > 0.0;
        const auto error = outcome.report.streams[stream].offset + from_seconds(offset);
        const TimeNs most = 100 * kMs;
        EXPECT_LE(std::llabs(mended ? error : outcome.report.streams[stream].offset), most);
      }
    }
  }
}

TEST(EventOrderer, AnImuWhoseClockRunsAheadOrBehindIsShiftedFromItsFirstSample) {
  const std::vector<Event> clean = recording(12.0);
  const Outcome expected = run(clean);
  for (const double window : {0.5, 0.0}) {
    EventOrderer::Config config;
    config.window_s = window;
    for (const double offset : kOffsetsS) {
      SCOPED_TRACE(offset);
      const Outcome outcome = run(shifted(clean, EventOrderer::kImu, from_seconds(offset)), config);
      const auto& report = outcome.report.streams[EventOrderer::kImu];
      EXPECT_EQ(report.released, report.received);
      EXPECT_LE(std::llabs(report.offset + from_seconds(offset)), 10 * kMs);
      EXPECT_LT(report.without_say, 200 * kMs);
      EXPECT_EQ(outcome.warnings.size(), 1U);
      EXPECT_EQ(stamps_of(outcome.events, EventOrderer::kLidar),
                stamps_of(expected.events, EventOrderer::kLidar));
      EXPECT_EQ(stamps_of(outcome.events, EventOrderer::kGnss),
                stamps_of(expected.events, EventOrderer::kGnss));
    }
  }
}

TEST(EventOrderer, AnImuThatComesLateIsWaitedForWhereItsStampsAreBelieved) {
  const std::vector<Event> late = shifted(recording(12.0), EventOrderer::kImu, -2000 * kMs);
  Log log;
  EventOrderer orderer({}, log);
  orderer.believe_stamps(EventOrderer::kImu);
  Outcome outcome;
  for (const Event& event : late) {
    orderer.push(event);
    while (auto ready = orderer.pop())
      outcome.events.push_back(std::move(*ready));
  }
  // Up to the end of the recording every scan leaves after the samples that cover it.
  expect_sound(outcome);
  EXPECT_EQ(orderer.report().streams[EventOrderer::kImu].offset, 0);
  EXPECT_EQ(log.warnings().at(0).key, "time.clock_delay");
  EXPECT_GT(orderer.report().streams[EventOrderer::kLidar].released, 90U);
}

// Recorders write what they buffered while the first topics were looked for in one go.
TEST(EventOrderer, AStartUpBufferIsNoOffset) {
  const std::vector<Event> clean = recording(12.0);
  for (const std::size_t first : {EventOrderer::kImu, EventOrderer::kLidar, EventOrderer::kGnss}) {
    std::vector<Event> events = clean;
    const auto end = std::find_if(events.begin(), events.end(), [](const Event& event) {
      return event_time(event) > kEpoch + 3000 * kMs;
    });
    std::stable_partition(events.begin(), end,
                          [&](const Event& event) { return event.index() == first; });
    const Outcome outcome = run(events);
    for (const auto& stream : outcome.report.streams) {
      EXPECT_EQ(stream.offset, 0);
      EXPECT_EQ(stream.late, 0U);
    }
    EXPECT_EQ(outcome.events.size(), events.size());
    EXPECT_EQ(stamps_of(outcome.events, EventOrderer::kImu), stamps_of(clean, EventOrderer::kImu));
  }
}

TEST(EventOrderer, SensorsThatStartLateAreTakenAsTheyAre) {
  for (const std::size_t late : {EventOrderer::kImu, EventOrderer::kLidar, EventOrderer::kGnss}) {
    std::vector<Event> events;
    for (const Event& event : recording(10.0)) {
      if (event.index() != late || event_time(event) > kEpoch + 4000 * kMs) events.push_back(event);
    }
    const Outcome outcome = run(events);
    EXPECT_EQ(outcome.events.size(), events.size());
    for (const auto& stream : outcome.report.streams)
      EXPECT_EQ(stream.offset, 0);
  }
}

TEST(EventOrderer, ASensorThatStartsLateIsShiftedAsWell) {
  std::vector<Event> events;
  for (const Event& event : shifted(recording(12.0), EventOrderer::kImu, 2000 * kMs)) {
    const bool early = event_time(event) < kEpoch + 6000 * kMs;
    if (event.index() != EventOrderer::kImu || !early) events.push_back(event);
  }
  const Outcome outcome = run(events);
  EXPECT_LE(std::llabs(outcome.report.streams[EventOrderer::kImu].offset + 2000 * kMs), 10 * kMs);
  EXPECT_EQ(outcome.events.size(), events.size());
  // The first four seconds had no IMU.
  EXPECT_NEAR(to_seconds(outcome.report.streams[EventOrderer::kImu].without_say), 4.0, 0.3);
}

// Stamps of which nothing can be made are taken as they are, in the end, and none is lost.
TEST(EventOrderer, AClockThatWandersIsNeitherMendedNorDropped) {
  std::vector<Event> events = with_mag(recording(12.0));
  TimeNs wander = 5'000 * kMs;
  for (Event& event : events) {
    if (auto* sample = std::get_if<MagSample>(&event)) sample->stamp += (wander += 15 * kMs);
  }
  const Outcome outcome = run(events);
  const auto& mag = outcome.report.streams[EventOrderer::kMag];
  EXPECT_EQ(mag.offset, 0);
  EXPECT_EQ(mag.released + mag.late + mag.glitches, mag.received);
  EXPECT_EQ(stamps_of(outcome.events, EventOrderer::kImu), stamps_of(events, EventOrderer::kImu));
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
    EXPECT_GT(orderer.report().streams[EventOrderer::kLidar].without_say, 8000 * kMs);
    EXPECT_GT(orderer.report().streams[EventOrderer::kImu].without_say, 10'000 * kMs);
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
