#pragma once

#include <string>
#include <vector>

#include "understory/sensor/scan.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/time.h"

namespace understory {

// The scan that a decoder of packets gathers: points, and beside them their absolute times.
class GrowingScan {
 public:
  [[nodiscard]] bool empty() const { return points_.empty(); }
  void add(const ScanPoint& point, TimeNs time);
  // The scan, with the earliest time as its stamp; null if there are no points. Points more than
  // 4 s after the first (which t_ns cannot hold) are left out. Empties this, but keeps the memory.
  [[nodiscard]] ScanPtr take(int ring_count);
  void save(BinaryWriter& writer) const;
  // Throws InputError, with `source` as its file, where the state is not that of a scan.
  void load(BinaryReader& reader, const std::string& source);

 private:
  std::vector<ScanPoint> points_;
  std::vector<TimeNs> times_;
};

}  // namespace understory
