#pragma once

#include <cmath>
#include <cstdlib>
#include <deque>
#include <optional>

#include "understory/recording/recording.h"
#include "understory/sensor/sensor_io.h"

namespace understory {

// Joins positions (NavSatFix) with the quality that comes on another topic (GPSFix). A position
// waits for it by the times of recording, at most `kWait`; they belong together where their stamps
// differ by at most `kSame`. Not thread-safe.
class FixJoiner {
 public:
  static constexpr TimeNs kWait = kNsPerSecond / 5;
  static constexpr TimeNs kSame = kNsPerSecond / 1000;

  void expect_quality() { has_quality_topic_ = true; }

  void add_position(GnssFix fix, TimeNs now, std::deque<Event>& events) {
    flush(events);
    if (!std::isfinite(fix.latitude_deg) || !std::isfinite(fix.longitude_deg)) fix.quality = 0;
    waiting_ = fix;
    waiting_since_ = now;
    if (!has_quality_topic_ || join()) flush(events);
  }
  void add_quality(const GnssFix& quality, std::deque<Event>& events) {
    quality_ = quality;
    if (waiting_ && join()) flush(events);
  }
  void pass_time(TimeNs now, std::deque<Event>& events) {
    if (waiting_ && (now < waiting_since_ || now - waiting_since_ > kWait)) flush(events);
  }
  void flush(std::deque<Event>& events) {
    if (waiting_) events.emplace_back(*waiting_);
    waiting_.reset();
  }

  void save(BinaryWriter& writer) const {
    writer.put(has_quality_topic_);
    writer.put(waiting_since_);
    for (const std::optional<GnssFix>* fix : {&waiting_, &quality_}) {
      writer.put(fix->has_value());
      if (*fix) put_fix(writer, **fix);
    }
  }
  void load(BinaryReader& reader) {
    has_quality_topic_ = reader.get<bool>();
    waiting_since_ = reader.get<TimeNs>();
    for (std::optional<GnssFix>* fix : {&waiting_, &quality_}) {
      fix->reset();
      if (reader.get<bool>()) *fix = get_fix(reader);
    }
  }

 private:
  bool join() {
    if (!quality_ || std::abs(quality_->stamp - waiting_->stamp) > kSame) return false;
    if (waiting_->quality > 0) waiting_->quality = quality_->quality;
    waiting_->satellites = quality_->satellites;
    waiting_->hdop = quality_->hdop;
    waiting_->vdop = quality_->vdop;
    waiting_->track_deg = quality_->track_deg;
    waiting_->speed_m_s = quality_->speed_m_s;
    if (!waiting_->covariance.allFinite()) waiting_->covariance = quality_->covariance;
    return true;
  }

  bool has_quality_topic_ = false;
  std::optional<GnssFix> waiting_;
  TimeNs waiting_since_ = 0;
  std::optional<GnssFix> quality_;
};

}  // namespace understory
