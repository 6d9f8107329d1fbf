#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "understory/recording/bytes.h"

namespace understory {

// The longest block that is unpacked: damaged lengths must not take the memory.
inline constexpr std::uint64_t kLongestBlock = 512ULL << 20;

// Compresses one block. `method` is "zstd" or "lz4" (LZ4 frame format).
[[nodiscard]] std::vector<std::uint8_t> compress(ByteSpan bytes, std::string_view method,
                                                 int zstd_level);

// Unpacks one block of "zstd", "lz4" (frame format) or "bz2" into `out`, at most `limit` bytes (and
// never more than kLongestBlock). Returns what went wrong, empty if nothing; `out` holds what could
// be unpacked before that. Memory grows with what really comes out, not with what is promised.
[[nodiscard]] std::string decompress(ByteSpan packed, std::string_view method, std::uint64_t limit,
                                     std::vector<std::uint8_t>& out);

}  // namespace understory
