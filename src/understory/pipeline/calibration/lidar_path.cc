#include "understory/pipeline/calibration/lidar_path.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <system_error>
#include <utility>
#include <variant>

#include "understory/evaluation/trajectory.h"
#include "understory/pipeline/mapping/mapping.h"
#include "understory/pipeline/source.h"
#include "understory/util/error.h"
#include "understory/util/fixed_text.h"

namespace understory {
namespace {

constexpr const char* kMappedFolder = "mapped";  // removed in the end

// Takes the middles of the scans as they are matched.
class MiddlesOfScans {
 public:
  void take(const PositionedScan& scan) {
    if (scan.pose.stamp <= last_) poses_.clear();  // the recording is begun anew
    last_ = scan.pose.stamp;
    if (const auto& moved = scan.new_world_from_old_world) {
      for (StampedPose& pose : poses_)
        pose.world_from_body = *moved * pose.world_from_body;
    }
    const auto& middle = scan.matched_middle;
    if (middle && (poses_.empty() || middle->stamp > poses_.back().stamp))
      poses_.push_back(*middle);
  }
  [[nodiscard]] const std::vector<StampedPose>& poses() const { return poses_; }

 private:
  std::vector<StampedPose> poses_;  // world_from_body
  TimeNs last_ = std::numeric_limits<TimeNs>::min();
};

std::vector<std::string> settings_of(bool with_imu) {
  return {with_imu ? "refine_imu=true" : "motion.imu_enabled=false", "loop_closure.enabled=false",
          "map.enabled=false", "georeference.online=false"};
}

bool imu_was_refused(const Log& log) {
  const std::vector<Log::Warning> warnings = log.warnings();
  return std::any_of(warnings.begin(), warnings.end(),
                     [](const Log::Warning& warning) { return warning.key == "imu.untrusted"; });
}

}  // namespace

InertialRecording read_samples(const std::string& recording, const OpenOptions& open, Log& log,
                               const ProgressSink& progress) {
  InertialRecording read;
  const std::unique_ptr<Recording> source = open_source(recording, open, log);
  std::uint64_t events = 0;
  while (const auto event = source->next()) {
    if (++events % 256 == 0)
      progress({"reading the IMU", 100.0 * source->progress(), 100.0, "%", ""});
    if (const auto* sample = std::get_if<ImuSample>(&*event)) read.samples.add(*sample);
  }
  read.rig = source->rig();
  if (read.samples.empty()) throw InputError(recording, "", "expected samples of an IMU");
  return read;
}

LidarPath mapped_lidar_path(const std::string& recording, const OpenOptions& open,
                            const std::filesystem::path& folder, const Rig& rig,
                            const ProgressSink& progress, const std::optional<RefinedImu>& imu) {
  const std::filesystem::path scratch = folder / kMappedFolder;
  Log unheard;  // that the IMU is not used, and the like
  MiddlesOfScans middles;
  MappingRequest mapping;
  mapping.recording = recording;
  mapping.run_folder = scratch;
  mapping.open = open;
  mapping.conditions.imu_refined = imu;
  mapping.on_positioned = [&](const PositionedScan& scan) { middles.take(scan); };
  ReadConfig<FrontEndConfig> read =
      read_front_end_config(kDenseFrontEnd, "", "", settings_of(imu.has_value()), unheard);
  mapping.config = std::move(read.config);
  mapping.config_record.origins = std::move(read.origins);
  mapping.config_record.asked_yaml = yaml_of(mapping.config);
  const RunOutcome outcome =
      run_mapping(begin_mapping(std::move(mapping)), unheard, progress, [] { return false; });
  LidarPath path;
  if (outcome.status == RunStatus::kUntrusted) path.doubts = outcome.reasons;
  if (imu && imu_was_refused(unheard)) path.doubts.emplace_back("the scans contradict the IMU");
  for (const StampedPose& pose : middles.poses())
    path.world_from_lidar.push_back({pose.stamp, pose.world_from_body * rig.body_from_lidar});
  std::error_code ignored;
  std::filesystem::remove_all(scratch, ignored);
  return path;
}

std::vector<StampedPose> lidar_path_of_file(const std::string& file) {
  const Trajectory path = read_trajectory(file);
  return {path.begin(), path.end()};
}

std::string pose_yaml(const Pose& pose) {
  const Eigen::Vector3d& t = pose.translation();
  const Eigen::Quaterniond& q = pose.rotation();
  return fmt::format("{{translation_m: [{}, {}, {}], rotation_xyzw: [{}, {}, {}, {}]}}",
                     fixed_text(t.x(), 6), fixed_text(t.y(), 6), fixed_text(t.z(), 6),
                     fixed_text(q.x(), 9), fixed_text(q.y(), 9), fixed_text(q.z(), 9),
                     fixed_text(q.w(), 9));
}

}  // namespace understory
