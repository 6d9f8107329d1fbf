#pragma once

#include <memory>

#include "understory/recording/bags/byte_source.h"
#include "understory/recording/messages/message_source.h"

namespace understory {

// Reads the messages of an MCAP file: with or without chunks (none, lz4, zstd), index and summary,
// also truncated or damaged ones. A chunk whose checksum is wrong is left out with a warning; where
// the structure itself is damaged, the next intact record is looked for. Chunks that overlap in
// time are merged by log time.
// Throws InputError if the magic at the start is missing. The log must outlive the source.
[[nodiscard]] std::unique_ptr<MessageSource> read_mcap(std::unique_ptr<ByteSource> file, Log& log);

}  // namespace understory
