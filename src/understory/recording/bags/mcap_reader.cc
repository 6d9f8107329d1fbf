#include "understory/recording/bags/mcap_reader.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "understory/recording/bags/compression.h"
#include "understory/recording/bags/mcap_walker.h"
#include "understory/recording/finding.h"
#include "understory/recording/messages/event_bytes.h"
#include "understory/recording/messages/message_merger.h"
#include "understory/util/error.h"
#include "understory/util/files/output_file.h"

namespace understory {
namespace {

using mcap::Block;

constexpr std::size_t kMostLoadedBlocks = 64;
constexpr std::uint64_t kMostLoadedBytes = 256ULL << 20;

TimeNs to_time(std::uint64_t log_time) {
  return static_cast<TimeNs>(std::min<std::uint64_t>(log_time, kLatestTime));
}

class McapSource : public MessageSource {
 public:
  McapSource(std::unique_ptr<ByteSource> file, Log& log)
      : file_(std::move(file)), log_(log), walker_(*file_, registry_, log) {
    pending_ = walker_.next();
  }

  bool next(RawMessage& message) override {
    merger_.tidy();
    // Load blocks until no block still to come can hold an earlier message.
    while (pending_) {
      const bool full =
          merger_.blocks() >= kMostLoadedBlocks || merger_.bytes() >= kMostLoadedBytes;
      if (!merger_.empty() && (full || to_time(pending_->start) > merger_.earliest())) break;
      const Block block = *pending_;
      load(block);
      pending_ = walker_.next();
    }
    return merger_.next(message);
  }

  void save(BinaryWriter& writer) const override {
    registry_.save(writer);
    walker_.save(writer);
    writer.put(compression_);
    put_optional(writer, pending_);
    writer.put(merger_.progress());
  }
  void load(BinaryReader& reader) override {
    registry_.load(reader);
    walker_.load(reader);
    const std::string compression = reader.get_string();
    pending_ = get_optional<Block>(reader);
    for (const MessageMerger::Progress& progress : reader.get_vector<MessageMerger::Progress>()) {
      const auto block = walker_.at(progress.place);
      if (block) load(*block);
      if (!block || !merger_.pass(progress))
        throw InputError(file_->name(), "at byte " + std::to_string(progress.place),
                         "expected the chunk that was read when the run was begun");
    }
    compression_ = compression;
  }

  [[nodiscard]] std::string format() const override {
    std::string text = "MCAP (" + (walker_.profile().empty() ? "no profile" : walker_.profile());
    return text + (compression_.empty() ? ")" : ", " + compression_ + ")");
  }
  [[nodiscard]] double progress() const override {
    return static_cast<double>(walker_.position()) / static_cast<double>(file_->size());
  }
  [[nodiscard]] std::map<std::string, std::string> sensor_metadata() const override {
    return walker_.sensor();
  }
  [[nodiscard]] std::vector<StoredMessage> first_messages(const WantedChannel& wanted,
                                                          std::size_t most) override {
    std::vector<StoredMessage> found;
    const mcap::Channels channels = registry_.channels();
    for (const auto& [id, channel] : channels) {
      if (!wanted(*channel)) continue;
      const std::size_t enough = found.size() + most;
      for (const Block& block : walker_.chunks_of(id)) {
        MessageBlock loaded;
        if (!unpack(block, loaded.bytes)) continue;
        list_messages(block, loaded);
        keep_messages(loaded, *channel, enough, found);
        if (found.size() >= enough) break;
      }
    }
    return found;
  }

 private:
  void load(const Block& block) {
    MessageBlock loaded;
    loaded.place = block.offset;
    loaded.bytes = merger_.take_spare();
    if (block.is_chunk) {
      if (!unpack(block, loaded.bytes)) return;
      list_messages(block, loaded);
    } else {
      if (block.length > kLongestBlock) return (void)damaged(block, "the message is too long");
      file_->read(block.offset + mcap::kRecordHead, block.length, loaded.bytes);
      add_message(loaded.bytes, 0, loaded);
    }
    merger_.add(std::move(loaded));
  }

  // The records of a chunk, unpacked and checked.
  bool unpack(const Block& block, std::vector<std::uint8_t>& records) {
    if (block.length > kLongestBlock) return damaged(block, "the chunk is too long");
    file_->read(block.offset + mcap::kRecordHead, block.length, packed_);
    const auto head = mcap::parse_chunk_head(packed_, block.length);
    if (!head) return damaged(block, "the chunk cannot be read");
    const ByteSpan data = ByteSpan(packed_).subspan(head->data_at);
    compression_ = head->compression.empty() ? "no compression" : head->compression;
    std::string problem;
    if (head->compression.empty()) {
      records.assign(data.begin(), data.end());
    } else {
      problem = decompress(data, head->compression, head->size, records);
    }
    if (block.cut) return true;  // whatever could be unpacked
    if (!problem.empty()) return damaged(block, "the chunk is left out: " + problem);
    if (records.size() != head->size)
      return damaged(block, "the chunk is left out: its length is wrong");
    if (head->crc != 0 && crc32_of(records) != head->crc)
      return damaged(block, "the chunk is left out: its checksum is wrong");
    return true;
  }

  void list_messages(const Block& block, MessageBlock& loaded) {
    ByteReader reader(loaded.bytes);
    while (reader.remaining() >= mcap::kRecordHead) {
      const auto opcode = reader.get<std::uint8_t>();
      const auto length = reader.get<std::uint64_t>();
      const std::size_t begin = reader.position();
      const ByteSpan content = reader.take(length);
      if (!reader.ok()) {
        if (!block.cut) (void)damaged(block, "a record in this chunk is cut off");
        return;
      }
      if (opcode == mcap::kSchema) registry_.add_schema(content);
      if (opcode == mcap::kChannel) registry_.add_channel(content);
      if (opcode == mcap::kMessage) add_message(content, begin, loaded);
    }
  }

  void add_message(ByteSpan content, std::size_t begin, MessageBlock& loaded) {
    ByteReader reader(content);
    const auto id = reader.get<std::uint16_t>();
    (void)reader.get<std::uint32_t>();  // sequence
    MessageBlock::Entry entry;
    entry.log_time = to_time(reader.get<std::uint64_t>());
    (void)reader.get<std::uint64_t>();  // publish time
    entry.channel = registry_.find(id);
    if (!reader.ok() || entry.channel == nullptr) {
      log_.warn("recording.unknown_channel",
                file_->name() + ": a message of channel " + std::to_string(id) +
                    ", which the file does not describe, is passed over");
      return;
    }
    entry.offset = begin + reader.position();
    entry.length = reader.remaining();
    loaded.entries.push_back(std::move(entry));
  }

  bool damaged(const Block& block, const std::string& what) {
    report_finding(log_, Finding::kDamage,
                   file_->name() + ": at byte " + std::to_string(block.offset) + ": " + what);
    return false;
  }

  std::unique_ptr<ByteSource> file_;
  Log& log_;
  mcap::Registry registry_;
  mcap::Walker walker_;
  std::optional<Block> pending_;
  MessageMerger merger_;
  std::vector<std::uint8_t> packed_;
  std::string compression_;
};

}  // namespace

std::unique_ptr<MessageSource> read_mcap(std::unique_ptr<ByteSource> file, Log& log) {
  std::uint8_t magic[sizeof(mcap::kMagic)] = {};
  const std::size_t got = file->read(0, magic, sizeof(magic));
  if (got != sizeof(magic) || std::memcmp(magic, mcap::kMagic, sizeof(magic)) != 0)
    throw InputError(file->name(), "at byte 0", "expected the magic of an MCAP file");
  return std::make_unique<McapSource>(std::move(file), log);
}

}  // namespace understory
