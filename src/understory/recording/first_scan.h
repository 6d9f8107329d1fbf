#pragma once

#include <cstdint>
#include <deque>
#include <string>

#include "understory/sensor/scan.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/log.h"

namespace understory {

// The scans of a spinning lidar as they are finished. A stream begins anywhere in a turn. The first
// scan is then a part, and the next one comes after a part of the usual time. The speed that the
// two seem to tell is as wrong as that time is short. So such a part is left out, with a warning
// ("scan.part"), unless it is all there is or lasts as long as the next one. Not thread-safe.
class FinishedScans {
 public:
  // `source` names the stream in the warning.
  FinishedScans(std::string source, Log& log) : source_(std::move(source)), log_(log) {}

  // `missing`: the share of a turn that lacks at the scan's beginning; looked at for the first scan
  // alone. Null scans are passed over.
  void add(ScanPtr scan, double missing);
  // The next one, or null.
  [[nodiscard]] ScanPtr take();
  // At the end of the stream.
  void finish();
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  void settle_part(const Scan& next);
  void drop_part();

  std::string source_;
  Log& log_;
  bool any_ = false;
  ScanPtr part_;
  double missing_ = 0.0;
  std::deque<ScanPtr> scans_;
};

}  // namespace understory
