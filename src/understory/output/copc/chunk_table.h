#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace understory {

// One chunk of a LAZ file whose chunks have variable sizes.
struct LazChunk {
  std::uint32_t points = 0;
  std::uint32_t bytes = 0;
};

// The table of chunks as it stands behind the points of a LAZ file: version, number of chunks, then
// points and bytes of each. They are differences to the chunk before, by the arithmetic coder and
// the integer compressor of LASzip (M. Isenburg, "LASzip: lossless compression of LiDAR data",
// 2013; A. Said, HPL-2004-76). LASzip's interface writes no table for chunks of other streams.
[[nodiscard]] std::string laz_chunk_table(const std::vector<LazChunk>& chunks);

}  // namespace understory
