#pragma once

#include <cstdint>
#include <optional>

#include "understory/util/time.h"

namespace understory {

// Judges from the order of arrival whether the clock of one stream runs a constant time ahead of or
// behind a reference (the lidar's clock).
//
// A lead is the stamp of a message minus the newest reference time at its arrival. With clocks that
// agree it is about zero, whatever the stream. A lead that keeps the same large value for
// `kLongEnough` says that the clock is off by it. One lead near zero says that the clocks agree:
// buffers of a recorder and sensors that start late make some leads large, but not all.
// Trivially copyable; deterministic; not thread-safe.
class StreamOffset {
 public:
  struct Limits {
    TimeNs ahead = 400'000'000;   // a lead up to here is usual
    TimeNs behind = 400'000'000;  // so is a lag up to here
    TimeNs spread = 300'000'000;  // leads of a constant offset lie this close together
    std::int32_t count = 8;       // leads needed
  };
  enum class Verdict : std::uint8_t {
    kOpen,      // more leads are needed
    kAgrees,    // the clocks agree as far as arrival can tell, or nothing more can be told
    kConstant,  // off by `offset`
  };
  static constexpr TimeNs kLongEnough = 2 * kNsPerSecond;

  // `reference`: its newest time, when the message arrived. No change after a verdict.
  void add(TimeNs lead, TimeNs reference, const Limits& limits);
  // Nothing more can be waited for.
  void give_up();

  [[nodiscard]] Verdict verdict() const { return verdict_; }
  // Clock of the stream minus reference; 0 unless the verdict is kConstant.
  [[nodiscard]] TimeNs offset() const { return verdict_ == Verdict::kConstant ? lowest_ : 0; }

 private:
  Verdict verdict_ = Verdict::kOpen;
  std::int32_t count_ = 0;
  TimeNs since_ = 0;   // reference at the first lead
  TimeNs latest_ = 0;  // reference at the last lead
  TimeNs lowest_ = 0;  // lead; that of the scan which was delayed least
  TimeNs highest_ = 0;
};

}  // namespace understory
