#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "understory/recording/bytes.h"
#include "understory/recording/messages/message_source.h"

namespace understory::test {

// A message of a recording that a test makes up.
struct Stored {
  std::shared_ptr<const MessageChannel> channel;
  TimeNs log_time = 0;
  std::vector<std::uint8_t> data;
};

// Gives such messages in their order.
class StoredSource : public MessageSource {
 public:
  explicit StoredSource(const std::vector<Stored>& messages) : messages_(messages) {}
  bool next(RawMessage& message) override {
    if (at_ == messages_.size()) return false;
    const Stored& stored = messages_[at_++];
    message = {stored.channel, stored.log_time, stored.data};
    return true;
  }
  void save(BinaryWriter& writer) const override { writer.put(static_cast<std::uint64_t>(at_)); }
  void load(BinaryReader& reader) override {
    at_ = static_cast<std::size_t>(reader.get<std::uint64_t>());
  }
  [[nodiscard]] std::string format() const override { return "test"; }
  [[nodiscard]] double progress() const override { return 0.0; }

 private:
  const std::vector<Stored>& messages_;
  std::size_t at_ = 0;
};

inline std::shared_ptr<const MessageChannel> channel(
    const std::string& topic, const std::string& type,
    Serialization serialization = Serialization::kCdr) {
  auto made = std::make_shared<MessageChannel>();
  made->topic = topic;
  made->type = type;
  made->serialization = serialization;
  return made;
}

inline std::vector<std::uint8_t> bytes_of(const ByteBuffer& buffer) {
  return {buffer.span().begin(), buffer.span().end()};
}

}  // namespace understory::test
