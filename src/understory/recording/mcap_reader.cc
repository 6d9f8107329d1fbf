#include "understory/recording/mcap_reader.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "understory/recording/compression.h"
#include "understory/recording/mcap_walker.h"
#include "understory/recording/output_file.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using mcap::Block;

constexpr std::size_t kMostLoadedBlocks = 64;
constexpr std::uint64_t kMostLoadedBytes = 256ULL << 20;

// A block in memory with the places of its messages, by log time.
struct LoadedBlock {
  struct Entry {
    std::uint64_t log_time = 0;
    std::shared_ptr<const MessageChannel> channel;
    std::size_t offset = 0;
    std::size_t length = 0;
  };
  std::vector<std::uint8_t> bytes;
  std::vector<Entry> entries;
  std::size_t next = 0;

  [[nodiscard]] std::uint64_t time() const { return entries[next].log_time; }
};

class McapSource : public MessageSource {
 public:
  McapSource(std::unique_ptr<ByteSource> file, Log& log)
      : file_(std::move(file)), log_(log), walker_(*file_, registry_, log) {
    pending_ = walker_.next();
  }

  bool next(RawMessage& message) override {
    if (current_ != nullptr && current_->next >= current_->entries.size()) drop_current();
    current_ = nullptr;
    load_what_is_due();
    LoadedBlock* block = earliest();
    if (block == nullptr) return false;
    const LoadedBlock::Entry& entry = block->entries[block->next++];
    message.channel = entry.channel;
    message.log_time = static_cast<TimeNs>(std::min<std::uint64_t>(
        entry.log_time, static_cast<std::uint64_t>(std::numeric_limits<TimeNs>::max())));
    message.data = ByteSpan(block->bytes).subspan(entry.offset, entry.length);
    current_ = block;
    return true;
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

 private:
  // Loads blocks until no block still to come can hold an earlier message.
  void load_what_is_due() {
    while (pending_) {
      const LoadedBlock* first = earliest();
      const bool full = loaded_.size() >= kMostLoadedBlocks || loaded_bytes_ >= kMostLoadedBytes;
      if (first != nullptr && (full || pending_->start > first->time())) return;
      const Block block = *pending_;
      load(block);
      pending_ = walker_.next();
    }
  }

  LoadedBlock* earliest() {
    LoadedBlock* best = nullptr;
    for (const auto& block : loaded_) {
      if (best == nullptr || block->time() < best->time()) best = block.get();
    }
    return best;
  }

  void drop_current() {
    const auto at = std::find_if(loaded_.begin(), loaded_.end(),
                                 [&](const auto& block) { return block.get() == current_; });
    loaded_bytes_ -= current_->bytes.size();
    loaded_.erase(at);
  }

  void load(const Block& block) {
    auto loaded = std::make_unique<LoadedBlock>();
    if (block.is_chunk) {
      if (!unpack(block, loaded->bytes)) return;
      list_messages(block, *loaded);
    } else {
      file_->read(block.offset + mcap::kRecordHead, block.length, loaded->bytes);
      add_message(loaded->bytes, 0, *loaded);
    }
    if (loaded->entries.empty()) return;
    std::stable_sort(loaded->entries.begin(), loaded->entries.end(),
                     [](const auto& a, const auto& b) { return a.log_time < b.log_time; });
    loaded_bytes_ += loaded->bytes.size();
    loaded_.push_back(std::move(loaded));
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

  void list_messages(const Block& block, LoadedBlock& loaded) {
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

  void add_message(ByteSpan content, std::size_t begin, LoadedBlock& loaded) {
    ByteReader reader(content);
    const auto id = reader.get<std::uint16_t>();
    (void)reader.get<std::uint32_t>();  // sequence
    LoadedBlock::Entry entry;
    entry.log_time = reader.get<std::uint64_t>();
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
    log_.warn("recording.damaged",
              file_->name() + ": at byte " + std::to_string(block.offset) + ": " + what);
    return false;
  }

  std::unique_ptr<ByteSource> file_;
  Log& log_;
  mcap::Registry registry_;
  mcap::Walker walker_;
  std::optional<Block> pending_;
  std::vector<std::unique_ptr<LoadedBlock>> loaded_;
  std::uint64_t loaded_bytes_ = 0;
  LoadedBlock* current_ = nullptr;
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
