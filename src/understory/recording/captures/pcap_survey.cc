#include "understory/recording/captures/pcap_survey.h"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <vector>

#include "understory/recording/captures/hesai/hesai_tables.h"
#include "understory/recording/captures/livox_packets.h"
#include "understory/recording/captures/velodyne.h"
#include "understory/util/files/read_error.h"

namespace understory {
namespace {

constexpr std::size_t kFrames = 20'000;
constexpr std::size_t kMostStreams = 256;
constexpr std::size_t kMostSizes = 16;

constexpr std::uint16_t kMid360Port = 56300;  // from which it sends its points

// A lidar whose packets are known and not read; empty for other datagrams.
std::string unread_lidar(ByteSpan payload) {
  constexpr std::uint8_t kVls128 = 0xA1;
  if (is_velodyne_data(payload)) {
    const std::uint8_t product = payload[VelodyneDecoder::kDataPacketSize - 1];
    if (product == kVls128) return "a Velodyne VLS-128";
    if (velodyne_model(product) == VelodyneModel::kUnknown)
      return "a Velodyne of unknown product " + std::to_string(product);
  }
  const std::uint8_t msop[] = {0x55, 0xAA, 0x05};
  const bool robosense = payload.size() == 1248 && std::memcmp(payload.data(), msop, 3) == 0;
  return robosense ? "a RoboSense" : "";
}

// Of a Livox by its port alone: points whose layout is not known.
std::string unread_livox(const Datagram& datagram) {
  constexpr std::uint16_t kHapPort = 57000;
  constexpr std::uint16_t kAviaPort = 65000;
  constexpr std::size_t kLeastPoints = 500;  // bytes; answers to commands are smaller
  const std::uint16_t port = datagram.source_port;
  if (port != kMid360Port && port != kHapPort && port != kAviaPort) return "";
  if (datagram.payload.size() < kLeastPoints) return "";
  return "a Livox of unknown version " + std::to_string(datagram.payload[0]);
}

// What a datagram is of, by its bytes.
struct LidarKind {
  LidarKind(const Datagram& datagram, const PcapWanted& wanted) {
    const ByteSpan payload = datagram.payload;
    unread = unread_lidar(payload);
    velodyne = is_velodyne_data(payload) && unread.empty();
    ouster = wanted.ouster_packet_size > 0 && payload.size() == wanted.ouster_packet_size;
    if (velodyne || ouster || !unread.empty()) return;
    if (is_hesai_data(payload)) {
      const HesaiKind kind = hesai_kind(payload);
      hesai = kind.model != HesaiModel::kUnknown;
      model = hesai_table(kind.model).name;
      unread = kind.other.empty() ? "" : "Hesai: " + kind.other;
    } else if (const auto head = livox_head(payload)) {
      (head->imu ? livox_imu : livox) = true;
      if (head->protocol == 2 && datagram.source_port == kMid360Port) model = "Mid-360";
    } else {
      unread = unread_livox(datagram);
    }
  }
  [[nodiscard]] bool is_lidar() const { return velodyne || ouster || hesai || livox; }
  [[nodiscard]] bool is_wanted(const PcapWanted& wanted) const {
    return (velodyne && wanted.velodyne) || (hesai && wanted.hesai) || (livox && wanted.livox) ||
           ouster;
  }
  void count_in(PcapSurvey::Stream& stream) const {
    stream.velodyne += velodyne ? 1 : 0;
    stream.ouster += ouster ? 1 : 0;
    stream.hesai += hesai ? 1 : 0;
    stream.livox += livox ? 1 : 0;
    stream.livox_imu += livox_imu ? 1 : 0;
    if (stream.model.empty()) stream.model = model;
    if (stream.unread.empty()) stream.unread = unread;
  }

  bool velodyne = false;
  bool ouster = false;
  bool hesai = false;
  bool livox = false;
  bool livox_imu = false;
  std::string model;
  std::string unread;
};

// The place where this datagram is counted; null where there are too many streams already.
PcapSurvey::Stream* place_of(PcapSurvey& survey, const UdpStream& key, bool is_lidar) {
  const auto found = survey.streams.find(key);
  if (found != survey.streams.end()) return &found->second;
  if (survey.streams.size() >= kMostStreams) {
    if (!is_lidar) return nullptr;
    const auto rank = [](const auto& each) {
      return std::pair(each.second.has_lidar(), each.second.datagrams);
    };
    const auto least =
        std::min_element(survey.streams.begin(), survey.streams.end(),
                         [&](const auto& a, const auto& b) { return rank(a) < rank(b); });
    if (least->second.has_lidar()) return nullptr;
    survey.streams.erase(least);
  }
  return &survey.streams[key];
}

}  // namespace

bool begins_as_velodyne(ByteSpan payload) {
  return payload.size() >= 2 && payload[0] == 0xFF && payload[1] == 0xEE;
}

bool is_velodyne_data(ByteSpan payload) {
  return payload.size() == VelodyneDecoder::kDataPacketSize && begins_as_velodyne(payload);
}

bool is_velodyne_position(ByteSpan payload) {
  constexpr std::size_t kSentence = 206;
  return payload.size() == VelodyneDecoder::kPositionPacketSize && payload[kSentence] == '$';
}

std::string PcapSurvey::list() const {
  constexpr std::size_t kMostListed = 20;
  std::string text;
  std::size_t listed = 0;
  for (const auto& [key, stream] : streams) {
    for (const auto& [size, count] : stream.by_size) {
      if (++listed > kMostListed) continue;
      text += (text.empty() ? "" : ", ") + key.name() + ": " + std::to_string(count) + " x " +
              std::to_string(size) + " bytes";
    }
  }
  if (listed > kMostListed) text += " and " + std::to_string(listed - kMostListed) + " other kinds";
  return std::to_string(frames) + (whole ? " frames" : " first frames") + ": " +
         (text.empty() ? "no UDP packets" : text);
}

std::string UdpStream::device_name() const {
  constexpr const char* kDigits = "0123456789abcdef";
  std::string text;
  for (int shift = 40; shift >= 0; shift -= 8) {
    text += text.empty() ? "" : ":";
    text += {kDigits[device >> (shift + 4) & 15], kDigits[device >> shift & 15]};
  }
  return full_name() + " (" + text + ")";
}

std::string PcapSurvey::name_of(const UdpStream& key) const {
  bool port = false;
  bool address = false;
  for (const auto& [other, stream] : streams) {
    if (other == key || other.port != key.port || !stream.has_lidar()) continue;
    port = true;
    address = address || other.source == key.source;
  }
  return address ? key.device_name() : port ? key.full_name() : key.name();
}

std::string PcapSurvey::unread() const {
  std::string text;
  for (const auto& [key, stream] : streams) {
    if (stream.unread.empty()) continue;
    text += (text.empty() ? "" : ", ") + stream.unread + " on " + key.name();
  }
  return text;
}

PcapSurvey survey_pcap(PcapFile& file, const PcapWanted& wanted) {
  PcapSurvey survey;
  UdpAssembler udp;
  CapturedFrame frame;
  std::uint64_t enough = kFrames;
  bool found = false;
  while (!found || survey.frames < enough) {
    try {
      survey.whole = !file.next(frame);
    } catch (const ReadError&) {
      if (!found) throw;
      break;  // met again when it is read
    }
    if (survey.whole) break;
    ++survey.frames;
    const auto datagram = udp.add(frame.link_type, frame.bytes, frame.stamp);
    if (!datagram) continue;
    if (datagram->has_checksum)
      ++(datagram->checksum_ok ? survey.good_checksums : survey.bad_checksums);
    const std::size_t size = datagram->payload.size();
    const LidarKind kind(*datagram, wanted);
    const UdpStream key = stream_of(*datagram);
    const bool is_wanted =
        kind.is_wanted(wanted) && (wanted.stream.empty() || key.is_named(wanted.stream));
    // Where the lidar starts late, as much is looked at from there on.
    if (is_wanted && !found && survey.frames > kFrames) enough = survey.frames + kFrames;
    found = found || is_wanted;
    PcapSurvey::Stream* at = place_of(survey, key, kind.is_lidar());
    if (at == nullptr) continue;
    PcapSurvey::Stream& stream = *at;
    ++stream.datagrams;
    kind.count_in(stream);
    if (is_velodyne_position(datagram->payload)) ++stream.position;
    if (stream.by_size.size() < kMostSizes || stream.by_size.count(size) > 0)
      ++stream.by_size[size];
  }
  return survey;
}

namespace {

// "walk_0" is "walk" with a number.
bool is_numbered(const std::string& stem, const std::string& capture) {
  if (stem.size() < capture.size() + 2 || stem.rfind(capture + "_", 0) != 0) return false;
  return stem.find_first_not_of("0123456789", capture.size() + 1) == std::string::npos;
}

}  // namespace

std::string find_ouster_metadata(const std::string& capture) {
  namespace fs = std::filesystem;
  const fs::path path(capture);
  const std::string name = path.filename().string();
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  std::vector<std::string> found;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() != ".json") continue;
    const std::string stem = entry.path().stem().string();
    if (stem.empty()) continue;
    if (name.rfind(stem, 0) == 0 || is_numbered(stem, path.stem().string()))
      found.push_back(entry.path().string());
  }
  if (found.empty()) return "";
  std::sort(found.begin(), found.end());
  if (found.size() > 1) {
    throw InputError(capture, "",
                     "several metadata files could belong to it (" + found[0] + ", " + found[1] +
                         "): name one with --metadata");
  }
  return found.front();
}

}  // namespace understory
