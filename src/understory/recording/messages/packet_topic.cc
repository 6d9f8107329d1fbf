#include "understory/recording/messages/packet_topic.h"

#include <utility>

#include "understory/recording/captures/hesai/hesai.h"
#include "understory/recording/captures/velodyne.h"
#include "understory/util/error.h"

namespace understory {
namespace {

template <typename Decoder>
class DecodedTopic : public PacketTopic {
 public:
  template <typename Config>
  DecodedTopic(const Config& config, const std::string& source, Log& log)
      : decoder_(config, source, log) {}

  std::uint64_t add(const PacketsMessage& message, std::deque<Event>& events) override {
    std::uint64_t points = 0;
    for (const SensorPacket& packet : message.packets) {
      decoder_.add_packet(packet.data.data(), packet.data.size(), packet.stamp);
      points += drain(events);
    }
    return points;
  }
  void finish(std::deque<Event>& events) override {
    decoder_.finish();
    (void)drain(events);
  }
  void save(BinaryWriter& writer) const override { decoder_.save(writer); }
  void load(BinaryReader& reader) override { decoder_.load(reader); }
  [[nodiscard]] std::string model() const override { return decoder_.model_name(); }
  [[nodiscard]] std::string conventions() const override { return decoder_.conventions(); }

 private:
  std::uint64_t drain(std::deque<Event>& events) {
    std::uint64_t points = 0;
    while (ScanPtr scan = decoder_.take_scan()) {
      points += scan->points.size();
      events.emplace_back(std::move(scan));
    }
    return points;
  }

  Decoder decoder_;
};

}  // namespace

PacketMaker packet_maker(const PacketsMessage& message) {
  if (message.packets.empty()) return PacketMaker::kNone;
  return is_hesai_data(message.packets.front().data) ? PacketMaker::kHesai : PacketMaker::kVelodyne;
}

std::unique_ptr<PacketTopic> make_packet_topic(PacketMaker maker, const PacketSource& source,
                                               Log& log) {
  const std::string name = source.file + " " + source.topic;
  if (maker == PacketMaker::kHesai) {
    HesaiConfig config;
    config.calibration = find_hesai_calibration(source.file, source.calibration_file);
    return std::make_unique<DecodedTopic<HesaiDecoder>>(config, name, log);
  }
  UNDERSTORY_CHECK(maker == PacketMaker::kVelodyne);
  VelodyneConfig config;
  config.vertical_offsets = source.ros1;
  return std::make_unique<DecodedTopic<VelodyneDecoder>>(config, name, log);
}

bool is_packets(TopicRole role) {
  return role == TopicRole::kVelodynePackets || role == TopicRole::kNebulaPackets ||
         role == TopicRole::kPandarPackets || role == TopicRole::kHesaiFrames;
}

std::optional<PacketsMessage> decode_packets(TopicRole role, MessageReader reader) {
  switch (role) {
    case TopicRole::kVelodynePackets:
      return decode_velodyne_scan(reader);
    case TopicRole::kNebulaPackets:
      return decode_nebula_packets(reader);
    case TopicRole::kPandarPackets:
      return decode_pandar_scan(reader);
    case TopicRole::kHesaiFrames:
      return decode_hesai_frame(reader);
    default:
      return std::nullopt;
  }
}

}  // namespace understory
