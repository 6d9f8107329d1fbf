#include "understory/recording/captures/pcap_recording.h"

#include <algorithm>
#include <array>
#include <deque>
#include <map>
#include <optional>

#include "understory/recording/bags/byte_source.h"
#include "understory/recording/captures/ouster.h"
#include "understory/recording/captures/pcap_file.h"
#include "understory/recording/captures/pcap_survey.h"
#include "understory/recording/captures/udp.h"
#include "understory/recording/captures/velodyne.h"
#include "understory/recording/extrinsics.h"
#include "understory/recording/finding.h"
#include "understory/recording/messages/arrival_times.h"
#include "understory/recording/messages/event_bytes.h"
#include "understory/recording/messages/topic_statistics.h"
#include "understory/util/error.h"
#include "understory/util/files/read_error.h"

namespace understory {
namespace {

constexpr int kFramesForPosition = 20'000;
constexpr std::size_t kMostIgnored = 256;  // streams that are reported

// What both kinds of sensor share: the walk through the file and the reports.
class PcapRecording : public Recording, public ArrivalTimes {
 public:
  PcapRecording(std::unique_ptr<PcapFile> file, PcapSurvey survey, UdpStream lidar, Log& log)
      : log_(log), file_(std::move(file)), survey_(std::move(survey)), lidar_(lidar) {
    lidar_statistics_.report().name = lidar.name();
    lidar_statistics_.report().role = "lidar";
  }

  void apply_extrinsics(const std::string& path) { apply_extrinsics_file(path, {}, rig_, log_); }

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
    return datagram.source == lidar_.source && datagram.port == lidar_.port;
  }
  void emit_scan(ScanPtr scan) {
    lidar_statistics_.add_stamp(scan->stamp);
    lidar_statistics_.report().points += scan->points.size();
    ready_.emplace_back(std::move(scan));
  }
  void ignore(const Datagram& datagram) {
    const UdpStream key{datagram.source, datagram.port};
    const bool is_new = ignored_.count(key) == 0;
    if (is_new && ignored_.size() >= kMostIgnored) return;
    const std::string sensor = unused_sensor(datagram);
    if (is_new && !sensor.empty() && survey_.streams.count(key) == 0) {
      report_finding(log_, Finding::kLateSensor,
                     file_->name() + ": " + key.name() + ": packets of " + sensor +
                         " begin late in the capture; they are not used");
    }
    TopicReport& report = ignored_[key].report();
    report.name = key.name();
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

class VelodynePcap : public DecodedPcap<VelodyneDecoder> {
 public:
  VelodynePcap(std::unique_ptr<PcapFile> file, PcapSurvey survey, UdpStream lidar, Log& log)
      : DecodedPcap(std::move(file), std::move(survey), lidar, VelodyneConfig{}, log) {
    lidar_statistics_.report().type = "Velodyne packets";
    second_statistics_.report().role = "gnss";
    second_statistics_.report().type = "Velodyne position packets";
    look_ahead();
  }

  std::vector<TopicReport> topics() const override {
    std::vector<TopicReport> reports = PcapRecording::topics();
    reports.front().conventions = decoder_.conventions();
    return reports;
  }

 private:
  // The model, and the hour out of the first position packet, are wanted before the first scan.
  void look_ahead() {
    Log quiet;  // what is damaged is told when it is read
    file_->rewind(quiet);
    VelodyneDecoder first({}, file_->name(), quiet);
    try {
      look_at_start(first);
    } catch (const ReadError&) {
      // Met again when it is read.
    }
    rig_.lidar_model = first.model_name();
    file_->rewind(log_);
  }

  void look_at_start(VelodyneDecoder& first) {
    UdpAssembler udp;
    CapturedFrame frame;
    bool has_time = false;
    int behind = 0;  // the lidar's first datagram
    while (behind < kFramesForPosition && file_->next(frame)) {
      behind += behind > 0 ? 1 : 0;
      const auto datagram = udp.add(frame.link_type, frame.bytes, frame.stamp);
      if (!datagram || datagram->source != lidar_.source) continue;
      if (from_lidar(*datagram)) behind = std::max(behind, 1);
      if (from_lidar(*datagram) && first.model_name().empty())
        first.add_packet(datagram->payload.data(), datagram->payload.size(), datagram->stamp);
      if (!has_time && is_velodyne_position(datagram->payload) && !wrong(*datagram)) {
        has_time = decoder_.set_clock(datagram->payload.data(), datagram->payload.size());
      }
      if (has_time && !first.model_name().empty()) break;
    }
  }

  [[nodiscard]] bool wrong(const Datagram& datagram) const {
    return survey_.trust_checksums() && datagram.has_checksum && !datagram.checksum_ok;
  }

  void take(const Datagram& datagram) override {
    if (from_lidar(datagram) && datagram.payload.size() == VelodyneDecoder::kDataPacketSize) {
      decoder_.add_packet(datagram.payload.data(), datagram.payload.size(), datagram.stamp);
      take_scans();
    } else if (datagram.source == lidar_.source && is_velodyne_position(datagram.payload)) {
      const auto fix =
          decoder_.add_position_packet(datagram.payload.data(), datagram.payload.size());
      if (!fix) return;
      second_statistics_.report().name = UdpStream{datagram.source, datagram.port}.name();
      second_statistics_.report().conventions =
          "NMEA in position packets; UTC; no height unless GGA";
      second_statistics_.add_stamp(fix->stamp);
      ready_.emplace_back(*fix);
    } else {
      ignore(datagram);
    }
  }

  std::string sensor() const override { return "Velodyne " + rig_.lidar_model; }
};

class OusterPcap : public DecodedPcap<OusterDecoder> {
 public:
  OusterPcap(std::unique_ptr<PcapFile> file, PcapSurvey survey, UdpStream lidar,
             const OusterMetadata& metadata, Log& log)
      : DecodedPcap(std::move(file), std::move(survey), lidar, metadata, log), metadata_(metadata) {
    lidar_statistics_.report().type = "Ouster packets";
    lidar_statistics_.report().conventions = decoder_.conventions();
    second_statistics_.report().role = "imu";
    second_statistics_.report().type = "Ouster IMU packets";
    second_statistics_.report().conventions =
        "g and deg/s converted to m/s² and rad/s; the gyroscope's time stamp; with gravity";
    find_imu();
    if (imu_) {
      rig_ = metadata_.rig();
    } else {
      rig_.lidar_model = metadata_.product;
      rig_.lidar_extrinsic_source = "is the body, there being no IMU";
    }
  }

 private:
  // The stream of 48-byte packets from the same sensor; the one at the stated port if there is it.
  void find_imu() {
    for (const auto& [key, stream] : survey_.streams) {
      const auto count = stream.by_size.find(kOusterImuPacketSize);
      if (key.source != lidar_.source || count == stream.by_size.end()) continue;
      if (!imu_ || key.port == metadata_.imu_port) imu_ = key;
    }
    if (imu_) second_statistics_.report().name = imu_->name();
    if (imu_ || metadata_.legacy_imu) return;
    log_.warn("imu.unsupported", file_->name() +
                                     ": the sensor's IMU packets are of a profile that is not "
                                     "read; only the lidar is used");
  }

  void take(const Datagram& datagram) override {
    const std::uint8_t* data = datagram.payload.data();
    const std::size_t size = datagram.payload.size();
    if (from_lidar(datagram) &&
        (size != kOusterImuPacketSize || !imu_ || imu_->port != lidar_.port)) {
      decoder_.add_lidar_packet(data, size);
      take_scans();
    } else if (imu_ && datagram.source == imu_->source && datagram.port == imu_->port) {
      const auto sample = decoder_.add_imu_packet(data, size);
      if (!sample) return;
      second_statistics_.add_stamp(sample->stamp);
      ready_.emplace_back(*sample);
    } else {
      ignore(datagram);
    }
  }

  std::string sensor() const override { return "Ouster " + metadata_.product; }
  [[nodiscard]] std::string unused_sensor(const Datagram& datagram) const override {
    if (datagram.payload.size() == metadata_.lidar_packet_size()) return "another lidar";
    const bool imu = !imu_ && metadata_.legacy_imu && datagram.source == lidar_.source &&
                     datagram.payload.size() == kOusterImuPacketSize;
    return imu ? "the IMU" : PcapRecording::unused_sensor(datagram);
  }

  OusterMetadata metadata_;
  std::optional<UdpStream> imu_;
};

// The stream with most packets that `count` counts, or the one that the option names.
template <typename Count>
std::optional<UdpStream> choose(const PcapSurvey& survey, const OpenOptions& options,
                                const std::string& file, Log& log, Count&& count) {
  std::optional<UdpStream> best;
  std::uint64_t most = 0;
  int streams = 0;
  for (const auto& [key, stream] : survey.streams) {
    const std::uint64_t packets = count(stream);
    const bool named = options.lidar_topic.empty() || options.lidar_topic == key.name();
    streams += packets > 0 ? 1 : 0;
    if (named && packets > most) {
      most = packets;
      best = key;
    }
  }
  if (best && streams > 1 && options.lidar_topic.empty()) {
    log.warn("recording.lidars", file + ": packets of " + std::to_string(streams) +
                                     " lidars; only those of " + best->name() +
                                     " are used (choose with --lidar-topic)");
  }
  return best;
}

std::uint64_t velodyne_packets(const PcapSurvey::Stream& stream) {
  return stream.velodyne;
}

// The Ouster's metadata that go with a capture.
struct FoundMetadata {
  std::string file;
  std::optional<OusterMetadata> metadata;
  std::optional<InputError> trouble;  // with what lies beside: a Velodyne's capture needs none
};

FoundMetadata metadata_of(const std::string& capture, const OpenOptions& options) {
  FoundMetadata found;
  try {
    found.file =
        options.metadata_file.empty() ? find_ouster_metadata(capture) : options.metadata_file;
    if (!found.file.empty()) found.metadata = read_ouster_metadata(found.file);
  } catch (const InputError& error) {
    if (!options.metadata_file.empty()) throw;
    found.trouble = error;
  }
  return found;
}

std::unique_ptr<PcapRecording> open(std::unique_ptr<ByteSource> source, const OpenOptions& options,
                                    Log& log) {
  Log quiet;
  auto file = std::make_unique<PcapFile>(std::move(source), quiet);
  const std::string name = file->name();
  const FoundMetadata beside = metadata_of(name, options);
  PcapWanted wanted;
  wanted.velodyne = options.metadata_file.empty();
  if (beside.metadata) wanted.ouster_packet_size = beside.metadata->lidar_packet_size();
  wanted.stream = options.lidar_topic;
  PcapSurvey survey = survey_pcap(*file, wanted);
  file->rewind(log);
  if (options.metadata_file.empty()) {
    if (const auto lidar = choose(survey, options, name, log, velodyne_packets))
      return std::make_unique<VelodynePcap>(std::move(file), std::move(survey), *lidar, log);
  }
  if (beside.trouble) throw InputError(*beside.trouble);
  if (!beside.metadata) {
    throw InputError(name, "",
                     "expected Velodyne packets, or Ouster packets with their metadata (--metadata "
                     "FILE, or a .json beside it whose name its name begins with); found " +
                         survey.list());
  }
  const auto lidar = choose(survey, options, name, log,
                            [](const PcapSurvey::Stream& stream) { return stream.ouster; });
  if (!lidar) {
    throw InputError(name, "",
                     "expected Ouster packets of " + std::to_string(wanted.ouster_packet_size) +
                         " bytes as " + beside.file + " has them; found " + survey.list());
  }
  return std::make_unique<OusterPcap>(std::move(file), std::move(survey), *lidar, *beside.metadata,
                                      log);
}

}  // namespace

bool is_pcap(const std::string& path) {
  try {
    const auto source = open_file(path);
    std::array<std::uint8_t, 4> start{};
    return source->read(0, start.data(), start.size()) == start.size() &&
           PcapFile::recognise(start);
  } catch (const ReadError&) {
    throw;
  } catch (const InputError&) {
    return false;
  }
}

std::unique_ptr<Recording> open_pcap(const std::string& path, const OpenOptions& options,
                                     Log& log) {
  return open_pcap(open_file(path), options, log);
}

std::unique_ptr<Recording> open_pcap(std::unique_ptr<ByteSource> source, const OpenOptions& options,
                                     Log& log) {
  auto recording = open(std::move(source), options, log);
  if (!options.extrinsics_file.empty()) recording->apply_extrinsics(options.extrinsics_file);
  return recording;
}

}  // namespace understory
