#include "understory/pipeline/calibration/lidar_path.h"

#include <fmt/format.h>

#include <memory>
#include <system_error>
#include <utility>
#include <variant>

#include "understory/evaluation/trajectory.h"
#include "understory/pipeline/mapping/mapping.h"
#include "understory/pipeline/source.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr const char* kMappedFolder = "mapped";  // removed in the end

// The path of the body as the lidar alone tells it.
Trajectory mapped_path(const std::string& recording, const OpenOptions& open,
                       const std::filesystem::path& folder, const ProgressSink& progress,
                       std::vector<std::string>& doubts) {
  Log unheard;  // that the IMU is not used, and the like
  MappingRequest mapping;
  mapping.recording = recording;
  mapping.run_folder = folder;
  mapping.open = open;
  ReadConfig<FrontEndConfig> read =
      read_front_end_config(kDenseFrontEnd, "", "",
                            {"motion.imu_enabled=false", "loop_closure.enabled=false",
                             "map.enabled=false", "georeference.online=false"},
                            unheard);
  mapping.config = std::move(read.config);
  mapping.config_record.origins = std::move(read.origins);
  mapping.config_record.asked_yaml = yaml_of(mapping.config);
  const RunOutcome outcome =
      run_mapping(begin_mapping(std::move(mapping)), unheard, progress, [] { return false; });
  if (outcome.status == RunStatus::kUntrusted) doubts = outcome.reasons;
  return read_trajectory(folder / "trajectory.tum");
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

std::vector<StampedPose> mapped_lidar_path(const std::string& recording, const OpenOptions& open,
                                           const std::filesystem::path& folder, const Rig& rig,
                                           const ProgressSink& progress,
                                           std::vector<std::string>& doubts) {
  std::vector<StampedPose> poses;
  const std::filesystem::path scratch = folder / kMappedFolder;
  for (const StampedPose& pose : mapped_path(recording, open, scratch, progress, doubts))
    poses.push_back({pose.stamp, pose.world_from_body * rig.body_from_lidar});
  std::error_code ignored;
  std::filesystem::remove_all(scratch, ignored);
  return poses;
}

std::vector<StampedPose> lidar_path_of_file(const std::string& file) {
  const Trajectory path = read_trajectory(file);
  return {path.begin(), path.end()};
}

std::string pose_yaml(const Pose& pose) {
  const Eigen::Vector3d& t = pose.translation();
  const Eigen::Quaterniond& q = pose.rotation();
  return fmt::format(
      "{{translation_m: [{:.6f}, {:.6f}, {:.6f}], rotation_xyzw: [{:.9f}, {:.9f}, {:.9f}, "
      "{:.9f}]}}",
      t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
}

}  // namespace understory
