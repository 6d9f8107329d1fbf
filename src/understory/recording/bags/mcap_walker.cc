#include "understory/recording/bags/mcap_walker.h"

#include <algorithm>
#include <utility>

#include "understory/recording/finding.h"
#include "understory/util/error.h"
#include "understory/util/files/output_file.h"
#include "understory/util/files/read_error.h"

namespace understory::mcap {
namespace {

constexpr std::size_t kChunkHeadBytes = 64;  // start, end, sizes, crc and the compression's name
constexpr std::uint64_t kLongestSmallRecord = 16ULL << 20;
constexpr std::uint64_t kLongestSummary = 256ULL << 20;
constexpr std::size_t kSearchWindow = 1U << 20;
constexpr std::size_t kChunksOfChannel = 16;
constexpr std::size_t kFooterRecord = kRecordHead + kFooterContent;

std::map<std::string, std::string> parse_text_map(ByteReader& reader) {
  std::map<std::string, std::string> map;
  ByteReader entries(reader.take(reader.get<std::uint32_t>()));
  while (entries.ok() && entries.remaining() > 0) {
    std::string key(entries.text());
    std::string value(entries.text());
    if (entries.ok()) map[std::move(key)] = std::move(value);
  }
  return map;
}

Serialization serialization_of(const std::string& encoding) {
  return encoding == "ros1" ? Serialization::kRos1 : Serialization::kCdr;
}

}  // namespace

std::optional<ChunkHead> parse_chunk_head(ByteSpan content, std::uint64_t length) {
  ByteReader reader(content);
  ChunkHead head;
  head.start = reader.get<std::uint64_t>();
  head.end = reader.get<std::uint64_t>();
  head.size = reader.get<std::uint64_t>();
  head.crc = reader.get<std::uint32_t>();
  head.compression = std::string(reader.text());
  head.packed_size = reader.get<std::uint64_t>();
  head.data_at = reader.position();
  if (!reader.ok() || head.start > head.end || length < head.data_at ||
      head.packed_size != length - head.data_at)
    return std::nullopt;
  return head;
}

void Registry::add_schema(ByteSpan content) {
  ByteReader reader(content);
  const auto id = reader.get<std::uint16_t>();
  std::string name(reader.text());
  std::string encoding(reader.text());
  if (reader.ok()) schemas_[id] = {std::move(name), std::move(encoding)};
}

void Registry::add_channel(ByteSpan content) {
  ByteReader reader(content);
  const auto id = reader.get<std::uint16_t>();
  const auto schema = reader.get<std::uint16_t>();
  auto channel = std::make_shared<MessageChannel>();
  channel->topic = std::string(reader.text());
  const std::string encoding(reader.text());
  if (!reader.ok() || channels_.count(id) > 0) return;
  channel->serialization = serialization_of(encoding);
  channel->readable = encoding == "cdr" || encoding == "ros1";
  const auto found = schemas_.find(schema);
  if (found != schemas_.end()) channel->type = found->second.first;
  channels_[id] = std::move(channel);
}

std::shared_ptr<const MessageChannel> Registry::find(std::uint16_t id) const {
  const auto found = channels_.find(id);
  return found == channels_.end() ? nullptr : found->second;
}

void Registry::save(BinaryWriter& writer) const {
  writer.put(static_cast<std::uint64_t>(schemas_.size()));
  for (const auto& [id, schema] : schemas_) {
    writer.put(id);
    writer.put(schema.first);
    writer.put(schema.second);
  }
  writer.put(static_cast<std::uint64_t>(channels_.size()));
  for (const auto& [id, channel] : channels_) {
    writer.put(id);
    put_channel(writer, *channel);
  }
}

void Registry::load(BinaryReader& reader) {
  schemas_.clear();
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
    auto& schema = schemas_[reader.get<std::uint16_t>()];
    schema.first = reader.get_string();
    schema.second = reader.get_string();
  }
  channels_.clear();
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
    auto& channel = channels_[reader.get<std::uint16_t>()];
    channel = get_channel(reader);
  }
}

Walker::Walker(ByteSource& file, Registry& registry, Log& log)
    : file_(file), registry_(registry), log_(log), data_end_(file.size()) {
  try {
    read_summary();
  } catch (const ReadError& error) {
    // What comes before it may be readable; where it is not, the reading says so.
    log_.warn("recording.mended", std::string(error.what()) + ": reading without the index");
  }
}

void Walker::warn(const std::string& key, std::uint64_t offset, const std::string& what) {
  log_.warn(key, file_.name() + ": at byte " + std::to_string(offset) + ": " + what);
}

void Walker::read_summary() {
  const std::uint64_t size = file_.size();
  if (size < 2 * sizeof(kMagic) + kFooterRecord) return;
  const std::uint64_t footer_at = size - sizeof(kMagic) - kFooterRecord;
  file_.read(footer_at, kFooterRecord + sizeof(kMagic), scratch_);
  if (scratch_.size() != kFooterRecord + sizeof(kMagic)) return;
  has_end_ = std::equal(std::begin(kMagic), std::end(kMagic), scratch_.begin() + kFooterRecord);
  if (!has_end_ || scratch_[0] != kFooter) return;
  ByteReader footer(ByteSpan(scratch_).subspan(kRecordHead));
  const auto start = footer.get<std::uint64_t>();
  (void)footer.get<std::uint64_t>();  // summary offsets
  const auto crc = footer.get<std::uint32_t>();
  if (start < sizeof(kMagic) || start > footer_at || footer_at - start > kLongestSummary) return;
  std::vector<std::uint8_t> summary;
  file_.read(start, footer_at + kFooterRecord - 4 - start, summary);
  if (crc != 0 && crc32_of(summary) != crc) {
    warn("recording.mended", start, "the index is damaged; reading without it, nothing is lost");
    return;
  }
  data_end_ = start;
  has_summary_ = true;
  take_summary(ByteSpan(summary).first(static_cast<std::size_t>(footer_at - start)));
}

void Walker::take_summary(ByteSpan summary) {
  ByteReader reader(summary);
  std::vector<Block> blocks;
  while (reader.remaining() >= kRecordHead) {
    const auto opcode = reader.get<std::uint8_t>();
    const ByteSpan content = reader.take(reader.get<std::uint64_t>());
    if (!reader.ok()) break;
    ByteReader record(content);
    if (opcode == kSchema) {
      registry_.add_schema(content);
    } else if (opcode == kChannel) {
      registry_.add_channel(content);
    } else if (opcode == kMetadataIndex) {
      const auto offset = record.get<std::uint64_t>();
      const auto head = head_at(offset);
      if (!head || head->opcode != kMetadata || head->length > kLongestSmallRecord) continue;
      file_.read(offset + kRecordHead, head->length, scratch_);
      take_metadata(scratch_);
    } else if (opcode == kChunkIndex) {
      Block block;
      block.start = record.get<std::uint64_t>();
      block.end = record.get<std::uint64_t>();
      block.offset = record.get<std::uint64_t>();
      const auto whole = record.get<std::uint64_t>();
      block.length = whole - kRecordHead;
      if (!record.ok() || whole < kRecordHead || block.offset >= data_end_ ||
          whole > data_end_ - block.offset)
        continue;
      known_chunks_.insert(block.offset);
      note_channels(record, block);
      blocks.push_back(block);
    }
  }
  // The index is needed only where the order of the file is not the order of time.
  const auto earlier = [](const Block& a, const Block& b) {
    return std::pair(a.start, a.offset) < std::pair(b.start, b.offset);
  };
  const auto before = [](const Block& a, const Block& b) { return a.offset < b.offset; };
  std::sort(blocks.begin(), blocks.end(), before);
  if (std::is_sorted(blocks.begin(), blocks.end(), earlier)) return;
  std::sort(blocks.begin(), blocks.end(), earlier);
  plan_ = std::move(blocks);
}

void Walker::note_channels(ByteReader& record, const Block& block) {
  ByteReader indexes(record.take(record.get<std::uint32_t>()));
  while (record.ok() && indexes.remaining() >= 10) {
    const auto channel = indexes.get<std::uint16_t>();
    (void)indexes.get<std::uint64_t>();
    std::vector<Block>& chunks = chunks_of_[channel];
    if (chunks.size() < kChunksOfChannel) chunks.push_back(block);
  }
}

std::vector<Block> Walker::chunks_of(std::uint16_t channel) const {
  const auto found = chunks_of_.find(channel);
  return found == chunks_of_.end() ? std::vector<Block>() : found->second;
}

std::optional<Walker::Head> Walker::head_at(std::uint64_t offset) {
  std::uint8_t raw[kRecordHead];
  if (file_.read(offset, raw, kRecordHead) != kRecordHead) return std::nullopt;
  ByteReader reader(raw);
  Head head;
  head.opcode = reader.get<std::uint8_t>();
  head.length = reader.get<std::uint64_t>();
  return head;
}

bool Walker::plausible(const Head& head, std::uint64_t offset) const {
  if (head.opcode == 0 || (head.opcode > kDataEnd && head.opcode < 0x80)) return false;
  if (offset + kRecordHead > file_.size() || head.length > file_.size() - offset - kRecordHead)
    return false;
  if (head.opcode == kDataEnd)
    return head.length == 4 && (!has_summary_ || offset + kRecordHead + 4 == data_end_);
  if (head.opcode == kFooter) return head.length == kFooterContent;
  return head.opcode != kMessage || head.length >= 22;
}

// The block of the record at `offset`; nothing if it is none or is not in order.
std::optional<Block> Walker::block_at(std::uint64_t offset, const Head& head) {
  Block block;
  block.offset = offset;
  block.length = head.length;
  block.is_chunk = head.opcode == kChunk;
  block.cut = head.length > file_.size() - offset - kRecordHead;
  file_.read(offset + kRecordHead, std::min<std::uint64_t>(head.length, kChunkHeadBytes), scratch_);
  if (block.is_chunk) {
    const auto chunk = parse_chunk_head(scratch_, head.length);
    if (!chunk) return std::nullopt;
    block.start = chunk->start;
    block.end = chunk->end;
  } else {
    ByteReader message(scratch_);
    (void)message.get<std::uint16_t>();
    (void)message.get<std::uint32_t>();
    block.start = block.end = message.get<std::uint64_t>();
    if (!message.ok()) return std::nullopt;
  }
  return block;
}

void Walker::take_metadata(ByteSpan content) {
  ByteReader reader(content);
  if (reader.text() == kSensorMetadata) sensor_ = parse_text_map(reader);
}

void Walker::take_small_record(const Head& head) {
  const bool wanted = head.opcode == kHeader || head.opcode == kSchema || head.opcode == kChannel ||
                      head.opcode == kMetadata;
  if (!wanted || head.length > kLongestSmallRecord) return;
  file_.read(position_ + kRecordHead, head.length, scratch_);
  if (head.opcode == kSchema) registry_.add_schema(scratch_);
  if (head.opcode == kChannel) registry_.add_channel(scratch_);
  if (head.opcode == kMetadata) take_metadata(scratch_);
  if (head.opcode == kHeader) profile_ = std::string(ByteReader(scratch_).text()).substr(0, 32);
}

std::optional<Block> Walker::next_planned() {
  if (profile_.empty() && planned_ == 0) {
    const auto head = head_at(position_);
    if (head && head->opcode == kHeader && plausible(*head, position_)) take_small_record(*head);
  }
  while (planned_ < plan_.size()) {
    const Block& block = plan_[planned_++];
    position_ = block.offset;
    const auto head = head_at(block.offset);
    if (head && head->opcode == kChunk && head->length == block.length) {
      if (const auto found = block_at(block.offset, *head)) return found;
    }
    warn(key_of(Finding::kDamage), block.offset,
         "the chunk that the index names is damaged; left out");
  }
  return std::nullopt;
}

std::optional<Block> Walker::next() {
  if (!plan_.empty()) return next_planned();
  while (!ended_) {
    const auto head = head_at(position_);
    if (!head) {
      warn("recording.unfinished", position_,
           "the recording was not closed (it has no index); read to its end");
      ended_ = true;
      break;
    }
    const bool is_block = head->opcode == kChunk || head->opcode == kMessage;
    if (head->opcode == kChunk && head->length > file_.size() - position_ - kRecordHead) {
      // A chunk that is in order but for its missing end is the last of a truncated file.
      if (const auto block = block_at(position_, *head)) {
        warn(key_of(Finding::kCutOff), position_, "the file ends inside this chunk");
        ended_ = true;
        return block;
      }
    }
    if (!plausible(*head, position_)) {
      resynchronise("expected a record");
      continue;
    }
    if (head->opcode == kDataEnd || head->opcode == kFooter) {
      if (!has_end_)
        warn("recording.unfinished", file_.size(),
             "the file ends before the end of its index; no message is lost");
      ended_ = true;
      break;
    }
    if (!is_block) {
      take_small_record(*head);
      search_from_ = position_ + 1;
      position_ += kRecordHead + head->length;
      continue;
    }
    const auto block = block_at(position_, *head);
    if (!block) {
      resynchronise("expected a chunk");
      continue;
    }
    search_from_ = block->is_chunk ? position_ + kRecordHead + head->length : position_ + 1;
    position_ += kRecordHead + head->length;
    return block;
  }
  return std::nullopt;
}

std::optional<Block> Walker::at(std::uint64_t offset) {
  const auto head = head_at(offset);
  if (!head || (head->opcode != kChunk && head->opcode != kMessage)) return std::nullopt;
  return block_at(offset, *head);
}

void Walker::save(BinaryWriter& writer) const {
  writer.put(static_cast<std::uint64_t>(plan_.size()));
  for (const std::uint64_t number :
       {static_cast<std::uint64_t>(planned_), position_, search_from_, last_search_})
    writer.put(number);
  writer.put(ended_);
  writer.put(profile_);
}

void Walker::load(BinaryReader& reader) {
  // An index that the disk kept then and gives now, or the other way round, means another order.
  if (reader.get<std::uint64_t>() != plan_.size())
    throw InputError(file_.name(), "", "its index is not what it was when the run was begun");
  planned_ = static_cast<std::size_t>(reader.get<std::uint64_t>());
  for (std::uint64_t* number : {&position_, &search_from_, &last_search_})
    *number = reader.get<std::uint64_t>();
  ended_ = reader.get<bool>();
  profile_ = reader.get_string();
}

// A message outside of chunks counts if its channel is known and a record follows it.
bool Walker::is_intact_message(std::uint64_t offset, const Head& head) {
  std::uint8_t id[2];
  if (file_.read(offset + kRecordHead, id, 2) != 2) return false;
  if (registry_.find(static_cast<std::uint16_t>(id[0] | (id[1] << 8))) == nullptr) return false;
  const std::uint64_t after = offset + kRecordHead + head.length;
  if (after == file_.size()) return true;
  const auto following = head_at(after);
  return following && plausible(*following, after);
}

void Walker::resynchronise(const std::string& what) {
  const std::uint64_t lost_at = position_;
  std::uint64_t at = std::max<std::uint64_t>(search_from_, sizeof(kMagic));
  if (at <= last_search_) at = last_search_ + 1;  // never the same place twice
  const auto known = known_chunks_.lower_bound(at);
  const std::uint64_t until = known == known_chunks_.end() ? data_end_ : *known;
  std::vector<std::uint8_t> window;
  for (; at < until; at += kSearchWindow) {
    file_.read(at, std::min<std::uint64_t>(kSearchWindow, until - at), window);
    for (std::size_t i = 0; i < window.size(); ++i) {
      if (window[i] != kChunk && window[i] != kMessage) continue;
      const std::uint64_t offset = at + i;
      const auto head = head_at(offset);
      if (!head || !plausible(*head, offset)) continue;
      const bool intact = head->opcode == kChunk ? block_at(offset, *head).has_value()
                                                 : is_intact_message(offset, *head);
      if (!intact) continue;
      resume_at(lost_at, offset, what);
      return;
    }
  }
  resume_at(lost_at, until, what);
}

void Walker::resume_at(std::uint64_t lost_at, std::uint64_t offset, const std::string& what) {
  position_ = last_search_ = offset;
  search_from_ = offset + 1;
  const bool found = offset < data_end_;
  const std::string going_on =
      found ? "; going on at byte " + std::to_string(offset) : "; nothing more was found behind it";
  warn(found || has_end_ ? key_of(Finding::kDamage) : key_of(Finding::kCutOff), lost_at,
       what + going_on);
  if (!found) ended_ = true;
}

}  // namespace understory::mcap
