#include "understory/recording/pcap_survey.h"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <vector>

#include "understory/recording/velodyne.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr std::size_t kFrames = 20'000;
constexpr std::size_t kMostStreams = 256;
constexpr std::size_t kMostSizes = 16;

}  // namespace

bool is_velodyne_data(ByteSpan payload) {
  return payload.size() == VelodyneDecoder::kDataPacketSize && payload[0] == 0xFF &&
         payload[1] == 0xEE;
}

bool is_velodyne_position(ByteSpan payload) {
  constexpr std::size_t kSentence = 206;
  return payload.size() == VelodyneDecoder::kPositionPacketSize && payload[kSentence] == '$';
}

std::string PcapSurvey::list() const {
  std::string text;
  for (const auto& [key, stream] : streams) {
    for (const auto& [size, count] : stream.by_size) {
      text += (text.empty() ? "" : ", ") + key.name() + ": " + std::to_string(count) + " x " +
              std::to_string(size) + " bytes";
    }
  }
  return text.empty() ? "no UDP packets" : text;
}

PcapSurvey survey_pcap(PcapFile& file) {
  PcapSurvey survey;
  UdpAssembler udp;
  CapturedFrame frame;
  for (std::size_t i = 0; i < kFrames && file.next(frame); ++i) {
    const auto datagram = udp.add(frame.link_type, frame.bytes, frame.stamp);
    if (!datagram) continue;
    if (datagram->has_checksum)
      ++(datagram->checksum_ok ? survey.good_checksums : survey.bad_checksums);
    const UdpStream key{datagram->source, datagram->port};
    if (survey.streams.size() >= kMostStreams && survey.streams.count(key) == 0) continue;
    PcapSurvey::Stream& stream = survey.streams[key];
    ++stream.datagrams;
    if (is_velodyne_data(datagram->payload)) ++stream.velodyne;
    if (is_velodyne_position(datagram->payload)) ++stream.position;
    const std::size_t size = datagram->payload.size();
    if (stream.by_size.size() < kMostSizes || stream.by_size.count(size) > 0)
      ++stream.by_size[size];
  }
  return survey;
}

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
    if (!stem.empty() && name.rfind(stem, 0) == 0) found.push_back(entry.path().string());
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
