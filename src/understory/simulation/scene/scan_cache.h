#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "understory/simulation/sensors/scanner.h"

namespace understory {

// Keeps what the beams of each scan of one site and seed measured (ranges in steps, intensities,
// returns of stems) in one file. So a site is cast only once, for about a fifth of a megabyte a
// scan of an OS0-128. What comes back is bit for bit what went in.
//
// Several processes may use one file: the first one writes, the others read what was there when
// they opened it. A torn end (kill -9, full disk) is cut off by the next writer. A file by that
// name that does not begin as this program's do is left as it is. Trouble with the file is never
// an error: then scans are cast. Not thread-safe.
class ScanCache {
 public:
  // `key` names the site with all its settings. Ranges are whole multiples of range_step_m.
  // Makes the folder if need be; throws OutputError if that fails.
  ScanCache(const std::string& folder, std::uint64_t key, double range_step_m);
  ~ScanCache();
  ScanCache(const ScanCache&) = delete;
  ScanCache& operator=(const ScanCache&) = delete;

  // Whether ranges of that step and reach can be kept (one return a beam, 16 bits a range).
  [[nodiscard]] static bool fits(const LidarConfig& config);

  [[nodiscard]] std::optional<ScanReadings> find(std::int64_t scan) const;
  void store(std::int64_t scan, const ScanReadings& readings);

  // The first and the last scan that are kept, to be compared with what the program casts today.
  [[nodiscard]] std::optional<std::pair<std::int64_t, std::int64_t>> span() const;
  // Forgets everything: what was kept is not what the program casts.
  void clear();

  [[nodiscard]] const std::string& path() const { return path_; }
  // Whether the file is of another program: nothing is kept then.
  [[nodiscard]] bool is_foreign() const { return foreign_; }

 private:
  void read_index();
  void add(std::int64_t scan, std::int64_t offset, std::uint32_t size, std::uint64_t checksum);

  struct Place {
    std::int64_t scan = 0;
    std::int64_t offset = 0;  // of the packed bytes
    std::uint32_t size = 0;
    std::uint64_t checksum = 0;
  };
  [[nodiscard]] std::vector<Place>::const_iterator place_of(std::int64_t scan) const;
  std::string path_;
  float step_m_;
  int file_ = -1;
  bool writable_ = false;
  bool foreign_ = false;
  std::int64_t end_ = 0;  // of the last whole record
  // By scan. No map: its small nodes, kept among large buffers that come and go, tear the heap.
  std::vector<Place> places_;
};

}  // namespace understory
