#pragma once

// Small recordings and what an orderer makes of them, for the tests of EventOrderer.
#include <gtest/gtest.h>

#include <memory>
#include <utility>
#include <vector>

#include "understory/preprocess/streams/event_orderer.h"

namespace understory {

constexpr TimeNs kMs = 1'000'000;
constexpr TimeNs kEpoch = 1'700'000'000'000 * kMs;

inline ImuSample imu(TimeNs stamp) {
  ImuSample sample;
  sample.stamp = stamp;
  sample.angular_rate.x() = static_cast<double>(stamp % 1000);
  return sample;
}

inline ScanPtr scan(TimeNs stamp) {
  auto made = std::make_shared<Scan>();
  made->stamp = stamp;
  made->points.resize(3);
  made->points[2].t_ns = 99 * kMs;
  return made;
}

inline GnssFix fix(TimeNs stamp) {
  GnssFix made;
  made.stamp = stamp;
  return made;
}

// Scans at 10 Hz, IMU at 100 Hz, GNSS at 1 Hz, each as it would be written when complete.
inline std::vector<Event> recording(double seconds) {
  std::vector<Event> events;
  const auto end = static_cast<TimeNs>(seconds * 1e9);
  for (TimeNs t = 0; t < end; t += 10 * kMs) {
    events.emplace_back(imu(kEpoch + t + 3 * kMs));
    if (t % (100 * kMs) == 0 && t > 0) events.emplace_back(scan(kEpoch + t - 100 * kMs));
    if (t % (1000 * kMs) == 0) events.emplace_back(fix(kEpoch + t));
  }
  return events;
}

inline TimeNs stamp_of(const Event& event) {
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

inline Outcome run(const std::vector<Event>& events, const EventOrderer::Config& config = {}) {
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

inline std::vector<std::pair<std::size_t, TimeNs>> stamps(const std::vector<Event>& events) {
  std::vector<std::pair<std::size_t, TimeNs>> all;
  for (const Event& event : events)
    all.emplace_back(event.index(), stamp_of(event));
  return all;
}

// Every scan comes after an IMU sample at or past its end, and IMU and scans each in order.
inline void expect_sound(const Outcome& outcome) {
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

}  // namespace understory
