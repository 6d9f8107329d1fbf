#include "understory/pipeline/calibration/lidar_clocks_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "understory/pipeline/calibration/lidar_path.h"
#include "understory/pipeline/pipeline_constants.h"
#include "understory/recording/lidars/merged_lidars.h"
#include "understory/util/error.h"
#include "understory/util/files/atomic_file.h"
#include "understory/util/files/staged_output.h"
#include "understory/util/fixed_text.h"

namespace understory {
namespace {

namespace fs = std::filesystem;
using namespace pipeline_constants::imu_calibration;

constexpr const char* kRigFile = "extrinsics.yaml";
constexpr const char* kClocksFile = "calibration.json";

bool is_clocks_file(const std::string& name) {
  return name == kRigFile || name == kClocksFile;
}

LidarClock find_clock(const LidarClocksRequest& request, const NamedLidar& lidar,
                      const fs::path& scratch, Log& log, const ProgressSink& progress,
                      std::vector<std::string>& doubts) {
  LidarClock clock;
  clock.topic = lidar.topic;
  const OpenOptions open = options_for(lidar, request.open);
  InertialRecording read = read_samples(request.recording, open, log, progress);
  const LidarPath path = mapped_lidar_path(request.recording, open, scratch, read.rig, progress);
  doubts = path.doubts;
  const Pose start = read.rig.body_from_imu
                         ? read.rig.body_from_lidar.inverse() * *read.rig.body_from_imu
                         : Pose();
  clock.rig = read.rig;
  clock.result = calibrate_lidar_imu(path.world_from_lidar, read.samples, start, 0.0);
  if (!clock.result.problem.empty())
    throw InputError(request.recording, "", lidar.topic + ": " + clock.result.problem);
  clock.late_s = lidar.late_s - clock.result.imu_late_s;
  clock.sd_s = std::sqrt(std::max(kScansAloneAreWorse * clock.result.covariance(6, 6), 0.0));
  return clock;
}

std::string rig_yaml(const std::vector<LidarClock>& clocks) {
  const Rig& rig = clocks.front().rig;
  std::string text = fmt::format("body_frame: {}\nlidars:\n", rig.body_frame);
  for (const LidarClock& clock : clocks) {
    text += fmt::format("  - topic: \"{}\"\n", clock.topic);
    if (!clock.rig.lidar_model.empty())
      text += fmt::format("    lidar_model: \"{}\"\n", clock.rig.lidar_model);
    text += fmt::format("    body_from_lidar: {}\n    late_s: {}\n",
                        pose_yaml(clock.rig.body_from_lidar), fixed_text(clock.late_s, 6));
  }
  const auto add = [&](const char* key, const std::optional<Pose>& place) {
    if (place) text += fmt::format("{}: {}\n", key, pose_yaml(*place));
  };
  add("body_from_imu", rig.body_from_imu);
  add("body_from_gnss", rig.body_from_gnss);
  add("body_from_second_gnss", rig.body_from_second_gnss);
  return text;
}

std::string clocks_json(const LidarClocksOutcome& outcome) {
  nlohmann::ordered_json json = {{"status", to_string(outcome.status)},
                                 {"reasons", outcome.reasons}};
  for (const LidarClock& clock : outcome.clocks)
    json["lidars"].push_back({{"topic", clock.topic},
                              {"late_s", clock.late_s},
                              {"sd_s", clock.sd_s},
                              {"duration_s", clock.result.duration_s}});
  return json.dump(2) + "\n";
}

// Places that the motion does not tell are of no concern: they stay as they are given.
void judge_clock(const LidarClock& clock, const std::vector<std::string>& doubts,
                 LidarClocksOutcome& outcome) {
  if (!clock.result.lateness_found) {
    if (outcome.status == RunStatus::kComplete) outcome.status = RunStatus::kPartial;
    outcome.reasons.push_back(clock.topic + ": its clock is not found: the motion is too calm");
  } else if (clock.sd_s > kSureSdS) {
    if (outcome.status == RunStatus::kComplete) outcome.status = RunStatus::kPartial;
    outcome.reasons.push_back(fmt::format(
        "{}: its clock is known to {:.1f} ms only (standard deviation), from {:.0f} s of "
        "motion. Record 45 s or more with turns",
        clock.topic, 1e3 * clock.sd_s, clock.result.duration_s));
  }
  for (const std::string& doubt : doubts) {
    outcome.status = RunStatus::kUntrusted;
    outcome.reasons.push_back("the path of " + clock.topic + ": " + doubt);
  }
}

}  // namespace

LidarClocksOutcome run_lidar_clocks(const LidarClocksRequest& request, Log& log,
                                    const ProgressSink& progress) {
  const std::vector<NamedLidar> lidars = named_lidars(request.open);
  if (lidars.empty())
    throw ConfigError(
        {"expected the lidars: --lidar-topic A,B, or --extrinsics FILE with a list "
         "`lidars`"});
  StagedFolder folder(request.folder, request.overwrite ? StagedFolder::NameTest(is_clocks_file)
                                                        : StagedFolder::NameTest());
  LidarClocksOutcome outcome;
  for (const NamedLidar& lidar : lidars) {
    std::vector<std::string> doubts;
    outcome.clocks.push_back(find_clock(request, lidar, folder.part(), log, progress, doubts));
    const LidarClock& clock = outcome.clocks.back();
    judge_clock(clock, doubts, outcome);
    outcome.summary += fmt::format("{:<20} late by {} ± {:.2f} ms against the IMU\n", clock.topic,
                                   fixed_text(1e3 * clock.late_s, 2), 1e3 * clock.sd_s);
  }
  outcome.summary += fmt::format("extrinsics: {}", (request.folder / kRigFile).string());
  const auto write = [&](const char* name, const std::string& text) {
    AtomicFile file(folder.part() / name);
    file.write(text);
    file.commit();
  };
  write(kRigFile, rig_yaml(outcome.clocks));
  write(kClocksFile, clocks_json(outcome));
  folder.commit();
  return outcome;
}

}  // namespace understory
