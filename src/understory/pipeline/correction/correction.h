#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "understory/geometry/stamped_pose.h"
#include "understory/map/stem_map.h"
#include "understory/odometry/stems/sparse_odometry.h"
#include "understory/output/run_summary.h"
#include "understory/pipeline/correction/head_cut_log.h"
#include "understory/pipeline/correction/stem_correction.h"
#include "understory/pipeline/judgement/imu_hearing.h"
#include "understory/pipeline/judgement/path_evidence.h"
#include "understory/pipeline/judgement/run_judgement.h"
#include "understory/pipeline/run_folder/run_outcome.h"
#include "understory/preprocess/event_orderer.h"
#include "understory/recording/recording.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/util/config.h"
#include "understory/util/config_origins.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"
#include "understory/util/timing.h"

namespace understory {

struct CorrectionConfig {
  SparseOdometryConfig odometry;
  StemCorrectionConfig stems;
  StemMapConfig tree_list = tree_list_config();
  HeadCutLogConfig harvester;
  JudgementConfig judgement;
  MotionLimits motion_limits;
};
void describe(ConfigTable& table, CorrectionConfig& config);

// What a run at the speed of its sensors has to say of its own.
struct RealtimeFacts {
  std::uint64_t dropped_scans = 0;
  Distribution latency_ms;  // from the end of a scan to its pose
};

// The recording that the stems come from, where `understory map` has just read it.
struct SparseScans {
  std::string recording;  // as the user named it
  const Recording* source = nullptr;
  std::vector<StampedPose> path;      // of every scan, chained
  std::size_t positioned = 0;         // of these; the others lie on the way between
  std::vector<SparseStep> steps;      // of the views in the stems' file
  const StageTimes* times = nullptr;  // "scan": all of one scan
  std::vector<GnssFix> fixes;         // of the recording; compared with, not used
  double wall_s = 0.0;                // that it took so far
  bool stopped = false;               // before the recording's end
  EventOrderer::Report time_repair;   // of its events
  TimeNs last_scan_end = 0;
  std::uint64_t repeated = 0;  // scans that hold the same points as the one before
  ImuHearing imu_hearing;      // for how long the IMU's samples could not be used
  ImuTrust imu_trust;          // whether they agree with the stems
  bool imu_wanted = true;      // by the configuration
  std::string unreadable;      // why it could not be read to its end; else the user stopped
  std::string imu_distrust;    // why its IMU is not believed; empty: it is, or there is none
  std::optional<RealtimeFacts> realtime;
};

// One call of `understory correct`.
struct CorrectionRequest {
  // stems.csv.gz, or a run folder that holds one: then its trajectory.tum is where the correction
  // begins, and what is made of it has a row for each of its poses.
  std::filesystem::path stems;
  std::filesystem::path run_folder;
  bool overwrite = false;  // what an earlier run left in the folder, finished or not
  // Where the files are written; the mapping run that has claimed the run folder puts them in
  // place. Empty: the correction claims the folder itself.
  std::filesystem::path results;
  CorrectionConfig config;
  std::string config_yaml;  // asked for, every key, for run.json
  ConfigOrigins config_origins;
  // Of `understory map`: what ran, and what was changed for it.
  std::string effective_yaml;
  std::vector<ConfigAdaptation> adapted;
  // With it odometry.tum and trajectory.tum have a row per scan instead of one per view, and
  // run.json and the report speak of the recording.
  const SparseScans* scans = nullptr;
};

// From the stems of a recording to the run folder: odometry, loops, trajectory, tree map.
// Throws InputError or OutputError.
[[nodiscard]] RunOutcome run_correction(const CorrectionRequest& request, Log& log,
                                        const ProgressSink& progress,
                                        const StopRequested& stop_requested);

}  // namespace understory
