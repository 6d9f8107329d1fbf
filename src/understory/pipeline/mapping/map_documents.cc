#include "understory/pipeline/mapping/map_documents.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "understory/pipeline/georeferencing/online_path.h"
#include "understory/pipeline/source.h"

namespace understory {

RunDocuments map_documents(const ReadRecording& recording, const StageTimes& times) {
  const MappingRequest& request = recording.request;
  const RunFacts& facts = recording.facts;
  RunDocuments documents("map", request.config_record, times, recording.log, facts.elapsed_s);
  documents.add_inputs(hash_inputs(request.recording, recording.log, recording.progress));
  documents.tell_world_in(world_frame_of(request.config));
  documents.report().title = std::filesystem::path(request.recording).filename().string();
  if (facts.online != nullptr) {
    const GeoreferenceConfig& config = georeference_of(request.config);
    documents.summary().quality.merge(facts.online->write(recording.results, config));
  }
  if (facts.memory_mb.size() > 1) {
    documents.summary().quality["memory_mb_half"] = facts.memory_mb[facts.memory_mb.size() / 2];
    documents.summary().quality["memory_mb_end"] = facts.memory_mb.back();
  }
  if (!facts.realtime) return documents;
  documents.count("scans_dropped", facts.dropped_scans);
  add_latency(distribution_of(facts.latencies_ms), documents.summary());
  return documents;
}

void tell_imu_clock(const std::optional<ClockCheckResult>& check, Log& log, RunSummary& summary) {
  if (!check) return;
  summary.quality["imu_late_ms"] = 1e3 * check->late_s;
  summary.quality["imu_late_sd_ms"] = 1e3 * check->late_sd_s;
  constexpr const char* kRemedy =
      "`understory calibrate lidar-imu` finds it, and `map --extrinsics` takes it out; "
      "`map --refine-imu` does both by all points";
  if (check->clock_is_off())
    log.warn("imu.clock",
             fmt::format("the clock of the IMU seems to be {:.0f} ± {:.0f} ms {} by that of the "
                         "lidar: {}",
                         1e3 * std::abs(check->late_s), 1e3 * check->late_sd_s,
                         check->late_s > 0.0 ? "late" : "early", kRemedy));
  if (!(check->turned_sd_rad > 0.0)) return;
  constexpr double kDegreesARad = 180.0 / std::numbers::pi;
  const double turned_deg = kDegreesARad * check->turned_rad;
  const double turned_sd_deg = kDegreesARad * check->turned_sd_rad;
  summary.quality["imu_turned_deg"] = turned_deg;
  summary.quality["imu_turned_sd_deg"] = turned_sd_deg;
  if (check->axes_are_off())
    log.warn("imu.axes",
             fmt::format("the axes of the IMU seem to be turned by {:.1f} ± {:.1f} degrees from "
                         "where they are given: {}",
                         turned_deg, turned_sd_deg, kRemedy));
}

void tell_lidar_offset(const LidarOffset& offset, Log& log) {
  if (offset.clock_is_off())
    log.warn("lidars.clock",
             fmt::format("the clock of lidar {} seems to be {:.0f} ± {:.0f} ms {} by that of the "
                         "first one: `understory calibrate lidars` finds it, and `map "
                         "--extrinsics` takes it out",
                         offset.lidar + 1, 1e3 * std::abs(offset.late_s), 1e3 * offset.late_sd_s,
                         offset.late_s > 0.0 ? "late" : "early"));
  // A clock that is off also seems to move the place.
  if (offset.place_is_off() && !offset.clock_is_off())
    log.warn(
        "lidars.place",
        fmt::format("the points of lidar {} lie {:.1f} ± {:.1f} cm beside those of the first "
                    "one, however the machine moves: extrinsics are wrong by several times as "
                    "much",
                    offset.lidar + 1, 100.0 * offset.misplaced_m, 100.0 * offset.misplaced_sd_m));
}

}  // namespace understory
