// dump_scans RECORDING [METADATA]: the scans of a recording on stdout, for tests in Python. Each
// scan is its stamp (int64), its number of points (uint64) and the points as they lie in memory.

#include <cstdint>
#include <cstdio>
#include <exception>

#include "understory/recording/recording.h"

int main(int count, char** arguments) {
  using namespace understory;
  static_assert(sizeof(ScanPoint) == 24, "scans.py reads this layout");
  if (count != 2 && count != 3) return 2;
  OpenOptions options;
  if (count == 3) options.metadata_file = arguments[2];
  try {
    Log log([](LogLevel, const std::string& text) { std::fprintf(stderr, "%s\n", text.c_str()); });
    const auto recording = open_recording(arguments[1], options, log);
    while (const auto event = recording->next()) {
      const auto* scan = std::get_if<ScanPtr>(&*event);
      if (scan == nullptr) continue;
      const std::int64_t stamp = (*scan)->stamp;
      const std::uint64_t points = (*scan)->points.size();
      std::fwrite(&stamp, sizeof(stamp), 1, stdout);
      std::fwrite(&points, sizeof(points), 1, stdout);
      std::fwrite((*scan)->points.data(), sizeof(ScanPoint), points, stdout);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
