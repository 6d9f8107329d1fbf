#pragma once

#include <optional>

#include "understory/calibration/lidar_imu/clock_check.h"
#include "understory/odometry/dense/lidar_agreement.h"
#include "understory/pipeline/mapping/front_end.h"
#include "understory/pipeline/run_folder/run_documents.h"

namespace understory {

// run.json and report.html of a run of `understory map`, with what both front ends share. That is
// configuration, inputs, title, and how far the run kept up with its sensors. `times` must outlive
// it.
[[nodiscard]] RunDocuments map_documents(const ReadRecording& recording, const StageTimes& times);

// Figures of the check of the IMU's clock, and a warning where clock or axes seem to be others than
// the run assumes. Nothing where there is no check.
void tell_imu_clock(const std::optional<ClockCheckResult>& check, Log& log, RunSummary& summary);

// A warning where clock or place of a further lidar seem to be others than the run assumes.
void tell_lidar_offset(const LidarOffset& offset, Log& log);

}  // namespace understory
