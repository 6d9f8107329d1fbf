#pragma once

#include <cstdint>
#include <string>

#include "understory/util/log.h"

namespace understory {

// What a reader finds wrong or missing in a recording, of the kinds that the status of a run
// counts.
enum class Finding {
  kDamage,         // a chunk, page, record or cloud that is left out
  kDamagedPacket,  // of the sensor
  kCutOff,         // the recording ends in the middle of something
  kOtherSensor,    // a message of a second sensor on the topic, left out
  kLateSensor,     // met too late in a capture to be used
  kAssumedTimes,   // nothing tells when the clouds of a folder were taken
  kNoPointTimes,   // of a lidar that spins
  kSilentLidar,    // one of several, for a while or until the end
  kMixedTimes,     // a scan whose points have times in no order
};

// The key of its warning, for docs/reference/troubleshooting.md and run.json.
[[nodiscard]] const char* key_of(Finding finding);

// Warns of it and counts it; a checkpoint keeps the count together with the warnings.
void report_finding(Log& log, Finding finding, const std::string& message);

// How often a kind of damage was found, and where first.
struct Found {
  std::uint64_t count = 0;
  std::string first;  // message; empty where there is none
};
// What a log has kept of one kind of damage.
[[nodiscard]] Found found(const Log& log, Finding finding);

}  // namespace understory
