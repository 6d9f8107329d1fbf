#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "understory/recording/messages/message_reader.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/log.h"
#include "understory/util/time.h"

namespace understory {

// A topic of a container file (MCAP, ROS 1 bag, ROS 2 .db3).
struct MessageChannel {
  std::string topic;
  std::string type;  // as the file names it: "sensor_msgs/msg/Imu", "sensor_msgs/Imu"
  Serialization serialization = Serialization::kCdr;
  bool readable = true;  // false: an encoding other than CDR or ROS 1
};

// A channel in the bytes of checkpoints; get_channel reads it.
inline void put_channel(BinaryWriter& writer, const MessageChannel& channel) {
  writer.put(channel.topic);
  writer.put(channel.type);
  writer.put(channel.serialization);
  writer.put(channel.readable);
}
// Reads what put_channel has written.
[[nodiscard]] inline std::shared_ptr<const MessageChannel> get_channel(BinaryReader& reader) {
  auto channel = std::make_shared<MessageChannel>();
  channel->topic = reader.get_string();
  channel->type = reader.get_string();
  channel->serialization = reader.get_enum(Serialization::kRos1);
  channel->readable = reader.get<bool>();
  return channel;
}

// Log times are held within half of the range of TimeNs, so that differences of damaged ones are
// numbers too; it reaches beyond the year 2110.
inline constexpr TimeNs kLatestTime = 4'600'000'000'000'000'000;
[[nodiscard]] inline TimeNs plausible_time(TimeNs time) {
  return std::clamp(time, -kLatestTime, kLatestTime);
}

// A message as it lies in the file.
struct RawMessage {
  std::shared_ptr<const MessageChannel> channel;
  TimeNs log_time = 0;  // when it was recorded
  ByteSpan data;        // valid until the next call of `next`
};

// One that is kept.
struct StoredMessage {
  std::shared_ptr<const MessageChannel> channel;
  TimeNs log_time = 0;
  std::vector<std::uint8_t> data;
};
using WantedChannel = std::function<bool(const MessageChannel&)>;

// The messages of a container file in the order of their log times, as far as they stand close to
// each other in the file. Memory is bounded. Damage is passed over with a warning (keys
// "recording.damaged" and "recording.truncated") that names the file and the byte.
class MessageSource {
 public:
  virtual ~MessageSource() = default;
  [[nodiscard]] virtual bool next(RawMessage& message) = 0;
  // Where the reading stands, between two calls of `next`, and back to there in a source that was
  // opened just now (Recording::save, Recording::load).
  virtual void save(BinaryWriter& writer) const = 0;
  virtual void load(BinaryReader& reader) = 0;
  [[nodiscard]] virtual std::string format() const = 0;  // "MCAP (ros2, zstd)"
  [[nodiscard]] virtual double progress() const = 0;     // 0 to 1
  // What the file itself says of its sensors (kSensorMetadata of our own recordings).
  [[nodiscard]] virtual std::map<std::string, std::string> sensor_metadata() const { return {}; }
  // The first messages of each topic that `wanted` accepts, at most `most` of each, wherever in the
  // file they stand: found by its index. None where it has no index. `next` goes on as if they had
  // not been looked for.
  [[nodiscard]] virtual std::vector<StoredMessage> first_messages(const WantedChannel& /*wanted*/,
                                                                  std::size_t /*most*/) {
    return {};
  }
};

// Opens the same messages from the start; called once to look ahead and once to read.
using MessageSourceFactory = std::function<std::unique_ptr<MessageSource>(Log&)>;

}  // namespace understory
