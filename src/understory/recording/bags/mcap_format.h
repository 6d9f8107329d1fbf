#pragma once

#include <cstdint>

namespace understory::mcap {

// The MCAP container, version 0: a magic, records (opcode, 64-bit length, content), a magic.
inline constexpr std::uint8_t kMagic[8] = {0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};
inline constexpr std::size_t kRecordHead = 9;  // opcode and length
inline constexpr std::size_t kFooterContent = 20;

// Kinds of records of MCAP (mcap.dev/spec, "Records").
enum Opcode : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kAttachment = 0x09,
  kAttachmentIndex = 0x0A,
  kStatistics = 0x0B,
  kMetadata = 0x0C,
  kMetadataIndex = 0x0D,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

// The metadata record in which the writer keeps what has no place in a ROS message.
inline constexpr const char* kSensorMetadata = "understory.sensor";

}  // namespace understory::mcap
