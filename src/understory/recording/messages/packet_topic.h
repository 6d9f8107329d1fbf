#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "understory/recording/messages/message_decode.h"
#include "understory/recording/messages/message_survey.h"
#include "understory/recording/recording.h"

namespace understory {

// A topic of packets of a lidar: hands them to the decoder of the sensor and its scans on. Not
// thread-safe.
class PacketTopic {
 public:
  virtual ~PacketTopic() = default;
  // Returns the number of points of the scans that were finished.
  virtual std::uint64_t add(const PacketsMessage& message, std::deque<Event>& events) = 0;
  virtual void finish(std::deque<Event>& events) = 0;
  virtual void save(BinaryWriter& writer) const = 0;
  virtual void load(BinaryReader& reader) = 0;
  [[nodiscard]] virtual std::string model() const = 0;
  [[nodiscard]] virtual std::string conventions() const = 0;
};

// Whose packets a topic holds.
enum class PacketMaker : std::uint8_t { kNone, kVelodyne, kHesai };

// By the first bytes of the first packet; kNone for a message without packets.
[[nodiscard]] PacketMaker packet_maker(const PacketsMessage& message);

// What packet topics need to know of their recording.
struct PacketSource {
  std::string file;
  std::string topic;
  bool ros1 = false;
  std::string calibration_file;  // as --metadata names it; empty: what lies beside the recording
};

// The decoder of a maker. The clouds that go with packets of a Velodyne: the ROS 1 driver's
// calibration has the beams' vertical offsets, that of nebula for ROS 2 has not. Throws InputError
// for a wrong calibration.
[[nodiscard]] std::unique_ptr<PacketTopic> make_packet_topic(PacketMaker maker,
                                                             const PacketSource& source, Log& log);

// Whether topics of a role hold packets.
[[nodiscard]] bool is_packets(TopicRole role);
// A message of such a topic; nothing where the bytes are no whole message of its type.
[[nodiscard]] std::optional<PacketsMessage> decode_packets(TopicRole role, MessageReader reader);

}  // namespace understory
