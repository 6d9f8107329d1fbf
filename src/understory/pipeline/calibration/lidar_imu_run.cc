#include "understory/pipeline/calibration/lidar_imu_run.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <utility>
#include <vector>

#include "understory/evaluation/trajectory.h"
#include "understory/pipeline/mapping/mapping.h"
#include "understory/pipeline/source.h"
#include "understory/util/error.h"
#include "understory/util/files/atomic_file.h"
#include "understory/util/files/staged_output.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

constexpr const char* kExtrinsicsFile = "extrinsics.yaml";
constexpr const char* kLidarImuFile = "calibration.json";
constexpr const char* kLidarPathFile = "path.tum";
constexpr const char* kMappedFolder = "mapped";  // removed in the end
constexpr double kDegreesARad = 180.0 / std::numbers::pi;

bool is_lidar_imu_file(const std::string& name) {
  return name == kExtrinsicsFile || name == kLidarImuFile || name == kLidarPathFile;
}

// The samples of the IMU, and the rig.
struct InertialRecording {
  ImuBuffer samples{ImuNoiseConfig(), nullptr};
  Rig rig;
};

InertialRecording read_samples(const LidarImuRequest& request, Log& log,
                               const ProgressSink& progress) {
  InertialRecording read;
  const std::unique_ptr<Recording> recording = open_source(request.recording, request.open, log);
  std::uint64_t events = 0;
  while (const auto event = recording->next()) {
    if (++events % 256 == 0)
      progress({"reading the IMU", 100.0 * recording->progress(), 100.0, "%", ""});
    if (const auto* sample = std::get_if<ImuSample>(&*event)) read.samples.add(*sample);
  }
  read.rig = recording->rig();
  if (read.samples.empty()) throw InputError(request.recording, "", "expected samples of an IMU");
  return read;
}

// The path of the body as the lidar alone tells it.
Trajectory mapped_path(const LidarImuRequest& request, const fs::path& folder,
                       const ProgressSink& progress, std::vector<std::string>& doubts) {
  Log unheard;  // that the IMU is not used, and the like
  MappingRequest mapping;
  mapping.recording = request.recording;
  mapping.run_folder = folder;
  mapping.open = request.open;
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

std::string pose_yaml(const Pose& pose) {
  const Eigen::Vector3d& t = pose.translation();
  const Eigen::Quaterniond& q = pose.rotation();
  return fmt::format(
      "{{translation_m: [{:.6f}, {:.6f}, {:.6f}], rotation_xyzw: [{:.9f}, {:.9f}, {:.9f}, "
      "{:.9f}]}}",
      t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
}

std::string extrinsics_yaml(const Rig& rig) {
  return fmt::format("body_frame: {}\nbody_from_lidar: {}\nbody_from_imu: {}\n", rig.body_frame,
                     pose_yaml(rig.body_from_lidar), pose_yaml(*rig.body_from_imu));
}

std::string calibration_json(const LidarImuOutcome& outcome) {
  const LidarImuResult& result = outcome.result;
  const Eigen::Quaterniond& q = result.lidar_from_imu.rotation();
  const Eigen::Vector3d& t = result.lidar_from_imu.translation();
  nlohmann::ordered_json json = {
      {"status", to_string(outcome.status)},
      {"reasons", outcome.reasons},
      {"duration_s", result.duration_s},
      {"imu_late_s", result.imu_late_s},
      {"lidar_from_imu",
       {{"translation_m", {t.x(), t.y(), t.z()}}, {"rotation_xyzw", {q.x(), q.y(), q.z(), q.w()}}}},
      {"gyro_bias_rad_s", std::vector<double>(result.gyro_bias.begin(), result.gyro_bias.end())},
      {"accel_bias_m_s2", std::vector<double>(result.accel_bias.begin(), result.accel_bias.end())}};
  json["order"] = {"rx_rad", "ry_rad", "rz_rad", "x_m", "y_m", "z_m", "late_s"};
  for (const auto& row : result.covariance.rowwise())
    json["covariance"].push_back(std::vector<double>(row.begin(), row.end()));
  return json.dump(2) + "\n";
}

std::string summary_of(const LidarImuOutcome& outcome, const Rig& given, const fs::path& folder) {
  const LidarImuResult& result = outcome.result;
  const Eigen::Matrix<double, 7, 1> sd = result.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  const Eigen::Vector3d& t = result.lidar_from_imu.translation();
  const Eigen::Quaterniond& q = result.lidar_from_imu.rotation();
  std::string text = fmt::format(
      "{:.1f} s of path\nlateness of the IMU  {:.2f} ± {:.2f} ms\nlidar_from_imu       place "
      "({:.4f}, {:.4f}, {:.4f}) ± ({:.4f}, {:.4f}, {:.4f}) m\n                     quaternion xyzw "
      "({:.5f}, {:.5f}, {:.5f}, {:.5f}), about x, y, z ± ({:.3f}, {:.3f}, {:.3f}) degrees\n",
      result.duration_s, 1e3 * result.imu_late_s, 1e3 * sd[6], t.x(), t.y(), t.z(), sd[3], sd[4],
      sd[5], q.x(), q.y(), q.z(), q.w(), kDegreesARad * sd[0], kDegreesARad * sd[1],
      kDegreesARad * sd[2]);
  if (given.body_from_imu) {
    const Pose change =
        (given.body_from_lidar.inverse() * *given.body_from_imu).inverse() * result.lidar_from_imu;
    text += fmt::format("from the given one   {:.3f} degrees, {:.4f} m ({})\n",
                        kDegreesARad * so3_log(change.rotation()).norm(),
                        change.translation().norm(), given.imu_extrinsic_source);
  }
  return text + fmt::format("extrinsics: {}", (folder / kExtrinsicsFile).string());
}

void write_path(const fs::path& path, const std::vector<StampedPose>& world_from_lidar) {
  AtomicTextFile file(path);
  for (const StampedPose& pose : world_from_lidar) {
    const Eigen::Vector3d& t = pose.world_from_body.translation();
    const Eigen::Quaterniond& q = pose.world_from_body.rotation();
    file.write(fmt::format("{} {:.6f} {:.6f} {:.6f} {:.9f} {:.9f} {:.9f} {:.9f}\n",
                           format_seconds(pose.stamp), t.x(), t.y(), t.z(), q.x(), q.y(), q.z(),
                           q.w()));
  }
  file.commit();
}

// The path of the lidar: that of the file, or a mapped one.
std::vector<StampedPose> lidar_path(const LidarImuRequest& request, const fs::path& scratch,
                                    const Rig& rig, const ProgressSink& progress,
                                    std::vector<std::string>& doubts) {
  if (!request.path_file.empty()) {
    const Trajectory path = read_trajectory(request.path_file);
    return {path.begin(), path.end()};
  }
  std::vector<StampedPose> poses;
  for (const StampedPose& pose : mapped_path(request, scratch, progress, doubts))
    poses.push_back({pose.stamp, pose.world_from_body * rig.body_from_lidar});
  std::error_code ignored;
  fs::remove_all(scratch, ignored);
  return poses;
}

void judge(LidarImuOutcome& outcome, const std::vector<std::string>& doubts) {
  outcome.reasons = outcome.result.kept;
  if (!outcome.reasons.empty()) outcome.status = RunStatus::kPartial;
  if (doubts.empty()) return;
  outcome.status = RunStatus::kUntrusted;
  for (const std::string& doubt : doubts)
    outcome.reasons.push_back("the path of the lidar: " + doubt);
}

}  // namespace

LidarImuOutcome run_lidar_imu_calibration(const LidarImuRequest& request, Log& log,
                                          const ProgressSink& progress) {
  StagedFolder folder(request.folder, request.overwrite ? StagedFolder::NameTest(is_lidar_imu_file)
                                                        : StagedFolder::NameTest());
  InertialRecording read = read_samples(request, log, progress);
  std::vector<std::string> doubts;
  const std::vector<StampedPose> path =
      lidar_path(request, folder.part() / kMappedFolder, read.rig, progress, doubts);
  const Rig given = read.rig;
  const Pose start =
      given.body_from_imu ? given.body_from_lidar.inverse() * *given.body_from_imu : Pose();
  LidarImuOutcome outcome;
  outcome.result = calibrate_lidar_imu(path, read.samples, start, 0.0);
  if (!outcome.result.problem.empty())
    throw InputError(request.recording, "", outcome.result.problem);
  if (outcome.result.covariance.isZero())
    throw InputError(request.recording, "",
                     "expected motion: the recording is too calm to tell rotation, place or "
                     "lateness of the IMU; walk, turn quickly and tilt the sensor");
  judge(outcome, doubts);
  outcome.rig = given;
  outcome.rig.body_from_imu = given.body_from_lidar * outcome.result.lidar_from_imu;
  outcome.summary = summary_of(outcome, given, request.folder);
  const auto write = [&](const char* name, const std::string& text) {
    AtomicFile file(folder.part() / name);
    file.write(text);
    file.commit();
  };
  write(kExtrinsicsFile, extrinsics_yaml(outcome.rig));
  write(kLidarImuFile, calibration_json(outcome));
  write_path(folder.part() / kLidarPathFile, path);
  folder.commit();
  return outcome;
}

}  // namespace understory
