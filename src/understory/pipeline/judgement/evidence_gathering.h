#pragma once

#include "understory/odometry/motion/motion_model.h"
#include "understory/pipeline/judgement/imu_usage.h"
#include "understory/pipeline/judgement/run_evidence.h"
#include "understory/preprocess/streams/event_orderer.h"
#include "understory/recording/recording.h"
#include "understory/util/log.h"

namespace understory {

// What both front ends know of the recording that they have read: what each sensor said, what of it
// was put in order, dropped or not used, and what was damaged.
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
// those of the accelerometer, how long it could not be gone by, and whether it was left out at the
// end.
void gather_imu_trust(const ImuTrust& trust, RunEvidence& evidence);

}  // namespace understory
