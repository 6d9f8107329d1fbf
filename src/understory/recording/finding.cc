#include "understory/recording/finding.h"

#include "understory/util/error.h"

namespace understory {

const char* key_of(Finding finding) {
  switch (finding) {
    case Finding::kDamage:
      return "recording.damaged";
    case Finding::kDamagedPacket:
      return "recording.damaged_packet";
    case Finding::kCutOff:
      return "recording.truncated";
    case Finding::kOtherSensor:
      return "recording.other_frames";
    case Finding::kLateSensor:
      return "recording.late_sensor";
    case Finding::kAssumedTimes:
      return "recording.assumed_rate";
    case Finding::kNoPointTimes:
      return "recording.no_point_times";
    case Finding::kSilentLidar:
      return "recording.silent_lidar";
    case Finding::kMixedTimes:
      return "scan.mixed_times";
  }
  UNDERSTORY_CHECK(false);
  return "";
}

void report_finding(Log& log, Finding finding, const std::string& message) {
  log.warn(key_of(finding), message);
}

Found found(const Log& log, Finding finding) {
  const std::string key = key_of(finding);
  for (const Log::Warning& warning : log.warnings()) {
    if (warning.key == key) return {warning.count, warning.first_message};
  }
  return {};
}

}  // namespace understory
