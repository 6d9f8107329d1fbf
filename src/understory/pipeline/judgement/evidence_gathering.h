#pragma once

#include "understory/odometry/motion/motion_model.h"
#include "understory/pipeline/judgement/imu_usage.h"
#include "understory/pipeline/judgement/run_evidence.h"
#include "understory/preprocess/streams/event_orderer.h"
#include "understory/recording/recording.h"
#include "understory/util/log.h"

namespace understory {

// What both front ends know of the recording that they have read: what each sensor said, and what
// was damaged. They count what was put in order, dropped or not used.
struct ReadingFacts {
  const Recording* source = nullptr;
  const EventOrderer::Report* time_repair = nullptr;
  const Log* log = nullptr;
  TimeNs last_scan_end = 0;
  bool imu_wanted = true;  // by the configuration
  ImuUsage imu_usage;
};
void gather_reading(const ReadingFacts& facts, RunEvidence& evidence);

// What the front end found out about the IMU. It says whether the accelerations by matching are
// those of the accelerometer, and for how long they were not. It also says whether the IMU was left
// out at the end.
void gather_imu_trust(const ImuTrust& trust, RunEvidence& evidence);

}  // namespace understory
