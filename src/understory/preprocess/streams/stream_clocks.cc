#include <algorithm>
#include <cstdlib>

#include "understory/preprocess/streams/event_orderer.h"
#include "understory/preprocess/streams/event_stamp.h"

// EventOrderer: constant offsets between the clocks of streams.
namespace understory {
using namespace event_stamp;
namespace {

// Scans that wait for the verdict on the IMU's clock, and after which an IMU that has spoken once
// is silent.
constexpr std::ptrdiff_t kMostHeldScans = 64;
constexpr std::uint32_t kSilentAtStart = 4;
// A delay of arrival is shorter.
constexpr TimeNs kLongestDelay = 10 * kNsPerSecond;
constexpr StreamOffset::Limits kImuLimits;
// Receivers that compute a position for a second are common.
constexpr StreamOffset::Limits kSlowLimits{400'000'000, 1'000'000'000, 500'000'000, 3};

}  // namespace

// What the arrival of a message says of its clock; nothing where there is nothing to compare with.
std::optional<TimeNs> EventOrderer::lead(Stream stream, TimeNs raw) const {
  const Clock& clock = clocks_[stream];
  const Clock& lidar = clocks_[kLidar];
  const Clock& imu = clocks_[kImu];
  if (!lidar.seen) return std::nullopt;
  const TimeNs stamp = raw + clock.offset;
  if (stream != kImu) {
    if (held()) return std::nullopt;  // its clock may be the finer one
    return stamp -
           (imu.seen ? std::max(lidar.newest_time, imu.newest + imu.lag) : lidar.newest_time);
  }
  // The scan came between two samples.
  if (!clock.spoken || clock.scans_since == 0) return std::nullopt;
  const TimeNs step = raw - clock.last_raw;
  const bool usual = step > 0 && step < ns(config_.imu_gap_s);
  return stamp - lidar.newest_time - (usual ? step / 2 : 0);
}

void EventOrderer::weigh(Stream stream, TimeNs raw) {
  Clock& clock = clocks_[stream];
  if (clock.arrival.verdict() == StreamOffset::Verdict::kOpen) {
    if (const std::optional<TimeNs> ahead = lead(stream, raw)) {
      clock.arrival.add(*ahead, clocks_[kLidar].newest_time,
                        stream == kImu ? kImuLimits : kSlowLimits);
    }
  }
  clock.last_raw = raw;
  clock.spoken = true;
  clock.scans_since = 0;
  const Clock& imu = clocks_[kImu];
  if (stream != kImu) {
    clock.beside = imu.spoken;
    clock.imu_beside = imu.last_raw;
    return;
  }
  for (const Stream slow : {kGnss, kMag}) {
    Clock& other = clocks_[slow];
    if (!other.spoken || other.beside) continue;
    other.beside = true;
    other.imu_beside = raw;
  }
}

// Once the clock of the IMU is known, what came beside it can be judged by that.
void EventOrderer::weigh_beside_imu() {
  const Clock& imu = clocks_[kImu];
  for (const Stream stream : {kGnss, kMag}) {
    Clock& clock = clocks_[stream];
    if (held_[stream].empty() || !clock.beside) continue;
    const TimeNs ahead = clock.last_raw + clock.offset - (clock.imu_beside + imu.offset + imu.lag);
    clock.arrival.add(ahead, clocks_[kLidar].newest_time, kSlowLimits);
    if (clock.arrival.verdict() != StreamOffset::Verdict::kOpen) let_go(stream);
  }
}

// Scans wait for the verdict on the IMU's clock, but neither for long nor in great numbers.
void EventOrderer::note_scan() {
  Clock& imu = clocks_[kImu];
  ++imu.scans_since;
  if (!held()) return;
  const auto waiting = std::count_if(pending_.begin(), pending_.end(),
                                     [](const Pending& each) { return each.stream == kLidar; });
  if (imu.scans_since < kSilentAtStart && waiting < kMostHeldScans) return;
  imu.arrival.give_up();
  let_go(kImu);
}

// The messages that waited for the verdict on their clock go on.
void EventOrderer::let_go(Stream stream) {
  std::deque<Event>& held = held_[stream];
  if (held.empty()) return;
  mend_offset(stream);
  const auto step = [&](std::size_t i) {
    return std::abs(stamp_of(held[i + 1]) - stamp_of(held[i]));
  };
  // A first stamp far from the others would draw them after it.
  if (held.size() > 2 && step(0) > ns(config_.clock_jump_s) &&
      step(1) <= ns(config_.clock_jump_s)) {
    note_glitches(stream, stamp_of(held.front()), 1);
    held.pop_front();
  }
  std::deque<Event> waiting;
  waiting.swap(held);
  for (Event& event : waiting)
    take(std::move(event), stream);
  if (stream == kImu) weigh_beside_imu();
}

void EventOrderer::mend_offset(Stream stream) {
  Clock& clock = clocks_[stream];
  const TimeNs offset = clock.arrival.offset();
  if (offset == 0) return;
  const std::string about = std::string(kNames[stream]) + ": its stamps are " +
                            seconds(std::abs(offset)) + (offset > 0 ? " ahead of" : " behind") +
                            " the lidar's by the order of arrival";
  if (clock.trusted && std::abs(offset) < kLongestDelay) {
    clock.lag = -offset;
    log_->warn("time.clock_delay",
               about + "; this is a delay of arrival, and the stamps are not shifted");
    return;
  }
  clock.offset -= offset;
  report_.streams[stream].offset = -offset;
  log_->warn("time.clock_offset", about + "; stamps shifted");
}

}  // namespace understory
