#include "understory/recording/captures/pcap_file.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>

#include "understory/recording/finding.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr std::uint32_t kMicroseconds = 0xA1B2C3D4;
constexpr std::uint32_t kNanoseconds = 0xA1B23C4D;
constexpr std::uint32_t kSectionHeader = 0x0A0D0D0A;
constexpr std::uint32_t kByteOrder = 0x1A2B3C4D;
constexpr std::uint32_t kInterfaceBlock = 1;
constexpr std::uint32_t kSimplePacket = 3;
constexpr std::uint32_t kEnhancedPacket = 6;
constexpr std::uint32_t kLargestPacket = 262'144;
constexpr std::uint32_t kLargestBlock = 16 * 1024 * 1024;
constexpr std::size_t kMostInterfaces = 256;
constexpr const char* kNoPlace = "expected the place where its reading stood";

std::uint32_t swapped(std::uint32_t v) {
  return (v >> 24) | ((v >> 8) & 0xFF00U) | ((v << 8) & 0xFF'0000U) | (v << 24);
}

bool far_apart(TimeNs a, TimeNs b) {
  return std::llabs(a - b) > kNsPerDay;
}

std::uint32_t first_word(ByteSpan bytes) {
  std::uint32_t word = 0;
  if (bytes.size() >= 4) std::memcpy(&word, bytes.data(), 4);
  return word;
}

}  // namespace

bool PcapFile::recognise(ByteSpan start) {
  const std::uint32_t word = first_word(start);
  return word == kMicroseconds || word == kNanoseconds || word == kSectionHeader ||
         swapped(word) == kMicroseconds || swapped(word) == kNanoseconds;
}

PcapFile::PcapFile(std::unique_ptr<ByteSource> source, Log& log)
    : source_(std::move(source)), log_(&log) {
  read_header();
}

std::uint32_t PcapFile::u32(std::uint64_t position) {
  std::uint32_t value = 0;
  if (source_->read(position, reinterpret_cast<std::uint8_t*>(&value), 4) != 4) return 0;
  return swap_ ? swapped(value) : value;
}

std::uint16_t PcapFile::u16(std::uint64_t position) {
  std::uint16_t value = 0;
  if (source_->read(position, reinterpret_cast<std::uint8_t*>(&value), 2) != 2) return 0;
  return swap_ ? static_cast<std::uint16_t>((value << 8) | (value >> 8)) : value;
}

void PcapFile::read_header() {
  std::array<std::uint8_t, 4> magic{};
  const std::size_t got = source_->read(0, magic.data(), magic.size());
  if (got < magic.size() || !recognise(magic))
    throw InputError(name(), "byte 0", "expected a capture (pcap or pcapng)");
  const std::uint32_t word = first_word(magic);
  pcapng_ = word == kSectionHeader;
  if (pcapng_) {
    first_ = position_ = 0;
    return;
  }
  swap_ = word != kMicroseconds && word != kNanoseconds;
  nanoseconds_ = word == kNanoseconds || swapped(word) == kNanoseconds;
  link_type_ = static_cast<int>(u32(20) & 0xFFFFU);
}

void PcapFile::rewind(Log& log) {
  log_ = &log;
  position_ = first_;
  has_stamp_ = false;
  if (pcapng_) interfaces_.clear();
}

void PcapFile::save(BinaryWriter& writer) const {
  writer.put(position_);
  writer.put(last_stamp_);
  writer.put(has_stamp_);
  writer.put(swap_);
  writer.put(interfaces_);
}

void PcapFile::load(BinaryReader& reader) {
  position_ = reader.get<std::uint64_t>();
  last_stamp_ = reader.get<TimeNs>();
  has_stamp_ = reader.get<bool>();
  swap_ = reader.get<bool>();
  interfaces_ = reader.get_vector<Interface>();
  for (const Interface& interface : interfaces_)
    if (interface.ticks_per_second == 0) throw InputError(name(), "", kNoPlace);
}

double PcapFile::progress() const {
  const std::uint64_t size = source_->size();
  return size == 0 ? 1.0 : static_cast<double>(position_) / static_cast<double>(size);
}

// The record at a position if its header makes sense.
std::optional<PcapFile::Record> PcapFile::record_at(std::uint64_t position) {
  if (pcapng_) return block_at(position);
  if (position + 16 > source_->size()) return std::nullopt;
  const std::uint32_t fraction = u32(position + 4);
  Record record;
  record.stamp = static_cast<TimeNs>(u32(position)) * kNsPerSecond +
                 static_cast<TimeNs>(fraction) * (nanoseconds_ ? 1 : 1000);
  record.link_type = link_type_;
  record.data = position + 16;
  record.captured = u32(position + 8);
  record.original = u32(position + 12);
  record.end = record.data + record.captured;
  if (fraction >= (nanoseconds_ ? 1'000'000'000U : 1'000'000U) || record.captured == 0 ||
      record.captured > kLargestPacket || record.original < record.captured ||
      record.original > 4 * kLargestPacket)
    return std::nullopt;
  return record;
}

std::optional<PcapFile::Record> PcapFile::block_at(std::uint64_t position) {
  if (position + 12 > source_->size()) return std::nullopt;
  const std::uint32_t type = u32(position);
  if (type == kSectionHeader) {
    // The byte order may change with each section.
    std::uint32_t order = 0;
    if (source_->read(position + 8, reinterpret_cast<std::uint8_t*>(&order), 4) != 4 ||
        (order != kByteOrder && swapped(order) != kByteOrder))
      return std::nullopt;
    swap_ = order != kByteOrder;
  }
  const std::uint32_t length = u32(position + 4);
  if (length < 12 || length % 4 != 0 || length > kLargestBlock) return std::nullopt;
  const std::uint64_t end = position + length;
  if (end <= source_->size() && u32(end - 4) != length) return std::nullopt;
  if (type == kEnhancedPacket || type == kSimplePacket) return frame_block(position, type, end);
  if (end <= source_->size()) enter_block(position, type, length);
  Record record;
  record.end = end;
  record.is_frame = false;
  return record;
}

std::optional<PcapFile::Record> PcapFile::frame_block(std::uint64_t position, std::uint32_t type,
                                                      std::uint64_t end) {
  Record record;
  record.end = end;
  if (type == kSimplePacket) {
    record.original = u32(position + 8);
    record.data = position + 12;
    record.captured =
        static_cast<std::uint32_t>(std::min<std::uint64_t>(record.original, end - 4 - record.data));
    record.stamp = last_stamp_;
    if (!interfaces_.empty()) record.link_type = interfaces_.front().link_type;
  } else {
    if (end < position + 32) return std::nullopt;
    const std::uint32_t which = u32(position + 8);
    const Interface interface = which < interfaces_.size() ? interfaces_[which] : Interface{1};
    const std::uint64_t ticks =
        (static_cast<std::uint64_t>(u32(position + 12)) << 32) | u32(position + 16);
    const std::uint64_t seconds = ticks / interface.ticks_per_second;
    const std::uint64_t rest = ticks % interface.ticks_per_second;
    if (seconds > 8'000'000'000U) return std::nullopt;
    record.link_type = interface.link_type;
    record.stamp = (static_cast<TimeNs>(seconds) + interface.offset_s) * kNsPerSecond +
                   static_cast<TimeNs>(static_cast<long double>(rest) * 1e9L /
                                       static_cast<long double>(interface.ticks_per_second));
    record.captured = u32(position + 20);
    record.original = u32(position + 24);
    record.data = position + 28;
  }
  if (record.captured == 0 || record.captured > kLargestPacket ||
      record.data + record.captured + 4 > end)
    return std::nullopt;
  return record;
}

// Sections and interface descriptions change how what follows is read.
void PcapFile::enter_block(std::uint64_t position, std::uint32_t type, std::uint32_t length) {
  if (type == kSectionHeader) interfaces_.clear();
  if (type != kInterfaceBlock || length < 20 || interfaces_.size() >= kMostInterfaces) return;
  Interface interface;
  interface.link_type = u16(position + 8);
  std::uint64_t option = position + 16;
  const std::uint64_t end = position + length - 4;
  while (option + 4 <= end) {
    const std::uint16_t code = u16(option);
    const std::uint16_t size = u16(option + 2);
    if (code == 0 || option + 4 + size > end) break;
    if (code == 9 && size == 1) {  // if_tsresol
      std::uint8_t resolution = 6;
      (void)source_->read(option + 4, &resolution, 1);
      const int power = resolution & 0x7F;
      const bool binary = (resolution & 0x80) != 0;
      if (power <= (binary ? 40 : 12)) {
        interface.ticks_per_second = 1;
        for (int i = 0; i < power; ++i)
          interface.ticks_per_second *= binary ? 2 : 10;
      }
    }
    if (code == 14 && size == 8) {  // if_tsoffset
      const std::uint64_t offset =
          swap_ ? (static_cast<std::uint64_t>(u32(option + 4)) << 32) | u32(option + 8)
                : (static_cast<std::uint64_t>(u32(option + 8)) << 32) | u32(option + 4);
      const auto seconds = static_cast<std::int64_t>(offset);
      if (std::llabs(seconds) < 1'000'000'000) interface.offset_s = seconds;
    }
    option += 4 + ((size + 3U) & ~3U);
  }
  interfaces_.push_back(interface);
}

// A record that is whole and followed by another, at most a day later, or by the end.
bool PcapFile::plausible(std::uint64_t position) {
  // Interfaces met while trying out positions must not be kept.
  const std::vector<Interface> interfaces = interfaces_;
  const bool swap = swap_;
  const auto record = record_at(position);
  const bool whole = record && record->end <= source_->size();
  const bool last = whole && record->end == source_->size();
  const auto after = whole && !last ? record_at(record->end) : std::nullopt;
  interfaces_ = interfaces;
  swap_ = swap;
  if (!after) return last;
  return !record->is_frame || !after->is_frame || !far_apart(record->stamp, after->stamp);
}

bool PcapFile::resynchronise() {
  const std::uint64_t from = position_;
  const std::uint64_t step = pcapng_ ? 4 : 1;
  for (position_ += step; position_ + 16 <= source_->size(); position_ += step) {
    if (!plausible(position_)) continue;
    report_finding(*log_, Finding::kDamage,
                   name() + ": at byte " + std::to_string(from) +
                       ": damaged record; went on at byte " + std::to_string(position_));
    return true;
  }
  report_finding(*log_, Finding::kCutOff,
                 name() + ": at byte " + std::to_string(from) + ": the last record is not whole");
  position_ = source_->size();
  return false;
}

// A stamp far from the last one, to which the record after it returns.
bool PcapFile::stamp_is_damaged(const Record& record) {
  if (!has_stamp_ || !far_apart(record.stamp, last_stamp_)) return false;
  const auto after = record.end < source_->size() ? record_at(record.end) : std::nullopt;
  return after && after->is_frame && !far_apart(after->stamp, last_stamp_);
}

bool PcapFile::next(CapturedFrame& frame) {
  while (position_ < source_->size()) {
    const std::uint64_t begin = position_;
    const auto record = record_at(begin);
    if (!record || record->end > source_->size()) {
      if (resynchronise()) continue;
      return false;
    }
    position_ = record->end;
    if (!record->is_frame) continue;
    if (stamp_is_damaged(*record)) {
      report_finding(*log_, Finding::kDamage,
                     name() + ": at byte " + std::to_string(begin) +
                         ": a record with a time days off, left out");
      continue;
    }
    source_->read(record->data, record->captured, buffer_);
    last_stamp_ = record->stamp;
    has_stamp_ = true;
    frame.stamp = record->stamp;
    frame.link_type = record->link_type;
    frame.truncated = record->captured < record->original;
    frame.position = begin;
    frame.bytes = ByteSpan(buffer_.data(), buffer_.size());
    return true;
  }
  return false;
}

}  // namespace understory
