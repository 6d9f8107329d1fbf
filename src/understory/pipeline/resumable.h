#pragma once

#include "understory/sensor/rig.h"
#include "understory/util/binary_io.h"
#include "understory/util/time.h"

namespace understory {

// The moving part of a run whose whole state can be written and read back (pipeline/run_state.h).
class Resumable {
 public:
  Resumable() = default;
  Resumable(const Resumable&) = delete;
  Resumable& operator=(const Resumable&) = delete;
  virtual ~Resumable() = default;

  // Makes its files in the work folder safe to the point that `save` tells of.
  virtual void flush() = 0;
  virtual void save(BinaryWriter& writer) const = 0;
  // Instead of the events so far. Throws InputError where the bytes or the files end too early.
  virtual void load(BinaryReader& reader, const Rig& rig) = 0;
  [[nodiscard]] virtual TimeNs last_scan_end() const = 0;
};

}  // namespace understory
