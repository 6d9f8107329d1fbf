#pragma once

#include "fuzz_input.h"
#include "understory/recording/clouds/cloud_table.h"
#include "understory/recording/messages/point_cloud.h"
#include "understory/util/error.h"

namespace understory {

// Reads the bytes as a cloud by `read_table` and converts them to a scan.
template <typename ReadTable>
int fuzz_cloud(const std::uint8_t* data, std::size_t size, const ReadTable& read_table) {
  Log log;
  try {
    const auto file = fuzz_source(data, size);
    const CloudTable table = read_table(*file, log);
    const PointCloud2Message message = table.message(0);
    const auto layout = CloudLayout::find(message);
    if (!layout) return 0;
    const auto convention = detect_point_times(layout->time_field(), layout->time_type(),
                                               {measure_times(message, *layout, 0)}, {});
    (void)convert_cloud(message, *layout, convention);
  } catch (const InputError&) {
  }
  return 0;
}

}  // namespace understory
