#include "understory/output/copc/chunk_table.h"

#include <gtest/gtest.h>

#include <cstring>
#include <sstream>

#include "understory/output/clouds/las_stream.h"

namespace understory {
namespace {

// LASzip writes the table of a file with one chunk of variable size: ours is the same. Tables of
// many chunks are read by LASzip in copc_writer_test.
TEST(ChunkTableTest, OneChunkIsAsLaszipWritesIt) {
  for (const std::uint32_t count : {1U, 2U, 300U, 70'000U}) {
    std::ostringstream stream(std::ios::binary);
    LasStream las(stream, "memory", {}, {true, true});
    for (std::uint32_t i = 0; i < count; ++i) {
      LasPointSteps point;
      point.x = static_cast<std::int32_t>(i * 2'654'435'761U);
      point.y = static_cast<std::int32_t>(i % 17);
      point.gps_time = 0.001 * i;
      las.add(point);
    }
    las.close();
    const std::string file = stream.str();
    std::uint32_t points_at = 0;
    std::memcpy(&points_at, file.data() + 96, sizeof points_at);
    std::int64_t table_at = 0;
    std::memcpy(&table_at, file.data() + points_at, sizeof table_at);
    const auto bytes = static_cast<std::uint32_t>(table_at - points_at - sizeof table_at);
    EXPECT_EQ(laz_chunk_table({{count, bytes}}), file.substr(static_cast<std::size_t>(table_at)))
        << count << " points";
  }
}

TEST(ChunkTableTest, NoChunkLeavesVersionAndNumber) {
  EXPECT_EQ(laz_chunk_table({}), std::string(8, '\0'));
}

}  // namespace
}  // namespace understory
