#pragma once

#include <cmath>
#include <cstdlib>
#include <deque>
#include <optional>

#include "understory/recording/messages/baseline_headings.h"
#include "understory/recording/recording.h"
#include "understory/sensor/sensor_io.h"

namespace understory {

// Joins positions (NavSatFix) with the quality (GPSFix) and with the heading or the position of a
// second antenna that come on other topics. A position waits for them by the times of recording, at
// most `kWait`. Quality belongs to it where their stamps differ by at most `kSame`, a heading by at
// most `kSameEpoch`: drivers stamp sentences when they come. Positions of a second antenna are
// taken at its time (SecondPositions) and become its heading (BaselineHeadings). Not thread-safe.
class FixJoiner {
 public:
  static constexpr TimeNs kWait = kNsPerSecond / 5;
  static constexpr TimeNs kSame = kNsPerSecond / 1000;
  static constexpr TimeNs kSameEpoch = kNsPerSecond / 40;

  void expect_quality() { has_quality_topic_ = true; }
  void expect_heading() { has_heading_topic_ = true; }
  [[nodiscard]] bool expects_heading() const { return has_heading_topic_; }
  // Positions of a second antenna come, that far from the first one on the carrier, metres.
  // Nothing: not known yet; they tell no heading until then.
  void expect_second_position(std::optional<double> distance_m) {
    baseline_.set_length_m(distance_m);
  }

  void add_position(GnssFix fix, TimeNs now, std::deque<Event>& events) {
    flush(events);
    if (!std::isfinite(fix.latitude_deg) || !std::isfinite(fix.longitude_deg)) fix.quality = 0;
    waiting_ = fix;
    waiting_since_ = now;
    lacks_quality_ = has_quality_topic_;
    lacks_heading_ = has_heading_topic_ || baseline_.known();
    join(events);
  }
  void add_quality(const GnssFix& quality, std::deque<Event>& events) {
    quality_ = quality;
    join(events);
  }
  // Of `heading` its stamp, heading and standard deviation count.
  void add_heading(const GnssFix& heading, std::deque<Event>& events) {
    heading_ = heading;
    join(events);
  }
  void add_second_position(const GnssFix& second, std::deque<Event>& events) {
    seconds_.add(second);
    join(events);
  }
  void pass_time(TimeNs now, std::deque<Event>& events) {
    if (waiting_ && (now < waiting_since_ || now - waiting_since_ > kWait)) flush(events);
  }
  void flush(std::deque<Event>& events) {
    if (waiting_ && lacks_heading_ && baseline_.known())
      take_line_to(seconds_.near(waiting_->stamp));
    if (waiting_) events.emplace_back(*waiting_);
    waiting_.reset();
  }
  // What the positions of the second antenna told so far.
  [[nodiscard]] const BaselineHeadings& baseline() const { return baseline_; }

  void save(BinaryWriter& writer) const {
    for (const bool flag : {has_quality_topic_, has_heading_topic_, lacks_quality_, lacks_heading_})
      writer.put(flag);
    writer.put(waiting_since_);
    for (const std::optional<GnssFix>* fix : {&waiting_, &quality_, &heading_}) {
      writer.put(fix->has_value());
      if (*fix) put_fix(writer, **fix);
    }
    seconds_.save(writer);
    baseline_.save(writer);
  }
  void load(BinaryReader& reader) {
    for (bool* flag : {&has_quality_topic_, &has_heading_topic_, &lacks_quality_, &lacks_heading_})
      *flag = reader.get<bool>();
    waiting_since_ = reader.get<TimeNs>();
    for (std::optional<GnssFix>* fix : {&waiting_, &quality_, &heading_}) {
      fix->reset();
      if (reader.get<bool>()) *fix = get_fix(reader);
    }
    seconds_.load(reader);
    baseline_.load(reader);
  }

 private:
  // The position goes on as soon as nothing is lacking.
  void join(std::deque<Event>& events) {
    if (!waiting_) return;
    join_quality();
    join_heading();
    if (!lacks_quality_ && !lacks_heading_) flush(events);
  }
  void join_quality() {
    if (!quality_ || std::abs(quality_->stamp - waiting_->stamp) > kSame) return;
    if (waiting_->quality > 0) waiting_->quality = quality_->quality;
    waiting_->satellites = quality_->satellites;
    waiting_->hdop = quality_->hdop;
    waiting_->vdop = quality_->vdop;
    waiting_->track_deg = quality_->track_deg;
    waiting_->speed_m_s = quality_->speed_m_s;
    if (!waiting_->covariance.allFinite()) waiting_->covariance = quality_->covariance;
    lacks_quality_ = false;
  }
  void take_line_to(const std::optional<GnssFix>& second) {
    if (!second) return;
    lacks_heading_ = false;
    const auto line = baseline_.add(*waiting_, *second);
    if (!line) return;
    waiting_->heading_deg = line->heading_deg;
    waiting_->heading_sd_deg = line->sd_deg;
  }
  void join_heading() {
    if (lacks_heading_ && baseline_.known()) return take_line_to(seconds_.at(waiting_->stamp));
    if (!heading_ || std::abs(heading_->stamp - waiting_->stamp) > kSameEpoch) return;
    waiting_->heading_deg = heading_->heading_deg;
    waiting_->heading_sd_deg = heading_->heading_sd_deg;
    lacks_heading_ = false;
    heading_.reset();  // it is of one position
  }

  bool has_quality_topic_ = false;
  bool has_heading_topic_ = false;
  bool lacks_quality_ = false;  // of the position that waits
  bool lacks_heading_ = false;
  std::optional<GnssFix> waiting_;
  TimeNs waiting_since_ = 0;
  std::optional<GnssFix> quality_;
  std::optional<GnssFix> heading_;
  SecondPositions seconds_;
  BaselineHeadings baseline_;
};

}  // namespace understory
