#include "understory/recording/lidars/merged_lidars.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <iterator>
#include <map>
#include <optional>
#include <utility>
#include <variant>

#include "understory/recording/finding.h"
#include "understory/recording/lidars/scan_merger.h"
#include "understory/recording/lidars/steady_scans.h"
#include "understory/recording/messages/event_bytes.h"
#include "understory/recording/recording_constants.h"
#include "understory/util/error.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace recording_constants::merged_lidars;

// What is known of one lidar while it is read.
struct ReadLidar {
  LidarReader reader;
  SteadyScans steady;
  std::optional<TimeNs> first;  // stamp
  TimeNs end = 0;               // of its last scan
  bool ended = false;
  bool left_out = false;  // its place is not known
  bool told = false;      // that it died
  bool beginning_told = false;
  bool ranges_seen = false;                 // a scan told how far its points lie
  std::map<std::string, std::size_t> said;  // warnings of its own log that were passed on
};

// How far the stream of the first reader has come by the stamps of sensors that are no lidar, on
// whatever clock they are.
class StreamTime {
 public:
  void add(const Event& event) {
    Clock& clock = clocks_[event.index()];
    const TimeNs time = event_time(event);
    const TimeNs step = clock.any ? time - clock.last : 0;
    if (step > 0 && step < kJump) clock.passed += step;
    clock.any = true;
    clock.last = time;
  }
  // Since the last scan.
  [[nodiscard]] TimeNs passed() const {
    TimeNs most = 0;
    for (const Clock& clock : clocks_)
      most = std::max(most, clock.passed);
    return most;
  }
  void begin() {
    for (Clock& clock : clocks_)
      clock.passed = 0;
  }
  void save(BinaryWriter& writer) const {
    for (const Clock& clock : clocks_) {
      writer.put(clock.any);
      writer.put(clock.last);
      writer.put(clock.passed);
    }
  }
  void load(BinaryReader& reader) {
    for (Clock& clock : clocks_) {
      clock.any = reader.get<bool>();
      clock.last = reader.get<TimeNs>();
      clock.passed = reader.get<TimeNs>();
    }
  }

 private:
  struct Clock {
    bool any = false;
    TimeNs last = 0;
    TimeNs passed = 0;
  };
  std::array<Clock, std::variant_size_v<Event>> clocks_;
};

class MergedLidars : public Recording {
 public:
  MergedLidars(std::string file, std::vector<LidarReader> lidars, Log& log)
      : file_(std::move(file)), log_(log), merger_(lidars.size()) {
    for (LidarReader& lidar : lidars)
      lidars_.emplace_back().reader = std::move(lidar);
    update_rig();
    for (std::size_t i = 1; i < lidars_.size(); ++i)
      (void)find_place(i);
  }

  std::optional<Event> next() override {
    while (ready_.empty()) {
      if (finished_) return std::nullopt;
      advance();
    }
    Event event = std::move(ready_.front());
    ready_.pop_front();
    return event;
  }

  bool save(BinaryWriter& writer) const override {
    std::vector<std::string> readers;
    for (const ReadLidar& lidar : lidars_) {
      BinaryWriter own;
      if (!lidar.reader.recording->save(own)) return false;
      readers.push_back(own.bytes());
    }
    for (std::size_t i = 0; i < lidars_.size(); ++i) {
      const ReadLidar& lidar = lidars_[i];
      writer.put(readers[i]);
      lidar.steady.save(writer);
      writer.put(lidar.first.value_or(0));
      writer.put(lidar.first.has_value());
      writer.put(lidar.end);
      for (const bool flag :
           {lidar.ended, lidar.left_out, lidar.told, lidar.beginning_told, lidar.ranges_seen})
        writer.put(flag);
    }
    merger_.save(writer);
    stream_.save(writer);
    put_rig(writer, rig_);
    put_events(writer, waiting_);
    put_events(writer, ready_);
    writer.put(finished_);
    writer.put(late_told_);
    put_optional(writer, begin_);
    return true;
  }

  void load(BinaryReader& reader) override {
    for (ReadLidar& lidar : lidars_) {
      BinaryReader own(reader.get_string(), "checkpoint");
      lidar.reader.recording->load(own);
      lidar.steady.load(reader);
      const auto first = reader.get<TimeNs>();
      if (reader.get<bool>()) lidar.first = first;
      lidar.end = reader.get<TimeNs>();
      for (bool* flag :
           {&lidar.ended, &lidar.left_out, &lidar.told, &lidar.beginning_told, &lidar.ranges_seen})
        *flag = reader.get<bool>();
    }
    merger_.load(reader);
    stream_.load(reader);
    rig_ = get_rig(reader);
    get_events(reader, waiting_);
    get_events(reader, ready_);
    finished_ = reader.get<bool>();
    late_told_ = reader.get<bool>();
    begin_ = get_optional<TimeNs>(reader);
    for (std::size_t i = 0; i < rig_.further_lidars.size(); ++i)
      merger_.place(i + 1, rig_.further_lidars[i].lidar_from_further);
  }

  const Rig& rig() const override { return rig_; }
  std::vector<TopicReport> topics() const override {
    std::vector<TopicReport> reports = lidars_.front().reader.recording->topics();
    for (std::size_t i = 1; i < lidars_.size(); ++i) {
      for (const TopicReport& own : lidars_[i].reader.recording->topics()) {
        if (own.role != "lidar") continue;
        const auto same = std::find_if(reports.begin(), reports.end(),
                                       [&](const TopicReport& r) { return r.name == own.name; });
        if (same == reports.end()) {
          reports.push_back(own);
        } else {
          *same = own;
        }
      }
    }
    return reports;
  }
  std::string format() const override {
    return lidars_.front().reader.recording->format() + ", " + std::to_string(lidars_.size()) +
           " lidars merged";
  }
  double progress() const override { return lidars_.front().reader.recording->progress(); }

 private:
  void advance() {
    ScanMerger::Step step = merger_.next();
    switch (step.kind) {
      case ScanMerger::Step::Kind::kScan:
        return emit(std::move(step.scan));
      case ScanMerger::Step::Kind::kNeeds:
        return step.lidar == 0 ? read_first() : read_further(step.lidar);
      case ScanMerger::Step::Kind::kFinished:
        return finish();
    }
  }

  // The scan stands where its end does among the events of the other sensors, as far as these are
  // on its clock.
  void emit(ScanPtr scan) {
    const TimeNs end = scan->end();
    const auto last = std::find_if(waiting_.rbegin(), waiting_.rend(),
                                   [&](const Event& event) { return event_time(event) <= end; });
    const auto until = last == waiting_.rend() ? waiting_.end() : last.base();
    std::move(waiting_.begin(), until, std::back_inserter(ready_));
    waiting_.erase(waiting_.begin(), until);
    if (!begin_) begin_ = scan->stamp;
    ready_.emplace_back(std::move(scan));
    for (ReadLidar& lidar : lidars_) {
      tell_beginning(lidar);
      if (lidar.ended && lidar.first && merger_.begin() - lidar.end > kSilence) tell_death(lidar);
    }
    if (merger_.late_points() > 0 && !late_told_) {
      late_told_ = true;
      log_.warn("recording.late_points",
                file_ + ": points of a lidar came after the scan of their time: they are left out");
    }
  }

  // One event of the first reader, which paces all.
  void read_first() {
    ReadLidar& lidar = lidars_.front();
    std::optional<Event> event = lidar.reader.recording->next();
    if (!event) return end(0);
    if (auto* scan = std::get_if<ScanPtr>(&*event)) {
      stream_.begin();
      return take(0, std::move(*scan));
    }
    update_rig();
    stream_.add(*event);
    waiting_.push_back(std::move(*event));
    if (waiting_.size() > kMostWaiting) release_waiting();
    // Without scans for a second, the others go on.
    const TimeNs since = lidar.first ? lidar.end : begin_.value_or(merger_.begin());
    if (since != ScanMerger::kForever && stream_.passed() > kSilence)
      merger_.set_complete_until(0, since + stream_.passed() - kSilence);
  }

  // Reads another lidar up to its next scan.
  void read_further(std::size_t number) {
    ReadLidar& lidar = lidars_[number];
    for (;;) {
      std::optional<Event> event = lidar.reader.recording->next();
      pass_on_warnings(lidar);
      if (!event) return end(number);
      auto* scan = std::get_if<ScanPtr>(&*event);
      if (scan == nullptr) continue;
      if (!lidar.first && !place(number)) return end(number);
      return take(number, std::move(*scan));
    }
  }

  void take(std::size_t number, ScanPtr scan) {
    if (number == 0) update_rig();
    ReadLidar& lidar = lidars_[number];
    for (ScanPtr& certain : lidar.steady.add(std::move(scan))) {
      if (!lidar.first) {
        lidar.first = certain->stamp;
      } else if (certain->stamp - lidar.end > kSilence) {
        report_finding(
            log_, Finding::kSilentLidar,
            fmt::format("{}: {} gives nothing from {} to {} s ({:.1f} s): the others "
                        "go on without it",
                        file_, lidar.reader.topic, format_seconds(lidar.end),
                        format_seconds(certain->stamp), to_seconds(certain->stamp - lidar.end)));
      }
      look_at_ranges(lidar, *certain);
      lidar.end = std::max(lidar.end, certain->end());
      merger_.add(number, std::move(certain));
    }
  }

  // Points in a wrong unit are all too far to be mapped: the others go on without them.
  void look_at_ranges(ReadLidar& lidar, const Scan& scan) {
    if (lidar.ranges_seen || scan.points.size() < kFewestRanges) return;
    lidar.ranges_seen = true;
    std::vector<float> ranges;
    for (const ScanPoint& point : scan.points)
      ranges.push_back(std::hypot(point.x, point.y, point.z));
    const float median = upper_median(std::move(ranges));
    if (median < kFarthestMedianM) return;
    report_finding(
        log_, Finding::kSilentLidar,
        fmt::format("{}: half of the points of {} lie over {:.0f} m away. Are its coordinates in "
                    "millimetres or centimetres? Points are expected in metres",
                    file_, lidar.reader.topic, median));
  }

  void end(std::size_t number) {
    lidars_[number].ended = true;
    merger_.set_complete_until(number, ScanMerger::kForever);
  }

  void finish() {
    finished_ = true;
    release_waiting();
    for (ReadLidar& lidar : lidars_) {
      if (lidar.left_out) continue;
      if (!lidar.first) {
        report_finding(log_, Finding::kSilentLidar,
                       file_ + ": " + lidar.reader.topic + " gives no scan at all");
      } else if (merger_.begun() && merger_.begin() - lidar.end > kSilence) {
        tell_death(lidar);
      }
      if (lidar.steady.left_out() > 0)
        log_.warn("recording.far_stamps",
                  fmt::format("{}: {}: {} scans have a stamp far from those around them: they are "
                              "left out",
                              file_, lidar.reader.topic, lidar.steady.left_out()));
    }
  }

  void release_waiting() {
    std::move(waiting_.begin(), waiting_.end(), std::back_inserter(ready_));
    waiting_.clear();
  }

  void tell_death(ReadLidar& lidar) {
    if (lidar.told) return;
    lidar.told = true;
    report_finding(log_, Finding::kSilentLidar,
                   fmt::format("{}: {} gives nothing after {} s: the others go on without it",
                               file_, lidar.reader.topic, format_seconds(lidar.end)));
  }

  void tell_beginning(ReadLidar& lidar) {
    if (lidar.beginning_told || !lidar.first || *lidar.first >= merger_.begin()) return;
    lidar.beginning_told = true;
    const TimeNs late = *lidar.first - *begin_;
    if (late <= kSilence) return;
    log_.warn(
        "recording.late_lidar",
        fmt::format("{}: {} begins at {} s, {:.1f} s after the first lidar: it joins then", file_,
                    lidar.reader.topic, format_seconds(*lidar.first), to_seconds(late)));
  }

  // The rig of the first reader, with the others that are placed.
  void update_rig() {
    std::vector<FurtherLidar> further = std::move(rig_.further_lidars);
    rig_ = lidars_.front().reader.recording->rig();
    rig_.further_lidars = std::move(further);
    if (!rig_.further_lidars.empty()) return;
    for (std::size_t i = 1; i < lidars_.size(); ++i)
      rig_.further_lidars.push_back({Pose(), static_cast<std::uint16_t>(i * kRingsALidar)});
  }

  // Takes the place of a lidar from its reader. False where it is not known.
  bool find_place(std::size_t number) {
    const Rig& own = lidars_[number].reader.recording->rig();
    const bool by_file = own.lidar_extrinsic_source.rfind("extrinsics file", 0) == 0;
    if (own.body_frame != rig_.body_frame || (!by_file && own.body_frame == "lidar")) return false;
    const Pose first_from_lidar = rig_.body_from_lidar.inverse() * own.body_from_lidar;
    rig_.further_lidars[number - 1].lidar_from_further = first_from_lidar;
    merger_.place(number, first_from_lidar);
    return true;
  }

  // Of a lidar whose first scan has come. False where it is left out.
  bool place(std::size_t number) {
    ReadLidar& lidar = lidars_[number];
    update_rig();
    if (find_place(number)) return true;
    const std::string why = lidar.reader.topic + ": where this lidar sits on the body (" +
                            rig_.body_frame + ") is not known";
    if (!merger_.begun())
      throw InputError(file_, "",
                       why +
                           ": expected its body_from_lidar under `lidars` in the file of "
                           "--extrinsics, or a transform in /tf_static");
    lidar.left_out = true;
    report_finding(log_, Finding::kLateSensor, file_ + ": " + why + "; its scans are not used");
    return false;
  }

  // What a further reader says of its own lidar; all else the first one says too.
  void pass_on_warnings(ReadLidar& lidar) {
    if (lidar.reader.log == nullptr) return;
    for (const Log::Warning& warning : lidar.reader.log->warnings()) {
      std::size_t& said = lidar.said[warning.key];
      const bool of_lidar = warning.first_message.find(lidar.reader.topic) != std::string::npos;
      for (; of_lidar && said < warning.count; ++said)
        log_.warn(warning.key, warning.first_message);
    }
  }

  std::string file_;
  Log& log_;
  ScanMerger merger_;
  std::vector<ReadLidar> lidars_;
  StreamTime stream_;
  std::optional<TimeNs> begin_;  // of the first merged scan
  Rig rig_;
  std::deque<Event> waiting_;  // of other sensors, for the scan of their time
  std::deque<Event> ready_;
  bool finished_ = false;
  bool late_told_ = false;
};

}  // namespace

std::unique_ptr<Recording> merge_lidars(const std::string& file, std::vector<LidarReader> lidars,
                                        Log& log) {
  return std::make_unique<MergedLidars>(file, std::move(lidars), log);
}

}  // namespace understory
