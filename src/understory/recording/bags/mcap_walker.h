#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "understory/recording/bags/byte_source.h"
#include "understory/recording/bags/mcap_format.h"
#include "understory/recording/messages/message_source.h"
#include "understory/util/files/binary_io.h"

namespace understory::mcap {

// A chunk, or one message outside of any chunk.
struct Block {
  std::uint64_t offset = 0;  // of the record
  std::uint64_t length = 0;  // of the record's content, as its head says
  std::uint64_t start = 0;   // log times
  std::uint64_t end = 0;
  bool is_chunk = true;
  bool cut = false;  // the file ends inside it
};

// What a chunk record says before its data.
struct ChunkHead {
  std::uint64_t start = 0;
  std::uint64_t end = 0;
  std::uint64_t size = 0;  // unpacked
  std::uint32_t crc = 0;   // of the unpacked records, 0 = none
  std::string compression;
  std::uint64_t packed_size = 0;
  std::size_t data_at = 0;  // of the data in the content
};
// Nothing if the bytes cannot be the head of a chunk record of that length.
[[nodiscard]] std::optional<ChunkHead> parse_chunk_head(ByteSpan content, std::uint64_t length);

using Channels = std::map<std::uint16_t, std::shared_ptr<const MessageChannel>>;

// The schema and channel records seen so far.
class Registry {
 public:
  void add_schema(ByteSpan content);
  void add_channel(ByteSpan content);
  [[nodiscard]] std::shared_ptr<const MessageChannel> find(std::uint16_t id) const;
  [[nodiscard]] const Channels& channels() const { return channels_; }
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  std::map<std::uint16_t, std::pair<std::string, std::string>> schemas_;  // name, encoding
  Channels channels_;
};

// Finds one block after the other, in the order of the file. Where that is not the order of time
// and the file has an intact index, in the order of that. After damage it looks for the next record
// that makes sense.
class Walker {
 public:
  Walker(ByteSource& file, Registry& registry, Log& log);

  [[nodiscard]] std::optional<Block> next();
  // The block that begins at a place of the file; nothing if none does.
  [[nodiscard]] std::optional<Block> at(std::uint64_t offset);
  // Where the walk stands, and back to there.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);
  // The first chunks that hold messages of a channel, as the index knows them.
  [[nodiscard]] std::vector<Block> chunks_of(std::uint16_t channel) const;
  [[nodiscard]] std::uint64_t position() const { return position_; }
  [[nodiscard]] const std::string& profile() const { return profile_; }
  [[nodiscard]] const std::map<std::string, std::string>& sensor() const { return sensor_; }

 private:
  struct Head {
    std::uint8_t opcode = 0;
    std::uint64_t length = 0;
  };

  void read_summary();
  void take_summary(ByteSpan summary);
  void note_channels(ByteReader& record, const Block& block);
  [[nodiscard]] std::optional<Block> next_planned();
  [[nodiscard]] std::optional<Head> head_at(std::uint64_t offset);
  [[nodiscard]] bool plausible(const Head& head, std::uint64_t offset) const;
  [[nodiscard]] std::optional<Block> block_at(std::uint64_t offset, const Head& head);
  [[nodiscard]] bool is_intact_message(std::uint64_t offset, const Head& head);
  void take_small_record(const Head& head);
  void take_metadata(ByteSpan content);
  // Moves to the next record that makes sense, or to the end.
  void resynchronise(const std::string& what);
  void resume_at(std::uint64_t lost_at, std::uint64_t offset, const std::string& what);
  void warn(const std::string& key, std::uint64_t offset, const std::string& what);

  ByteSource& file_;
  Registry& registry_;
  Log& log_;
  std::uint64_t position_ = sizeof(kMagic);
  std::uint64_t data_end_ = 0;                  // start of the summary, or the end of the file
  std::uint64_t search_from_ = sizeof(kMagic);  // behind the last record known to be intact
  std::uint64_t last_search_ = 0;               // where the last search ended
  bool ended_ = false;
  bool has_summary_ = false;
  bool has_end_ = false;                  // the magic at the end
  std::set<std::uint64_t> known_chunks_;  // from the index
  std::map<std::uint16_t, std::vector<Block>> chunks_of_;
  std::vector<Block> plan_;  // blocks in the order of time, if that differs
  std::size_t planned_ = 0;
  std::string profile_;
  std::map<std::string, std::string> sensor_;
  std::vector<std::uint8_t> scratch_;
};

}  // namespace understory::mcap
