// Streams whose clocks run apart, and sensors that start late.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "understory/preprocess/streams/event_orderer.h"
#include "understory/preprocess/streams/test_streams.h"

namespace understory {
namespace {

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
      EXPECT_LT(report.unused, 200 * kMs);
      EXPECT_EQ(outcome.warnings.size(), 1U);
      EXPECT_EQ(stamps_of(outcome.events, EventOrderer::kLidar),
                stamps_of(expected.events, EventOrderer::kLidar));
      EXPECT_EQ(stamps_of(outcome.events, EventOrderer::kGnss),
                stamps_of(expected.events, EventOrderer::kGnss));
    }
  }
}

TEST(EventOrderer, AnImuThatComesLateIsWaitedForWhereItsStampsAreTrusted) {
  const std::vector<Event> late = shifted(recording(12.0), EventOrderer::kImu, -2000 * kMs);
  Log log;
  EventOrderer orderer({}, log);
  orderer.trust_stamps(EventOrderer::kImu);
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
  EXPECT_NEAR(to_seconds(outcome.report.streams[EventOrderer::kImu].unused), 4.0, 0.3);
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

}  // namespace
}  // namespace understory
