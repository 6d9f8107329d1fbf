#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "understory/recording/recording.h"
#include "understory/util/binary_io.h"
#include "understory/util/config.h"
#include "understory/util/log.h"

namespace understory {

// Time repair. Events come in the order of the recording, which may be shuffled within limits, hold
// duplicates, and come from clocks that jump; they leave in the order of time.
//
// - An event leaves once no stream that is alive can bring an earlier one: every stream has passed
//   its time, or the newest time seen is `window_s` ahead.
// - A scan's time is its end, and it leaves after the first IMU sample at or past that end, so that
//   deskewing never lacks samples; unless the IMU has been silent for `imu_silence_s`.
// - Same stream and same stamp: the second is dropped. Later than what already left: dropped.
// - A stream whose stamps step away from its own past and from the other streams has a clock jump:
//   its stamps are shifted so that it goes on at its usual rate. If the other streams step along,
//   it is a gap in the recording and the stamps stand.
// Everything that was mended is counted and goes to the log under keys "time.*". The outcome
// depends on the order of the pushes alone. Not thread-safe.
class EventOrderer {
 public:
  struct Config {
    double window_s = 0.5;       // how far out of order an event may be
    double imu_silence_s = 0.3;  // a scan waits at most this long for the IMU
    double clock_jump_s = 1.0;   // smallest step between streams that counts as a jump
    double gap_scans = 2.5;      // a gap of the lidar, in scan periods
    double imu_gap_s = 0.1;      // a gap of the IMU
  };
  static void describe(ConfigTable& table, Config& config);

  enum Stream { kLidar = 0, kImu, kGnss, kMag, kStreams };
  struct StreamReport {
    std::uint64_t received = 0;
    std::uint64_t released = 0;
    std::uint64_t reordered = 0;   // came after a later one, put right
    std::uint64_t duplicates = 0;  // dropped
    std::uint64_t late = 0;        // too late to be put right, dropped
    std::uint64_t clock_jumps = 0;
    std::uint64_t gaps = 0;
    TimeNs longest_gap = 0;
  };
  struct Report {
    std::array<StreamReport, kStreams> streams;
    std::uint64_t scans_without_imu = 0;  // released before the IMU covered their end
  };

  EventOrderer(const Config& config, Log& log);

  void push(Event event);
  // The next event in order of time, or nothing yet.
  [[nodiscard]] std::optional<Event> pop();
  // No more pushes: everything left can be popped.
  void finish();

  [[nodiscard]] const Report& report() const { return report_; }
  // The whole state, pending events included.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  struct Pending {
    TimeNs time = 0;  // event time on the mended clock
    std::uint64_t order = 0;
    Stream stream = kLidar;
    Event event;
  };
  struct Clock {
    bool seen = false;
    TimeNs newest = 0;       // mended stamp of the newest event
    TimeNs newest_time = 0;  // mended event time of the newest event
    TimeNs period = 0;       // running estimate of the usual step
    TimeNs offset = 0;       // mended = raw + offset
  };

  void push_checked(Event event, Stream stream);
  [[nodiscard]] bool suspicious(Stream stream, TimeNs raw) const;
  void settle_suspects(Stream stream, TimeNs raw);
  void shift_clock(Stream stream, TimeNs raw);
  void release_suspects();
  void note_step(Stream stream, TimeNs stamp);
  void insert(Pending pending);
  [[nodiscard]] bool safe(const Pending& pending) const;
  [[nodiscard]] std::optional<TimeNs> other_newest(Stream stream) const;

  Config config_;
  Log* log_;
  Report report_;
  std::array<Clock, kStreams> clocks_;
  std::deque<Pending> pending_;  // sorted by (time, stream, order)
  std::vector<Event> suspects_;  // of one stream, waiting for a word from another
  std::optional<Stream> suspect_stream_;
  TimeNs newest_ = 0;    // newest event time of any stream
  TimeNs released_ = 0;  // time of the last event that left
  bool any_released_ = false;
  bool finished_ = false;
  std::uint64_t pushes_ = 0;
};

}  // namespace understory
