#include "understory/recording/bags/rosbag_reader.h"

#include <algorithm>
#include <map>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "understory/recording/bags/compression.h"
#include "understory/recording/finding.h"
#include "understory/recording/messages/message_merger.h"
#include "understory/util/error.h"
#include "understory/util/files/read_error.h"

namespace understory {
namespace {

// 0x04, index data, is not needed for reading from front to back.
constexpr std::uint8_t kMessage = 0x02;
constexpr std::uint8_t kBagHeader = 0x03;
constexpr std::uint8_t kChunk = 0x05;
constexpr std::uint8_t kChunkInfo = 0x06;
constexpr std::uint8_t kConnection = 0x07;

constexpr std::uint32_t kLongestHeader = 1U << 20;
constexpr std::size_t kBagSearchWindow = 1U << 20;
constexpr std::string_view kChunkMark = "compression=";
constexpr std::size_t kMarkReach = 96;  // a chunk's header begins at most that far before its mark
// Chunks loaded at a time: neighbours may overlap in time by a little.
constexpr std::size_t kLoadedChunks = 2;
constexpr std::size_t kChunksOfConnection = 16;

// The fields of a record's header, "name=value" each.
using Fields = std::map<std::string_view, ByteSpan>;

// Nothing if the bytes are no list of fields.
std::optional<Fields> parse_fields(ByteSpan header) {
  Fields fields;
  ByteReader reader(header);
  while (reader.remaining() > 0) {
    const std::string_view field = reader.text();
    const std::size_t equals = field.find('=');
    if (!reader.ok() || equals == std::string_view::npos) return std::nullopt;
    const std::string_view value = field.substr(equals + 1);
    fields[field.substr(0, equals)] = {reinterpret_cast<const std::uint8_t*>(value.data()),
                                       value.size()};
  }
  return fields;
}

template <typename T>
std::optional<T> number(const Fields& fields, std::string_view name) {
  const auto found = fields.find(name);
  if (found == fields.end() || found->second.size() != sizeof(T)) return std::nullopt;
  return ByteReader(found->second).get<T>();
}

std::string text(const Fields& fields, std::string_view name) {
  const auto found = fields.find(name);
  if (found == fields.end()) return "";
  return {reinterpret_cast<const char*>(found->second.data()), found->second.size()};
}

class RosbagSource : public MessageSource {
 public:
  RosbagSource(std::unique_ptr<ByteSource> file, Log& log) : file_(std::move(file)), log_(log) {
    position_ = std::string_view(kRosbagMagic).size();
    try {
      read_index();
    } catch (const ReadError& error) {
      // What comes before it may be readable; where it is not, the reading says so.
      log_.warn("recording.mended", std::string(error.what()) + ": reading without the index");
    }
    last_good_ = position_;
  }

  bool next(RawMessage& message) override {
    merger_.tidy();
    while (!ended_ && merger_.blocks() < kLoadedChunks)
      advance();
    return merger_.next(message);
  }

  void save(BinaryWriter& writer) const override {
    writer.put(position_);
    writer.put(last_good_);
    writer.put(ended_);
    writer.put(compression_);
    writer.put(static_cast<std::uint64_t>(connections_.size()));
    for (const auto& [id, channel] : connections_) {
      writer.put(id);
      put_channel(writer, *channel);
    }
    writer.put(merger_.progress());
  }
  void load(BinaryReader& reader) override {
    const auto position = reader.get<std::uint64_t>();
    const auto last_good = reader.get<std::uint64_t>();
    const bool ended = reader.get<bool>();
    const std::string compression = reader.get_string();
    connections_.clear();
    for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
      auto& channel = connections_[reader.get<std::uint32_t>()];
      channel = get_channel(reader);
    }
    for (const MessageMerger::Progress& progress : reader.get_vector<MessageMerger::Progress>()) {
      const auto record = record_at(progress.place);
      if (record) take_block(*record);
      if (!record || !merger_.pass(progress))
        throw InputError(file_->name(), "at byte " + std::to_string(progress.place),
                         "expected the chunk that was read when the run was begun");
    }
    position_ = position;
    last_good_ = last_good;
    ended_ = ended;
    compression_ = compression;
  }

  [[nodiscard]] std::string format() const override {
    return "ROS 1 bag (" + (compression_.empty() ? "no chunks" : compression_) + ")";
  }
  [[nodiscard]] double progress() const override {
    return static_cast<double>(std::min(position_, file_->size())) /
           static_cast<double>(file_->size());
  }
  [[nodiscard]] std::vector<StoredMessage> first_messages(const WantedChannel& wanted,
                                                          std::size_t most) override {
    std::vector<StoredMessage> found;
    const auto connections = connections_;
    for (const auto& [id, channel] : connections) {
      const auto chunks = chunks_of_.find(id);
      if (chunks == chunks_of_.end() || !wanted(*channel)) continue;
      const std::size_t enough = found.size() + most;
      for (const std::uint64_t place : chunks->second) {
        const auto record = record_at(place);
        if (!record || record->op != kChunk || record->cut) continue;
        const auto size = number<std::uint32_t>(record->fields, "size");
        MessageBlock block;
        if (!size || !unpack(*record, std::min(record->data_length, kLongestBlock),
                             text(record->fields, "compression"), *size, block.bytes)
                          .empty())
          continue;
        list_messages(block);
        keep_messages(block, *channel, enough, found);
        if (found.size() >= enough) break;
      }
    }
    return found;
  }

 private:
  struct Record {
    std::uint64_t offset = 0;
    std::vector<std::uint8_t> header;
    Fields fields;  // of `header`
    std::uint8_t op = 0;
    std::uint64_t data_offset = 0;
    std::uint64_t data_length = 0;
    bool cut = false;  // the file ends inside the data
  };

  void warn(const std::string& key, std::uint64_t offset, const std::string& what) {
    log_.warn(key, file_->name() + ": at byte " + std::to_string(offset) + ": " + what);
  }

  // The record at `offset`; nothing if there is none that makes sense.
  std::optional<Record> record_at(std::uint64_t offset) {
    std::uint8_t raw[4];
    if (file_->read(offset, raw, 4) != 4) return std::nullopt;
    const auto header_length = ByteReader(raw).get<std::uint32_t>();
    if (header_length < 8 || header_length > kLongestHeader) return std::nullopt;
    Record record;
    record.offset = offset;
    file_->read(offset + 4, header_length, record.header);
    if (record.header.size() != header_length) return std::nullopt;
    auto fields = parse_fields(record.header);
    if (!fields) return std::nullopt;
    record.fields = std::move(*fields);
    const auto op = number<std::uint8_t>(record.fields, "op");
    if (!op || *op < kMessage || *op > kConnection) return std::nullopt;
    record.op = *op;
    if (file_->read(offset + 4 + header_length, raw, 4) != 4) return std::nullopt;
    record.data_offset = offset + 8 + header_length;
    record.data_length = ByteReader(raw).get<std::uint32_t>();
    record.cut = record.data_length > file_->size() - record.data_offset;
    return record;
  }

  // Connections are repeated at the end of an indexed bag; having them first helps where a chunk is
  // damaged.
  void read_index() {
    const auto header = record_at(position_);
    if (!header || header->op != kBagHeader || header->cut) return;
    const auto index = number<std::uint64_t>(header->fields, "index_pos");
    position_ = header->data_offset + header->data_length;
    if (!index || *index <= position_ || *index >= file_->size()) return;
    std::uint64_t at = *index;
    while (at < file_->size()) {
      const auto record = record_at(at);
      if (!record || record->cut || (record->op != kConnection && record->op != kChunkInfo)) return;
      std::vector<std::uint8_t> data;
      file_->read(record->data_offset, record->data_length, data);
      if (record->op == kConnection) {
        add_connection(record->fields, data);
      } else {
        add_chunk_info(record->fields, data);
      }
      at = record->data_offset + record->data_length;
    }
    is_indexed_ = true;
    data_end_ = *index;
  }

  // Which connections the messages of a chunk belong to.
  void add_chunk_info(const Fields& fields, ByteSpan data) {
    const auto place = number<std::uint64_t>(fields, "chunk_pos");
    ByteReader counts(data);
    while (place && counts.remaining() >= 8) {
      std::vector<std::uint64_t>& chunks = chunks_of_[counts.get<std::uint32_t>()];
      (void)counts.get<std::uint32_t>();
      if (chunks.size() < kChunksOfConnection) chunks.push_back(*place);
    }
  }

  void add_connection(const Fields& fields, ByteSpan data) {
    const auto id = number<std::uint32_t>(fields, "conn");
    const auto inner = parse_fields(data);
    if (!id || !inner || connections_.count(*id) > 0) return;
    auto channel = std::make_shared<MessageChannel>();
    channel->topic = text(fields, "topic");
    if (channel->topic.empty()) channel->topic = text(*inner, "topic");
    channel->type = text(*inner, "type");
    channel->serialization = Serialization::kRos1;
    connections_[*id] = std::move(channel);
  }

  // Takes the next record of the file.
  void advance() {
    if (position_ >= file_->size() || (is_indexed_ && position_ >= data_end_)) {
      if (!is_indexed_)
        warn("recording.unfinished", position_,
             "the bag was not closed (it has no index); read to its end");
      ended_ = true;
      return;
    }
    const auto record = record_at(position_);
    if (!record) return resynchronise();
    if (record->cut && record->op != kChunk && record->op != kMessage) return resynchronise();
    last_good_ = record->op == kChunk && !record->cut ? record->data_offset + record->data_length
                                                      : record->offset + 1;
    position_ = record->data_offset + record->data_length;
    if (record->op == kConnection) {
      std::vector<std::uint8_t> data;
      file_->read(record->data_offset, record->data_length, data);
      add_connection(record->fields, data);
    }
    take_block(*record);
  }

  // A chunk, or a message outside of chunks.
  void take_block(const Record& record) {
    if (record.op == kChunk) return take_chunk(record);
    if (record.op != kMessage || record.cut) return;
    MessageBlock block;
    block.place = record.offset;
    file_->read(record.data_offset, record.data_length, block.bytes);
    add_message(record.fields, 0, block.bytes.size(), block);
    merger_.add(std::move(block));
  }

  void take_chunk(const Record& record) {
    const auto size = number<std::uint32_t>(record.fields, "size");
    const std::string method = text(record.fields, "compression");
    if (!size || method.empty())
      return warn(key_of(Finding::kDamage), record.offset, "a chunk without size");
    compression_ = method == "none" ? "no compression" : method;
    std::uint64_t length = std::min(record.data_length, kLongestBlock);
    if (record.cut) length = std::min(length, pass_cut_chunk(record));
    MessageBlock block;
    block.place = record.offset;
    std::string problem = unpack(record, length, method, *size, block.bytes);
    if (problem.empty() && block.bytes.size() != *size) problem = "its length is wrong";
    const bool whole = list_messages(block);
    if (problem.empty() && !whole) problem = "a record in it is damaged";
    if (!problem.empty() && !record.cut)
      warn(key_of(Finding::kDamage), record.offset,
           "the chunk is damaged (" + problem + "); read as far as it goes");
    merger_.add(std::move(block));
  }

  // The bytes of a chunk, as far as they can be unpacked; what is wrong with them, if anything.
  std::string unpack(const Record& record, std::uint64_t length, const std::string& method,
                     std::uint32_t size, std::vector<std::uint8_t>& bytes) {
    std::vector<std::uint8_t> packed;
    file_->read(record.data_offset, length, packed);
    if (method != "none") return decompress(packed, method, size, bytes);
    bytes = std::move(packed);
    return "";
  }

  // A chunk that seems to reach beyond the end of the file. Either the file was cut off, or the
  // chunk's length is damaged and others follow. Returns how much of it may be read.
  std::uint64_t pass_cut_chunk(const Record& record) {
    const auto following = find_chunk(record.data_offset);
    position_ = following.value_or(file_->size());
    if (following) {
      warn(key_of(Finding::kDamage), record.offset,
           "the chunk's length is damaged; going on at byte " + std::to_string(*following));
    } else {
      warn(key_of(Finding::kCutOff), record.offset, "the file ends inside this chunk");
      ended_ = true;
    }
    return position_ - record.data_offset;
  }

  // Returns false where the records break off.
  bool list_messages(MessageBlock& block) {
    ByteReader reader(block.bytes);
    while (reader.remaining() > 0) {
      const ByteSpan header = reader.take(reader.get<std::uint32_t>());
      const auto length = reader.get<std::uint32_t>();
      const std::size_t begin = reader.position();
      const ByteSpan data = reader.take(length);
      const auto fields = parse_fields(header);
      if (!reader.ok() || !fields) return false;
      const auto op = number<std::uint8_t>(*fields, "op");
      if (op == kConnection) add_connection(*fields, data);
      if (op == kMessage) add_message(*fields, begin, data.size(), block);
    }
    return true;
  }

  void add_message(const Fields& fields, std::size_t offset, std::size_t length,
                   MessageBlock& block) {
    const auto id = number<std::uint32_t>(fields, "conn");
    const auto time = number<std::uint64_t>(fields, "time");
    const auto found = id ? connections_.find(*id) : connections_.end();
    if (!time || found == connections_.end()) {
      log_.warn("recording.unknown_channel",
                file_->name() +
                    ": a message whose connection the file does not describe is "
                    "passed over");
      return;
    }
    MessageBlock::Entry entry;
    entry.log_time =
        static_cast<TimeNs>(*time & 0xFFFFFFFFU) * kNsPerSecond + static_cast<TimeNs>(*time >> 32U);
    entry.channel = found->second;
    entry.offset = offset;
    entry.length = length;
    block.entries.push_back(std::move(entry));
  }

  // The next chunk from `from` on, found by its compression field.
  std::optional<std::uint64_t> find_chunk(std::uint64_t from) {
    std::vector<std::uint8_t> window;
    for (std::uint64_t at = from; at < file_->size(); at += kBagSearchWindow) {
      file_->read(at, kBagSearchWindow + kChunkMark.size() - 1, window);
      const std::string_view view(reinterpret_cast<const char*>(window.data()), window.size());
      for (std::size_t mark = view.find(kChunkMark); mark != std::string_view::npos;
           mark = view.find(kChunkMark, mark + 1)) {
        const std::uint64_t mark_at = at + mark;
        const std::uint64_t reach = std::min<std::uint64_t>(mark_at - from, kMarkReach);
        for (std::uint64_t offset = mark_at - reach; offset < mark_at; ++offset) {
          const auto record = record_at(offset);
          if (record && record->op == kChunk && !record->cut) return offset;
        }
      }
    }
    return std::nullopt;
  }

  void resynchronise() {
    const std::uint64_t lost_at = position_;
    const auto found = find_chunk(last_good_);
    if (found) {
      position_ = *found;
      last_good_ = *found + 1;
      return warn(key_of(Finding::kDamage), lost_at,
                  "expected a record; going on at byte " + std::to_string(*found));
    }
    warn(is_indexed_ ? key_of(Finding::kDamage) : key_of(Finding::kCutOff), lost_at,
         "expected a record; nothing more was found behind it");
    ended_ = true;
  }

  std::unique_ptr<ByteSource> file_;
  Log& log_;
  std::uint64_t position_ = 0;
  std::uint64_t last_good_ = 0;  // behind the start of the last record that made sense
  std::uint64_t data_end_ = 0;   // of an indexed bag
  bool is_indexed_ = false;
  bool ended_ = false;
  std::map<std::uint32_t, std::shared_ptr<const MessageChannel>> connections_;
  std::map<std::uint32_t, std::vector<std::uint64_t>> chunks_of_;  // connection -> places
  MessageMerger merger_;
  std::string compression_;
};

}  // namespace

std::unique_ptr<MessageSource> read_rosbag(std::unique_ptr<ByteSource> file, Log& log) {
  const std::string_view magic = kRosbagMagic;
  std::vector<std::uint8_t> head;
  file->read(0, magic.size(), head);
  if (std::string_view(reinterpret_cast<const char*>(head.data()), head.size()) != magic)
    throw InputError(file->name(), "at byte 0", "expected the magic of a ROS 1 bag, version 2.0");
  return std::make_unique<RosbagSource>(std::move(file), log);
}

}  // namespace understory
