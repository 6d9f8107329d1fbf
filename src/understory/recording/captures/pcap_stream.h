#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "understory/recording/captures/pcap_file.h"
#include "understory/recording/captures/pcap_survey.h"
#include "understory/recording/captures/udp.h"
#include "understory/recording/extrinsics.h"
#include "understory/recording/finding.h"
#include "understory/recording/messages/arrival_times.h"
#include "understory/recording/messages/event_bytes.h"
#include "understory/recording/messages/topic_statistics.h"
#include "understory/recording/recording.h"

namespace understory {

// Streams that are reported as ignored, at most.
inline constexpr std::size_t kMostIgnoredStreams = 256;

// What the captures of all sensors share: the walk through the file and the reports. Not
// thread-safe.
class PcapRecording : public Recording, public ArrivalTimes {
 public:
  PcapRecording(std::unique_ptr<PcapFile> file, PcapSurvey survey, UdpStream lidar, Log& log)
      : log_(log), file_(std::move(file)), survey_(std::move(survey)), lidar_(lidar) {
    lidar_statistics_.report().name = survey_.name_of(lidar);
    lidar_statistics_.report().role = "lidar";
  }

  void apply_extrinsics(const std::string& path, int lidar_entry) {
    apply_extrinsics_file(path, {}, rig_, log_, lidar_entry);
  }

  std::optional<Event> next() override {
    while (ready_.empty()) {
      CapturedFrame frame;
      if (!file_->next(frame)) {
        if (finished_) return std::nullopt;
        finished_ = true;
        finish();
        continue;
      }
      arrival_ = frame.stamp;
      if (frame.truncated) {
        log_.warn("recording.snapped", place(frame) + ": the capture cut a frame short");
      }
      const auto datagram = udp_.add(frame.link_type, frame.bytes, frame.stamp);
      if (!datagram) continue;
      if (survey_.trust_checksums() && datagram->has_checksum && !datagram->checksum_ok) {
        report_finding(log_, Finding::kDamagedPacket,
                       place(frame) + ": a packet with a wrong checksum, left out");
        continue;
      }
      take(*datagram);
    }
    Event event = std::move(ready_.front());
    ready_.pop_front();
    return event;
  }

  bool save(BinaryWriter& writer) const override {
    file_->save(writer);
    udp_.save(writer);
    save_decoder(writer);
    lidar_statistics_.save(writer);
    second_statistics_.save(writer);
    writer.put(static_cast<std::uint64_t>(ignored_.size()));
    for (const auto& [stream, statistics] : ignored_) {
      writer.put(stream);
      statistics.save(writer);
    }
    put_events(writer, ready_);
    writer.put(finished_);
    return true;
  }
  void load(BinaryReader& reader) override {
    file_->load(reader);
    udp_.load(reader);
    load_decoder(reader);
    lidar_statistics_.load(reader);
    second_statistics_.load(reader);
    ignored_.clear();
    for (auto left = reader.get<std::uint64_t>(); left > 0; --left)
      ignored_[reader.get<UdpStream>()].load(reader);
    get_events(reader, ready_);
    finished_ = reader.get<bool>();
  }

  const Rig& rig() const override { return rig_; }
  std::string format() const override {
    return std::string(file_->is_pcapng() ? "PCAPNG" : "PCAP") + " (" + sensor() + ")";
  }
  double progress() const override { return file_->progress(); }
  std::optional<TimeNs> arrival() const override { return arrival_; }
  std::vector<TopicReport> topics() const override {
    std::vector<TopicReport> reports{lidar_statistics_.report()};
    if (second_statistics_.report().messages > 0) reports.push_back(second_statistics_.report());
    for (const auto& [key, statistics] : ignored_)
      reports.push_back(statistics.report());
    return reports;
  }

 protected:
  virtual void take(const Datagram& datagram) = 0;
  virtual void finish() = 0;
  virtual void save_decoder(BinaryWriter& writer) const = 0;
  virtual void load_decoder(BinaryReader& reader) = 0;
  [[nodiscard]] virtual std::string sensor() const = 0;
  // Of which sensor a datagram is that is not used; empty if of none that could be.
  [[nodiscard]] virtual std::string unused_sensor(const Datagram& datagram) const {
    return is_velodyne_data(datagram.payload) ? "another lidar" : "";
  }

  [[nodiscard]] bool from_lidar(const Datagram& datagram) const {
    return stream_of(datagram) == lidar_;
  }
  void emit_scan(ScanPtr scan) {
    lidar_statistics_.add_stamp(scan->stamp);
    lidar_statistics_.report().points += scan->points.size();
    ready_.emplace_back(std::move(scan));
  }
  void ignore(const Datagram& datagram) {
    const UdpStream key = stream_of(datagram);
    const bool is_new = ignored_.count(key) == 0;
    if (is_new && ignored_.size() >= kMostIgnoredStreams) return;
    const std::string sensor = unused_sensor(datagram);
    if (is_new && !sensor.empty() && survey_.streams.count(key) == 0) {
      report_finding(log_, Finding::kLateSensor,
                     file_->name() + ": " + key.name() + ": packets of " + sensor +
                         " begin late in the capture; they are not used");
    }
    TopicReport& report = ignored_[key].report();
    report.name = survey_.name_of(key);
    report.type = "UDP datagrams";
    report.role = "ignored";
    ignored_[key].add_stamp(datagram.stamp);
  }

  Log& log_;
  std::unique_ptr<PcapFile> file_;
  PcapSurvey survey_;
  UdpStream lidar_;
  Rig rig_;
  TopicStatistics lidar_statistics_;
  TopicStatistics second_statistics_;  // IMU or GNSS
  std::deque<Event> ready_;

 private:
  [[nodiscard]] std::string place(const CapturedFrame& frame) const {
    return file_->name() + ": at byte " + std::to_string(frame.position);
  }

  UdpAssembler udp_;
  std::map<UdpStream, TopicStatistics> ignored_;
  std::optional<TimeNs> arrival_;  // of the frame read last
  bool finished_ = false;
};

// With the decoder of one kind of sensor.
template <typename Decoder>
class DecodedPcap : public PcapRecording {
 protected:
  template <typename Settings>
  DecodedPcap(std::unique_ptr<PcapFile> file, PcapSurvey survey, UdpStream lidar,
              const Settings& settings, Log& log)
      : PcapRecording(std::move(file), std::move(survey), lidar, log),
        decoder_(settings, file_->name(), log) {}

  void finish() override {
    decoder_.finish();
    take_scans();
  }

  void save_decoder(BinaryWriter& writer) const override { decoder_.save(writer); }
  void load_decoder(BinaryReader& reader) override { decoder_.load(reader); }

  void take_scans() {
    while (ScanPtr scan = decoder_.take_scan())
      emit_scan(std::move(scan));
  }

  Decoder decoder_;
};

}  // namespace understory
