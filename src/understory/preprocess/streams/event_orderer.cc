#include "understory/preprocess/streams/event_orderer.h"

#include <algorithm>
#include <cstdlib>
#include <tuple>

#include "understory/preprocess/preprocess_constants.h"
#include "understory/preprocess/streams/event_content.h"
#include "understory/preprocess/streams/event_stamp.h"
#include "understory/recording/messages/event_bytes.h"
#include "understory/util/error.h"

namespace understory {
using namespace event_stamp;
namespace {

using namespace preprocess_constants::event_orderer;

}  // namespace

void EventOrderer::describe(ConfigTable& table, Config& config) {
  table.add("window_s", config.window_s, {0.0, 10.0}, "s",
            "how far out of order messages may be; 0 = each sensor is in order, for least delay");
  table.add("imu_silence_s", config.imu_silence_s, {0.0, 10.0}, "s",
            "a scan waits at most this long for the IMU to cover its end");
  table.add("clock_jump_s", config.clock_jump_s, {0.1, 1000.0}, "s",
            "smallest step of one sensor's clock that counts as a jump");
  table.add("gap_scans", config.gap_scans, {1.5, 100.0}, "periods",
            "a longer step between scans is reported as a gap");
  table.add("imu_gap_s", config.imu_gap_s, {0.01, 10.0}, "s",
            "a longer step between IMU samples is reported as a gap");
}

EventOrderer::EventOrderer(const Config& config, Log& log) : config_(config), log_(&log) {}

std::optional<TimeNs> EventOrderer::reference(Stream stream) const {
  std::optional<TimeNs> newest;
  for (const Stream other : {kLidar, kImu}) {
    if (other == stream || !clocks_[other].seen) continue;
    // One that had fallen silent before cannot tell.
    const Clock& clock = clocks_[other];
    if (clock.newest_time + clock.lag + 2 * ns(config_.clock_jump_s) < clocks_[stream].newest)
      continue;
    newest = std::max(newest.value_or(clock.newest + clock.lag), clock.newest + clock.lag);
  }
  return newest;
}

bool EventOrderer::suspicious(Stream stream, TimeNs raw) const {
  const Clock& clock = clocks_[stream];
  const TimeNs jump = ns(config_.clock_jump_s);
  if (!clock.seen) return false;
  const std::optional<TimeNs> other = reference(stream);
  const TimeNs stamp = raw + clock.offset;
  if (std::abs(stamp - clock.newest) <= jump) return false;
  // After an outage of its own a stream comes back where the others are.
  return !(other && stamp > clock.newest && std::abs(stamp - *other) <= jump);
}

void EventOrderer::push(Event event) {
  UNDERSTORY_CHECK(!finished_);
  const auto stream = static_cast<Stream>(event.index());
  StreamReport& report = report_.streams[stream];
  ++report.received;
  if (stream == kLidar) {
    take(std::move(event), stream);
    note_scan();
    return;
  }
  if (stream == kImu) report.unused = uncovered_;
  weigh(stream, stamp_of(event));
  if (clocks_[stream].arrival.verdict() != StreamOffset::Verdict::kOpen) {
    let_go(stream);
    take(std::move(event), stream);
    return;
  }
  held_[stream].push_back(std::move(event));
  if (held_[stream].size() <= kMostHeld) return;
  if (clocks_[kLidar].seen) {  // its stamps tell nothing steady
    clocks_[stream].arrival.give_up();
    let_go(stream);
  } else {  // before the first scan nobody has use for more
    held_[stream].pop_front();
  }
}

// One event on its own clock, constant offsets mended.
void EventOrderer::take(Event event, Stream stream) {
  const TimeNs raw = stamp_of(event);
  if (!suspects_.empty()) {
    if (stream == suspect_stream_) {
      if (suspicious(stream, raw)) {
        suspects_.push_back(std::move(event));
        const bool many =
            suspects_.size() >= (stream == kLidar ? kMostSuspectScans : kMostSuspects);
        const TimeNs lasting = std::abs(raw - stamp_of(suspects_.front()));
        if (many || lasting >= ns(config_.clock_jump_s)) settle(std::nullopt);
        return;
      }
      drop_suspects();
    } else if (stream == kLidar || stream == kImu) {
      settle(raw + clocks_[stream].offset + clocks_[stream].lag);
    }
  }
  if (!suspicious(stream, raw)) {
    accept(std::move(event), stream);
    return;
  }
  if (!suspects_.empty()) {  // two streams at odds, and neither is the lidar or the IMU
    ++report_.streams[stream].glitches;
    return;
  }
  suspects_.push_back(std::move(event));
  suspect_stream_ = stream;
  const std::optional<TimeNs> other = reference(stream);
  if (!other || (stream != kLidar && stream != kImu)) settle(other);
}

void EventOrderer::note_glitches(Stream stream, TimeNs raw, std::size_t count) {
  StreamReport& report = report_.streams[stream];
  report.glitches += count;
  if (stream != kImu) report.unused += static_cast<TimeNs>(count) * clocks_[stream].period;
  log_->warn("time.glitch", std::string(kNames[stream]) + ": stamp " + seconds(raw) +
                                " is far from its neighbours; message dropped");
}

void EventOrderer::drop_suspects() {
  note_glitches(suspect_stream_, stamp_of(suspects_.front()), suspects_.size());
  suspects_.clear();
}

void EventOrderer::settle(std::optional<TimeNs> other) {
  const Stream stream = suspect_stream_;
  Clock& clock = clocks_[stream];
  const TimeNs raw = stamp_of(suspects_.front());
  const TimeNs stamp = raw + clock.offset;
  const bool forward = stamp > clock.newest;
  const bool together =
      clock.seen && (!other || std::abs(*other - stamp) < std::abs(*other - clock.newest));
  const bool leads = stream == kLidar || stream == kImu;  // the others move nobody
  if (together && !forward && leads) {
    // All clocks went back: all go on from where they were.
    const TimeNs step = clock.newest + clock.period - stamp;
    for (Clock& each : clocks_)
      each.offset += step;
    ++report_.streams[stream].clock_jumps;
    log_->warn("time.clock_back", "the clock of the recording went back by " +
                                      seconds(clock.newest - stamp) + "; stamps shifted");
  } else if (!together) {
    shift(stream, raw, other);
  }
  std::vector<Event> waiting;
  waiting.swap(suspects_);
  for (Event& event : waiting)
    accept(std::move(event), stream);
}

void EventOrderer::shift(Stream stream, TimeNs raw, std::optional<TimeNs> other) {
  Clock& clock = clocks_[stream];
  const TimeNs before = clock.offset;
  if (other && std::abs(raw - *other) <= ns(config_.clock_jump_s))
    clock.offset = 0;  // back on the common clock
  else
    clock.offset = (clock.seen ? clock.newest + clock.period : other.value_or(raw)) - raw;
  ++report_.streams[stream].clock_jumps;
  log_->warn("time.clock_jump", std::string(kNames[stream]) + ": its clock jumped by " +
                                    seconds(before - clock.offset) +
                                    " against the other sensors; stamps shifted");
}

void EventOrderer::note_step(Stream stream, TimeNs stamp) {
  Clock& clock = clocks_[stream];
  StreamReport& report = report_.streams[stream];
  const TimeNs step = stamp - clock.newest;
  if (step <= 0) {
    ++report.reordered;
    log_->warn("time.reordered", std::string(kNames[stream]) + ": message at " + seconds(stamp) +
                                     " came after a later one; put in order");
    return;
  }
  const TimeNs limit =
      stream == kImu ? ns(config_.imu_gap_s)
                     : static_cast<TimeNs>(config_.gap_scans * static_cast<double>(clock.period));
  if ((stream == kLidar || stream == kImu) && clock.period > 0 && step > limit) {
    ++report.gaps;
    if (stream == kLidar) report.unused += step - clock.period;
    if (step > report.longest_gap) {
      report.longest_gap = step;
      report.after_longest_gap = stamp;
    }
    log_->warn(std::string("time.gap_") + kNames[stream], std::string(kNames[stream]) +
                                                              ": nothing for " + seconds(step) +
                                                              " before " + seconds(stamp));
  } else if (step <= kStartFactor * ns(config_.clock_jump_s)) {
    const bool restart = clock.period == 0 || step < clock.period / 2;
    clock.period = restart ? step : clock.period + (step - clock.period) / 16;
  }
}

// A message has the stamp of one before with this content.
void EventOrderer::note_same_stamp(const Pending& pending, std::uint64_t content_before) {
  StreamReport& report = report_.streams[pending.stream];
  const std::string message =
      std::string(kNames[pending.stream]) + ": second message at " + seconds(pending.stamp);
  if (content_of(pending.event) == content_before) {
    ++report.duplicates;
    log_->warn("time.duplicate", message + " with the same content dropped");
    return;
  }
  ++report.stamp_taken;
  log_->warn("time.stamp_taken", message + " with other content dropped: its clock stands still");
}

bool EventOrderer::drop(const Pending& pending) {
  StreamReport& report = report_.streams[pending.stream];
  const Clock& clock = clocks_[pending.stream];
  if (clock.any_released && pending.stamp == clock.released) {
    note_same_stamp(pending, clock.content);
    return true;
  }
  const auto same = std::find_if(pending_.begin(), pending_.end(), [&](const Pending& other) {
    return other.stream == pending.stream && other.stamp == pending.stamp;
  });
  if (same != pending_.end()) {
    note_same_stamp(pending, content_of(same->event));
    return true;
  }
  const bool late = clock.any_released && pending.stamp < clock.released;
  if (late) {
    ++report.late;
    if (pending.stream != kImu) report.unused += clock.period;
    log_->warn("time.late", std::string(kNames[pending.stream]) + ": message at " +
                                seconds(pending.stamp) + " came too late to be used");
  }
  return late;
}

void EventOrderer::accept(Event event, Stream stream) {
  Clock& clock = clocks_[stream];
  move_stamp(event, clock.offset);
  Pending pending;
  pending.time = event_time(event);
  pending.stamp = stamp_of(event);
  pending.rank = stream == kLidar ? 1 : 0;
  pending.order = pushes_++;
  pending.stream = stream;
  pending.event = std::move(event);
  if (drop(pending)) return;
  if (clock.seen) note_step(stream, pending.stamp);
  clock.newest = clock.seen ? std::max(clock.newest, pending.stamp) : pending.stamp;
  clock.newest_time = clock.seen ? std::max(clock.newest_time, pending.time) : pending.time;
  clock.seen = true;
  report_.streams[stream].newest = clock.newest_time;
  if (stream == kLidar || stream == kImu) {
    newest_ = any_seen_ ? std::max(newest_, pending.time) : pending.time;
    any_seen_ = true;
  }
  const auto key = [](const Pending& p) { return std::tuple(p.time, p.rank, p.order); };
  auto at = pending_.end();
  while (at != pending_.begin() && key(*std::prev(at)) > key(pending))
    --at;
  pending_.insert(at, std::move(pending));
}

bool EventOrderer::safe(const Pending& pending) const {
  return finished_ || (any_seen_ && newest_ - pending.time >= ns(config_.window_s));
}

// Whether a scan may leave as far as the IMU is concerned.
bool EventOrderer::covered(const Pending& scan) {
  const Clock& imu = clocks_[kImu];
  if (imu.any_released && imu.released >= scan.time) return true;
  // The first scan has waited for an IMU that there is none of so far: the others need not.
  if (!imu.seen && clocks_[kLidar].any_released) return true;
  const bool silent = imu.scans_since >= kSilentScans;
  if (finished_ || silent ||
      newest_ - scan.time > ns(config_.imu_silence_s) + std::max<TimeNs>(imu.lag, 0)) {
    if (imu.seen) ++report_.scans_without_imu;
    return true;
  }
  return false;
}

std::optional<std::size_t> EventOrderer::next_to_leave() {
  if (pending_.empty() || !safe(pending_.front())) return std::nullopt;
  if (pending_.front().stream != kLidar) return 0;
  if (held()) return std::nullopt;
  // The sensors go on until the IMU covers the scan.
  const Clock& imu = clocks_[kImu];
  const bool behind = !(imu.any_released && imu.released >= pending_.front().time);
  for (std::size_t i = 1; behind && i < pending_.size(); ++i) {
    if (pending_[i].stream == kLidar) continue;
    if (pending_[i].time - pending_.front().time > ns(config_.imu_silence_s)) break;
    const auto is_imu = [](const Pending& pending) { return pending.stream == kImu; };
    const auto from = pending_.begin() + static_cast<std::ptrdiff_t>(i);
    if (std::none_of(from, pending_.end(), is_imu)) break;
    return safe(pending_[i]) ? std::optional<std::size_t>(i) : std::nullopt;
  }
  return covered(pending_.front()) ? std::optional<std::size_t>(0) : std::nullopt;
}

// A scan leaves: for its time since the one before the IMU was not used unless it covers its end.
void EventOrderer::note_uncovered(const Pending& scan) {
  const Clock& imu = clocks_[kImu];
  if (imu.any_released && imu.released >= scan.time && imu.unbroken_since <= scan.time) return;
  const Clock& lidar = clocks_[kLidar];
  uncovered_ += std::min(scan.stamp - lidar.released, 2 * lidar.period);
  StreamReport& report = report_.streams[kImu];
  if (report.received > 0) report.unused = uncovered_;
}

std::optional<Event> EventOrderer::pop() {
  const std::optional<std::size_t> next = next_to_leave();
  if (!next) return std::nullopt;
  const auto at = pending_.begin() + static_cast<std::ptrdiff_t>(*next);
  Clock& clock = clocks_[at->stream];
  if (at->stream == kLidar && clock.any_released) note_uncovered(*at);
  if (!clock.any_released || at->stamp - clock.released > ns(config_.imu_gap_s))
    clock.unbroken_since = at->stamp;
  clock.released = at->stamp;
  clock.any_released = true;
  clock.content = content_of(at->event);
  ++report_.streams[at->stream].released;
  Event event = std::move(at->event);
  pending_.erase(at);
  return event;
}

void EventOrderer::finish() {
  for (const Stream stream : {kImu, kGnss, kMag}) {
    clocks_[stream].arrival.give_up();
    let_go(stream);
  }
  if (!suspects_.empty()) settle(std::nullopt);
  finished_ = true;
}

void EventOrderer::save(BinaryWriter& writer) const {
  writer.put(report_);
  for (const Clock& clock : clocks_)
    writer.put(clock);
  writer.put(static_cast<std::uint64_t>(pending_.size()));
  for (const Pending& pending : pending_) {
    writer.put(pending.order);
    writer.put(pending.stream);
    put_event(writer, pending.event);
  }
  writer.put(static_cast<std::uint64_t>(suspects_.size()));
  for (const Event& event : suspects_)
    put_event(writer, event);
  for (const std::deque<Event>& held : held_) {
    writer.put(static_cast<std::uint64_t>(held.size()));
    for (const Event& event : held)
      put_event(writer, event);
  }
  writer.put(suspect_stream_);
  writer.put(newest_);
  writer.put(any_seen_);
  writer.put(uncovered_);
  writer.put(finished_);
  writer.put(pushes_);
}

void EventOrderer::load(BinaryReader& reader) {
  report_ = reader.get<Report>();
  for (Clock& clock : clocks_)
    clock = reader.get<Clock>();
  pending_.clear();
  for (auto n = reader.get<std::uint64_t>(); n > 0; --n) {
    Pending pending;
    pending.order = reader.get<std::uint64_t>();
    pending.stream = reader.get_enum(kMag);
    pending.event = get_event(reader);
    pending.rank = pending.stream == kLidar ? 1 : 0;
    pending.time = event_time(pending.event);
    pending.stamp = stamp_of(pending.event);
    pending_.push_back(std::move(pending));
  }
  suspects_.clear();
  for (auto n = reader.get<std::uint64_t>(); n > 0; --n)
    suspects_.push_back(get_event(reader));
  for (std::deque<Event>& held : held_) {
    held.clear();
    for (auto n = reader.get<std::uint64_t>(); n > 0; --n)
      held.push_back(get_event(reader));
  }
  suspect_stream_ = reader.get_enum(kMag);
  newest_ = reader.get<TimeNs>();
  any_seen_ = reader.get<bool>();
  uncovered_ = reader.get<TimeNs>();
  finished_ = reader.get<bool>();
  pushes_ = reader.get<std::uint64_t>();
}

}  // namespace understory
