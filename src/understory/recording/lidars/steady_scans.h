#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "understory/sensor/scan.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// Passes the scans of a lidar on, but for single ones with a stamp far from those around them. The
// scans of all other lidars would wait for such a time. A stamp that is ten seconds off counts once
// the next one confirms it. Not thread-safe.
class SteadyScans {
 public:
  // The scans that are certain now, in order.
  [[nodiscard]] std::vector<ScanPtr> add(ScanPtr scan);
  // Scans that were left out so far.
  [[nodiscard]] std::uint64_t left_out() const { return left_out_; }
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  bool any_ = false;
  TimeNs last_ = 0;
  ScanPtr doubtful_;
  std::uint64_t left_out_ = 0;
};

}  // namespace understory
