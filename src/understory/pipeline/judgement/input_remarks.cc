#include "understory/pipeline/judgement/input_remarks.h"

#include <fmt/format.h>

#include "understory/pipeline/pipeline_constants.h"
#include "understory/recording/recording_info.h"

namespace understory {
namespace {

using namespace pipeline_constants::input_remarks;

TimeNs first_of(const Recording& source, const std::string& role, TimeNs otherwise) {
  for (const TopicReport& topic : source.topics()) {
    if (topic.role == role && topic.messages > 0) return topic.first_stamp;
  }
  return otherwise;
}

void remark_on_imu(const LastStamps& last, const Recording& source,
                   const EventOrderer::Report& repair, const std::string& name, Log& log) {
  if (!last.imu) {
    const bool numb = unusable_messages(source, "imu") > 0;
    log.warn("imu.none",
             name + (numb ? ": no sample of the IMU can be used" : ": no IMU") +
                 ": positions come from the scans alone, and the vertical is that of the "
                 "scanner at the first scan");
    return;
  }
  const TimeNs begin = first_of(source, "lidar", 0);
  const double late = to_seconds(first_of(source, "imu", begin) +
                                 repair.streams[EventOrderer::kImu].offset - begin);
  if (late > kImuMissingS) {
    log.warn("imu.late",
             fmt::format("{}: the IMU begins {:.1f} s after the lidar; until then positions come "
                         "from the scans alone",
                         name, late));
  }
  const double missing = to_seconds(last.scan_end - *last.imu);
  if (missing < kImuMissingS) return;
  log.warn("imu.stopped",
           fmt::format("{}: the IMU stopped at {} s; the last {:.1f} s are positioned by the scans "
                       "alone",
                       name, format_seconds(*last.imu), missing));
}

}  // namespace

void remark_on_lever_arms(const Rig& rig, const std::string& name, Log& log) {
  for (const std::string& arm : long_lever_arms(rig))
    log.warn("recording.lever_arm", name + ": " + arm);
}

void remark_on_input(const LastStamps& last, const Recording& source,
                     const EventOrderer::Report& repair, const std::string& name, Log& log) {
  remark_on_imu(last, source, repair, name, log);
  remark_on_lever_arms(source.rig(), name, log);
  for (const TopicReport& topic : source.topics()) {
    if (topic.empty_points == 0) continue;
    const std::uint64_t all = topic.points + topic.empty_points;
    log.warn(
        "points.no_return",
        fmt::format("{}: {}: {} of {} points ({:.1f} %) are not a number or at zero range; "
                    "left out",
                    name, topic.name, topic.empty_points, all,
                    100.0 * static_cast<double>(topic.empty_points) / static_cast<double>(all)));
  }
}

}  // namespace understory
