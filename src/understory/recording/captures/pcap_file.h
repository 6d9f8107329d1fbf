#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "understory/recording/bags/byte_source.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/log.h"
#include "understory/util/time.h"

namespace understory {

// One captured frame; the bytes are valid until the next call.
struct CapturedFrame {
  TimeNs stamp = 0;
  int link_type = 0;  // LINKTYPE_ number of the pcap format
  ByteSpan bytes;
  bool truncated = false;      // fewer bytes than were on the wire
  std::uint64_t position = 0;  // of its record in the file
};

// Reads pcap (micro- and nanoseconds, both byte orders) and pcapng files. The code is our own,
// because libpcap stops at the first damaged record. This one warns ("recording.damaged") and looks
// for the next record that is followed by another plausible one. Memory is bounded by the largest
// frame (256 KiB). Not thread-safe.
class PcapFile {
 public:
  // Throws InputError if the file does not begin as a capture does.
  PcapFile(std::unique_ptr<ByteSource> source, Log& log);

  [[nodiscard]] bool next(CapturedFrame& frame);
  // Back to the first record, with warnings from now on to `log`.
  void rewind(Log& log);
  // Where the reading stands, and back to there.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);
  [[nodiscard]] double progress() const;
  [[nodiscard]] const std::string& name() const { return source_->name(); }
  [[nodiscard]] bool is_pcapng() const { return pcapng_; }

  // Whether bytes at the start of a file are those of a capture.
  [[nodiscard]] static bool recognise(ByteSpan start);

 private:
  struct Interface {
    int link_type = 0;
    std::uint64_t ticks_per_second = 1'000'000;
    std::int64_t offset_s = 0;
  };
  struct Record {
    TimeNs stamp = 0;
    int link_type = 0;
    std::uint64_t data = 0;  // position
    std::uint32_t captured = 0;
    std::uint32_t original = 0;
    std::uint64_t end = 0;
    bool is_frame = true;  // false: another pcapng block
  };

  void read_header();
  [[nodiscard]] std::optional<Record> record_at(std::uint64_t position);
  [[nodiscard]] std::optional<Record> block_at(std::uint64_t position);
  [[nodiscard]] std::optional<Record> frame_block(std::uint64_t position, std::uint32_t type,
                                                  std::uint64_t end);
  void enter_block(std::uint64_t position, std::uint32_t type, std::uint32_t length);
  [[nodiscard]] bool resynchronise();
  [[nodiscard]] bool plausible(std::uint64_t position);
  [[nodiscard]] bool stamp_is_damaged(const Record& record);
  [[nodiscard]] std::uint32_t u32(std::uint64_t position);
  [[nodiscard]] std::uint16_t u16(std::uint64_t position);

  std::unique_ptr<ByteSource> source_;
  Log* log_;
  bool pcapng_ = false;
  bool swap_ = false;
  bool nanoseconds_ = false;
  int link_type_ = 0;
  std::vector<Interface> interfaces_;
  std::uint64_t first_ = 24;
  std::uint64_t position_ = 24;
  TimeNs last_stamp_ = 0;
  bool has_stamp_ = false;
  std::vector<std::uint8_t> buffer_;
};

}  // namespace understory
