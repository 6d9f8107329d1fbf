#include "understory/recording/captures/pcap_recording.h"

#include <algorithm>
#include <array>
#include <deque>
#include <map>
#include <optional>

#include "understory/recording/bags/byte_source.h"
#include "understory/recording/captures/ouster.h"
#include "understory/recording/captures/pcap_file.h"
#include "understory/recording/captures/pcap_sensors.h"
#include "understory/recording/captures/pcap_stream.h"
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
      if (!datagram || !stream_of(*datagram).same_sensor(lidar_)) continue;
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
    if (from_lidar(datagram) && begins_as_velodyne(datagram.payload)) {
      decoder_.add_packet(datagram.payload.data(), datagram.payload.size(), datagram.stamp);
      take_scans();
    } else if (stream_of(datagram).same_sensor(lidar_) && is_velodyne_position(datagram.payload)) {
      const auto fix =
          decoder_.add_position_packet(datagram.payload.data(), datagram.payload.size());
      if (!fix) return;
      second_statistics_.report().name = stream_of(datagram).name();
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
      if (!key.same_sensor(lidar_) || count == stream.by_size.end()) continue;
      if (!imu_ || key.port == static_cast<std::uint32_t>(metadata_.imu_port)) imu_ = key;
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
    } else if (imu_ && stream_of(datagram) == *imu_) {
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
    const bool imu = !imu_ && metadata_.legacy_imu && stream_of(datagram).same_sensor(lidar_) &&
                     datagram.payload.size() == kOusterImuPacketSize;
    return imu ? "the IMU" : PcapRecording::unused_sensor(datagram);
  }

  OusterMetadata metadata_;
  std::optional<UdpStream> imu_;
};

// Hesai's angle corrections are .csv files, the metadata of an Ouster .json.
bool names_calibration(const OpenOptions& options) {
  return options.metadata_file.ends_with(".csv") || options.metadata_file.ends_with(".CSV");
}

// The stream with most packets that `count` counts, or the one that the option names.
template <typename Count>
std::optional<UdpStream> choose(const PcapSurvey& survey, const OpenOptions& options,
                                const std::string& file, Log& log, Count&& count) {
  std::optional<UdpStream> best;
  std::uint64_t most = 0;
  int named_lidars = 0;
  int lidars = 0;
  for (const auto& [key, stream] : survey.streams) {
    const std::uint64_t packets = count(stream);
    const bool named = options.lidar_topic.empty() || key.is_named(options.lidar_topic);
    lidars += packets > 0 ? 1 : 0;
    named_lidars += named && packets > 0 ? 1 : 0;
    if (named && packets > most) {
      most = packets;
      best = key;
    }
  }
  if (!best) return best;
  const std::string name = survey.name_of(*best);
  if (named_lidars > 1) {
    log.warn("recording.lidars",
             file + ": packets of " + std::to_string(lidars) + " lidars; only those of " + name +
                 " are used" + (name == best->name() ? "" : ": several send to that port") +
                 " (choose with --lidar-topic, or merge them: --lidar-topic A,B)");
  }
  if (survey.streams.at(*best).makers() > 1) {
    log.warn("recording.lidars", file + ": " + name +
                                     ": packets of lidars of several makers from one address; only "
                                     "those of the maker with most packets are used");
  }
  return best;
}

// Packets of lidars that need no metadata. With a calibration file (.csv) it is a Hesai.
std::uint64_t packets_of_lidar(const PcapSurvey::Stream& stream, const OpenOptions& options) {
  if (options.metadata_file.empty()) return stream.velodyne + stream.hesai + stream.livox;
  return names_calibration(options) ? stream.hesai : 0;
}

std::unique_ptr<PcapRecording> open_lidar(std::unique_ptr<PcapFile> file, PcapSurvey survey,
                                          const UdpStream& lidar, const OpenOptions& options,
                                          Log& log) {
  const PcapSurvey::Stream& stream = survey.streams[lidar];
  if (stream.hesai > stream.velodyne && stream.hesai > stream.livox)
    return open_hesai_pcap(std::move(file), std::move(survey), lidar, options.metadata_file, log);
  if (stream.livox > stream.velodyne)
    return open_livox_pcap(std::move(file), std::move(survey), lidar, log);
  return std::make_unique<VelodynePcap>(std::move(file), std::move(survey), lidar, log);
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
    if (names_calibration(options)) return found;
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
  wanted.velodyne = wanted.livox = options.metadata_file.empty();
  wanted.hesai = wanted.velodyne || names_calibration(options);
  if (beside.metadata) wanted.ouster_packet_size = beside.metadata->lidar_packet_size();
  wanted.stream = options.lidar_topic;
  PcapSurvey survey = survey_pcap(*file, wanted);
  file->rewind(log);
  const auto count = [&](const PcapSurvey::Stream& stream) {
    return packets_of_lidar(stream, options);
  };
  if (const auto lidar = choose(survey, options, name, log, count))
    return open_lidar(std::move(file), std::move(survey), *lidar, options, log);
  const std::string unread = survey.unread();
  if (!unread.empty() && !beside.metadata)
    throw InputError(name, "",
                     "packets of " + unread +
                         " are not read: replay the capture through the sensor's ROS driver and "
                         "record its PointCloud2");
  if (beside.trouble) throw InputError(*beside.trouble);
  if (!beside.metadata) {
    throw InputError(
        name, "",
        "expected packets of a Velodyne, Hesai, Livox or Ouster; found " + survey.list() +
            ". An Ouster needs its metadata (--metadata FILE, or a .json beside the capture whose "
            "name begins that of the capture)");
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
  if (!options.extrinsics_file.empty())
    recording->apply_extrinsics(options.extrinsics_file, options.lidar_entry);
  return recording;
}

}  // namespace understory
