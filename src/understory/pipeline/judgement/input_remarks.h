#pragma once

#include <optional>
#include <string>

#include "understory/preprocess/streams/event_orderer.h"
#include "understory/recording/recording.h"
#include "understory/util/log.h"

namespace understory {

// Until when the sensors of a recording spoke, by the mended clocks.
struct LastStamps {
  std::optional<TimeNs> imu;  // nothing if there has been no sample
  TimeNs scan_end = 0;
};

// At the end of a recording, warns of what only the whole shows: no IMU, an IMU that stopped,
// points without a return. `name` is that of the recording, `repair` what was done to its stamps.
void remark_on_input(const LastStamps& last, const Recording& source,
                     const EventOrderer::Report& repair, const std::string& name, Log& log);

// Warns of sensors that the extrinsics put more than 10 m from the body's origin or from the lidar.
// Millimetres are then taken for metres, or a place on the earth is given.
void remark_on_lever_arms(const Rig& rig, const std::string& name, Log& log);

}  // namespace understory
