#include "understory/pipeline/calibration/lidar_imu_run.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

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

constexpr const char* kExtrinsicsFile = "extrinsics.yaml";
constexpr const char* kLidarImuFile = "calibration.json";
constexpr const char* kLidarPathFile = "path.tum";
constexpr double kDegreesARad = 180.0 / std::numbers::pi;

bool is_lidar_imu_file(const std::string& name) {
  return name == kExtrinsicsFile || name == kLidarImuFile || name == kLidarPathFile;
}

std::string extrinsics_yaml(const Rig& rig, const std::optional<double>& lidar_late_s) {
  std::string text = fmt::format("body_frame: {}\nbody_from_lidar: {}\n", rig.body_frame,
                                 pose_yaml(rig.body_from_lidar));
  if (lidar_late_s) text += fmt::format("late_s: {}\n", fixed_text(*lidar_late_s, 6));
  return text + fmt::format("body_from_imu: {}\n", pose_yaml(*rig.body_from_imu));
}

// What `map` is to take from the stamps of the lidar: what the recording was read with, and what
// was found on top of it. Nothing where the clock was not found.
std::optional<double> lidar_lateness(const LidarImuRequest& request, const LidarImuResult& result) {
  if (!result.lateness_found) return std::nullopt;
  const double read_with = request.path_file.empty() ? lateness_of(request.open) : 0.0;
  return read_with - result.imu_late_s;
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

// Below, a standard deviation is that of a value that was kept as given, but for rounding: rad, m,
// s.
constexpr double kKeptSd = 1e-6;

// A value with its standard deviation. One that was not found has none, and says so.
std::string with_sd(double value, double sd, double scale, int decimals) {
  if (sd < kKeptSd) return fixed_text(scale * value, decimals) + " (not found)";
  return fixed_text(scale * value, decimals) + " ± " + fixed_text(scale * sd, decimals);
}

std::string axes_with_sds(const Eigen::Vector3d& values, const Eigen::Vector3d& sds, double scale,
                          int decimals) {
  return fmt::format("x {}, y {}, z {}", with_sd(values.x(), sds.x(), scale, decimals),
                     with_sd(values.y(), sds.y(), scale, decimals),
                     with_sd(values.z(), sds.z(), scale, decimals));
}

std::string clock_text(double imu_late_s, double sd_s) {
  return fmt::format("for one moment the IMU's stamp is {} ms {} than the lidar's",
                     with_sd(std::abs(imu_late_s), sd_s, 1e3, 2),
                     imu_late_s < 0.0 ? "earlier" : "later");
}

// What was found, how sure it is, how far the given values are off, and what to do with it.
std::string summary_of(const LidarImuOutcome& outcome, const Rig& given, const fs::path& folder) {
  const LidarImuResult& result = outcome.result;
  const Eigen::Matrix<double, 7, 1> sd = result.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  const Eigen::Quaterniond& q = result.lidar_from_imu.rotation();
  std::string text = fmt::format(
      "Found from {:.1f} s of motion; ± is one standard deviation:\n"
      "place of the IMU in the lidar's frame  {} m\n"
      "turn of the IMU, as a rotation vector  {} degrees\n"
      "the same turn, as quaternion xyzw      ({}, {}, {}, {})\n"
      "clock                                  {}\n",
      result.duration_s,
      axes_with_sds(result.lidar_from_imu.translation(), sd.segment<3>(3), 1.0, 4),
      axes_with_sds(so3_log(q), sd.head<3>(), kDegreesARad, 3), fixed_text(q.x(), 5),
      fixed_text(q.y(), 5), fixed_text(q.z(), 5), fixed_text(q.w(), 5),
      clock_text(result.imu_late_s, sd[6]));
  if (given.body_from_imu) {
    const Pose change =
        (given.body_from_lidar.inverse() * *given.body_from_imu).inverse() * result.lidar_from_imu;
    text += fmt::format(
        "The given extrinsics differ from it by {:.3f} degrees and {:.4f} m (IMU: {})\n",
        kDegreesARad * so3_log(change.rotation()).norm(), change.translation().norm(),
        given.imu_extrinsic_source);
  }
  return text + fmt::format("Map with it: --extrinsics {}", (folder / kExtrinsicsFile).string());
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

// What a recording tells, and the path that tells it.
struct MappedCalibration {
  LidarPath path;
  LidarImuResult result;
  std::string alone_because;  // why the path with the IMU does not count; empty: it does
};

// What was found, but too roughly to be of use.
std::vector<std::string> hardly_known(const LidarImuResult& result) {
  const Eigen::Matrix<double, 7, 1> sd = result.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  std::vector<std::string> rough;
  if (const double most = sd.head<3>().maxCoeff(); most > kSureTurnSd)
    rough.push_back(fmt::format("the turn to {:.1f} degrees", kDegreesARad * most));
  if (const double most = sd.segment<3>(3).maxCoeff(); most > kSurePlaceSdM)
    rough.push_back(fmt::format("the place to {:.2f} m", most));
  if (sd[6] > kSureSdS) rough.push_back(fmt::format("the clock to {:.1f} ms", 1e3 * sd[6]));
  return rough;
}

void judge(LidarImuOutcome& outcome, const MappedCalibration& found) {
  outcome.reasons = outcome.result.kept;
  if (const std::vector<std::string> rough = hardly_known(outcome.result); !rough.empty())
    outcome.reasons.push_back(
        fmt::format("only roughly known are {} (standard deviations). Record a minute with quick "
                    "turns and tilting",
                    fmt::join(rough, ", ")));
  if (!found.alone_because.empty())
    outcome.reasons.push_back(
        "the values rest on the path of the lidar alone and are less exact: " +
        found.alone_because);
  if (!outcome.reasons.empty()) outcome.status = RunStatus::kPartial;
  if (found.path.doubts.empty()) return;
  outcome.status = RunStatus::kUntrusted;
  for (const std::string& doubt : found.path.doubts)
    outcome.reasons.push_back("the path of the lidar: " + doubt);
}

// Why a path that was mapped with the IMU does not count beside that of the lidar alone.
std::string doubt_of(const MappedCalibration& with_imu, const MappedCalibration& alone) {
  if (!with_imu.path.doubts.empty())
    return "mapped with this IMU the recording is not to be trusted (" +
           with_imu.path.doubts.front() + ")";
  if (!with_imu.result.problem.empty()) return with_imu.result.problem;
  if (with_imu.result.duration_s > kLeastShareAgain * alone.result.duration_s) return "";
  return "mapped with this IMU fewer scans match";
}

// By the path of the lidar alone first. Its scans are deskewed by a guess, and what a steady guess
// gets wrong swings with the motion. So the recording is mapped once more, deskewed by the IMU as
// it was found. That path counts where nothing speaks against it.
MappedCalibration calibrate_by_mapping(const LidarImuRequest& request, const fs::path& folder,
                                       const InertialRecording& read, const Pose& given,
                                       const ProgressSink& progress) {
  MappedCalibration alone;
  alone.path = mapped_lidar_path(request.recording, request.open, folder, read.rig, progress);
  alone.result = calibrate_lidar_imu(alone.path.world_from_lidar, read.samples, given, 0.0);
  if (!alone.result.problem.empty() || alone.result.covariance.isZero()) return alone;
  const RefinedImu found{read.rig.body_from_lidar * alone.result.lidar_from_imu,
                         alone.result.imu_late_s};
  alone.result.covariance *= kScansAloneAreWorse;
  MappedCalibration again;
  again.path =
      mapped_lidar_path(request.recording, request.open, folder, read.rig, progress, found);
  again.result = calibrate_lidar_imu(again.path.world_from_lidar, read.samples,
                                     alone.result.lidar_from_imu, alone.result.imu_late_s);
  alone.alone_because = doubt_of(again, alone);
  return alone.alone_because.empty() ? again : alone;
}

MappedCalibration calibrate_by_file(const std::string& file, const InertialRecording& read,
                                    const Pose& given) {
  MappedCalibration calibration;
  calibration.path.world_from_lidar = lidar_path_of_file(file);
  calibration.result =
      calibrate_lidar_imu(calibration.path.world_from_lidar, read.samples, given, 0.0);
  return calibration;
}

}  // namespace

LidarImuOutcome run_lidar_imu_calibration(const LidarImuRequest& request, Log& log,
                                          const ProgressSink& progress) {
  StagedFolder folder(request.folder, request.overwrite ? StagedFolder::NameTest(is_lidar_imu_file)
                                                        : StagedFolder::NameTest());
  const InertialRecording read = read_samples(request.recording, request.open, log, progress);
  const Rig& given = read.rig;
  const Pose start =
      given.body_from_imu ? given.body_from_lidar.inverse() * *given.body_from_imu : Pose();
  const MappedCalibration found =
      request.path_file.empty()
          ? calibrate_by_mapping(request, folder.part(), read, start, progress)
          : calibrate_by_file(request.path_file, read, start);
  LidarImuOutcome outcome;
  outcome.result = found.result;
  if (!outcome.result.problem.empty())
    throw InputError(request.recording, "", outcome.result.problem);
  if (outcome.result.covariance.isZero())
    throw InputError(request.recording, "",
                     "expected motion: the recording is too calm to tell rotation, place or "
                     "lateness of the IMU; walk, turn quickly and tilt the sensor");
  judge(outcome, found);
  outcome.rig = given;
  outcome.rig.body_from_imu = given.body_from_lidar * outcome.result.lidar_from_imu;
  outcome.summary = summary_of(outcome, given, request.folder);
  const auto write = [&](const char* name, const std::string& text) {
    AtomicFile file(folder.part() / name);
    file.write(text);
    file.commit();
  };
  write(kExtrinsicsFile, extrinsics_yaml(outcome.rig, lidar_lateness(request, outcome.result)));
  write(kLidarImuFile, calibration_json(outcome));
  write_path(folder.part() / kLidarPathFile, found.path.world_from_lidar);
  folder.commit();
  return outcome;
}

}  // namespace understory
