#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "understory/preprocess/streams/stream_offset.h"
#include "understory/recording/recording.h"
#include "understory/util/config/config.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/log.h"

namespace understory {

// Time repair. Events come in the order of the recording, which may be shuffled within limits, hold
// duplicates, and come from clocks that jump or run apart. They leave in the order of time.
//
// - Each stream has its own clock. The lidar's is the one that counts. A stream whose stamps are a
//   constant time ahead of or behind it, told by the order of arrival (stream_offset.h), is shifted
//   onto it from its first message on. Until this is told its messages wait, and scans wait for the
//   IMU; where the clocks agree that takes one message after the first scan.
// - Lidar and IMU move time on. An event leaves once the newest time of theirs is `window_s` ahead
//   of it. GNSS and magnetometer follow, and never make another stream late. With a window of 0
//   every stream is taken to be in order by itself, for least delay.
// - A scan's time is its end, and it leaves right after the first IMU sample at or past that end.
//   So deskewing never lacks samples, unless the IMU has been silent for `imu_silence_s`.
// - Same stream and same stamp: the second is dropped. With the same content it was recorded twice;
//   with other content its clock stands still, and what it says is lost. Earlier than what already
//   left of the same stream: dropped.
// - A stream whose stamps step away by more than `clock_jump_s` from its own past and from the
//   other sensors has a clock jump. Its stamps are shifted so that it goes on at its usual rate,
//   until it jumps back. If lidar and IMU step forward together, or the other one has fallen silent
//   before, it is a gap in the recording and the stamps stand. Backward together, all are shifted.
//   A single stamp far off is dropped.
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

  enum Stream : int { kLidar = 0, kImu, kGnss, kMag, kStreams };
  struct StreamReport {
    std::uint64_t received = 0;
    std::uint64_t released = 0;
    std::uint64_t reordered = 0;   // came after a later one, put right
    std::uint64_t duplicates = 0;  // recorded twice: same stamp, same content; dropped
    // The stamp of another message, but other content: the clock stands still. Dropped.
    std::uint64_t stamp_taken = 0;
    std::uint64_t late = 0;  // too late to be put right, dropped
    std::uint64_t clock_jumps = 0;
    std::uint64_t glitches = 0;  // single stamps far off, dropped
    std::uint64_t gaps = 0;
    TimeNs longest_gap = 0;
    TimeNs after_longest_gap = 0;  // stamp of the message that ended it
    TimeNs offset = 0;             // constant, added to its stamps to mend its clock
    TimeNs newest = 0;             // event time of the newest message taken, on the mended clock
    // Time of the recording in which the sensor was not used although the recording holds messages
    // of it. Lidar: gaps, and scans that were dropped. IMU: scans that left without it, for
    // whatever reason. Others: messages that were dropped, by their usual step.
    TimeNs unused = 0;
  };
  struct Report {
    std::array<StreamReport, kStreams> streams;
    std::uint64_t scans_without_imu = 0;  // released before the IMU covered their end
  };

  EventOrderer(const Config& config, Log& log);

  // Before the first push: a constant offset of this stream (below ten seconds) is taken for a
  // delay of its arrival. Its stamps stand, and scans wait for it if it is the IMU.
  void trust_stamps(Stream stream) { clocks_[stream].trusted = true; }
  [[nodiscard]] bool trusts_stamps(Stream stream) const { return clocks_[stream].trusted; }

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
    int rank = 0;     // among events of the same time: sensors before scans
    std::uint64_t order = 0;
    Stream stream = kLidar;
    TimeNs stamp = 0;  // on the mended clock
    Event event;
  };
  struct Clock {
    bool seen = false;
    TimeNs newest = 0;       // newest stamp, on the mended clock
    TimeNs newest_time = 0;  // newest event time
    TimeNs period = 0;       // running mean of the usual step, 0 = unknown
    TimeNs offset = 0;       // mended = raw + offset
    TimeNs released = 0;     // stamp of the last one that left
    bool any_released = false;
    std::uint64_t content = 0;      // of the last one that left, see event_content.h
    TimeNs unbroken_since = 0;      // stamp of the first that left after the last gap of an IMU
    bool trusted = false;           // stamps, against the order of arrival
    StreamOffset arrival;           // against the lidar's; not of the lidar itself
    TimeNs lag = 0;                 // by which its messages come late; negative: lidar's do
    TimeNs last_raw = 0;            // of the message that came last
    std::uint32_t scans_since = 0;  // that message
    bool spoken = false;            // there is one
    bool beside = false;            // of GNSS and magnetometer: the IMU spoke beside it ...
    TimeNs imu_beside = 0;          // ... with this stamp, as it came
  };

  void take(Event event, Stream stream);
  void accept(Event event, Stream stream);
  [[nodiscard]] std::optional<TimeNs> lead(Stream stream, TimeNs raw) const;
  void weigh(Stream stream, TimeNs raw);
  void weigh_beside_imu();
  void note_scan();
  void let_go(Stream stream);
  void mend_offset(Stream stream);
  [[nodiscard]] bool held() const { return !held_[kImu].empty(); }
  [[nodiscard]] bool suspicious(Stream stream, TimeNs raw) const;
  [[nodiscard]] std::optional<TimeNs> reference(Stream stream) const;
  // Decides what the waiting suspects are: `other` is a stamp of another sensor that came after
  // them, or nothing if none will come.
  void settle(std::optional<TimeNs> other);
  void shift(Stream stream, TimeNs raw, std::optional<TimeNs> other);
  void drop_suspects();
  void note_glitches(Stream stream, TimeNs raw, std::size_t count);
  void note_step(Stream stream, TimeNs stamp);
  [[nodiscard]] bool drop(const Pending& pending);
  void note_same_stamp(const Pending& pending, std::uint64_t content_before);
  [[nodiscard]] bool safe(const Pending& pending) const;
  [[nodiscard]] std::optional<std::size_t> next_to_leave();
  [[nodiscard]] bool covered(const Pending& scan);
  void note_uncovered(const Pending& scan);

  Config config_;
  Log* log_;
  Report report_;
  std::array<Clock, kStreams> clocks_;
  std::deque<Pending> pending_;                   // sorted by time, rank, order
  std::array<std::deque<Event>, kStreams> held_;  // until it is known how its clock runs
  std::vector<Event> suspects_;                   // of one stream, waiting for a word from another
  Stream suspect_stream_ = kLidar;
  TimeNs newest_ = 0;  // newest event time of lidar and IMU
  bool any_seen_ = false;
  TimeNs uncovered_ = 0;  // time of scans that left without IMU
  bool finished_ = false;
  std::uint64_t pushes_ = 0;
};

}  // namespace understory
