#pragma once

#include <deque>
#include <string>

#include "understory/recording/captures/velodyne.h"
#include "understory/recording/messages/message_decode.h"
#include "understory/recording/recording.h"

namespace understory {

// A topic of Velodyne packets: hands them to the decoder and its scans on.
class PacketTopic {
 public:
  // `source` names the stream in warnings.
  PacketTopic(const VelodyneConfig& config, const std::string& source, Log& log)
      : decoder_(config, source, log) {}

  // Returns the number of points of the scans that were finished.
  std::uint64_t add(const PacketsMessage& message, std::deque<Event>& events) {
    std::uint64_t points = 0;
    for (const SensorPacket& packet : message.packets) {
      decoder_.add_packet(packet.data.data(), packet.data.size(), packet.stamp);
      points += drain(events);
    }
    return points;
  }
  void finish(std::deque<Event>& events) {
    decoder_.finish();
    (void)drain(events);
  }
  void save(BinaryWriter& writer) const { decoder_.save(writer); }
  void load(BinaryReader& reader) { decoder_.load(reader); }
  [[nodiscard]] std::string model() const { return decoder_.model_name(); }
  [[nodiscard]] std::string conventions() const { return decoder_.conventions(); }

 private:
  std::uint64_t drain(std::deque<Event>& events) {
    std::uint64_t points = 0;
    while (ScanPtr scan = decoder_.take_scan()) {
      points += scan->points.size();
      events.emplace_back(std::move(scan));
    }
    return points;
  }

  VelodyneDecoder decoder_;
};

}  // namespace understory
