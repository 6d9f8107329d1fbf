#include "understory/calibration/lidar_imu/lidar_imu_calibration.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "understory/calibration/calibration_constants.h"
#include "understory/calibration/lidar_imu/coloured_fit.h"
#include "understory/geometry/best_rotation.h"
#include "understory/geometry/large_solvers.h"
#include "understory/geometry/symmetric_eigen.h"

namespace understory {

using namespace calibration_constants::lidar_imu_calibration;

namespace {

// Knowledge beside the recording: around `given`, weak but for what is kept.
struct Given {
  LidarImuState state;
  LidarImuMatrix information = LidarImuMatrix::Zero();
};

LidarImuStep step_from(const LidarImuState& from, const LidarImuState& to) {
  LidarImuStep step;
  step << so3_log(from.lidar_from_imu.rotation().conjugate() * to.lidar_from_imu.rotation()),
      to.lidar_from_imu.translation() - from.lidar_from_imu.translation(),
      to.imu_late_s - from.imu_late_s, to.gyro_bias - from.gyro_bias,
      to.accel_bias - from.accel_bias, to.gravity - from.gravity,
      (to.gyro_axes - from.gyro_axes).reshaped(), (to.accel_axes - from.accel_axes).reshaped(),
      to.turn_bend - from.turn_bend, to.place_bend - from.place_bend;
  return step;
}

Given weakly_given(const LidarImuState& state) {
  LidarImuStep sd;
  sd << Eigen::Vector3d::Constant(kGivenRotation), Eigen::Vector3d::Constant(kGivenPlaceM),
      kGivenLatenessS, Eigen::Vector3d::Constant(kGivenGyroBias),
      Eigen::Vector3d::Constant(kGivenAccelBias), Eigen::Vector3d::Constant(kGivenGravity),
      Eigen::Matrix<double, 18, 1>::Constant(kGivenAxes), Eigen::Vector2d::Constant(kGivenBend);
  Given given{state, LidarImuMatrix::Zero()};
  given.information.diagonal() = sd.cwiseAbs2().cwiseInverse();
  return given;
}

struct Fit {
  LidarImuState state;
  LidarImuMatrix covariance = LidarImuMatrix::Zero();
  bool converged = false;
};

Fit fit(const std::vector<PathRun>& runs, const ImuBuffer& imu, const LidarImuState& start,
        const Given& given) {
  Fit result;
  result.state = start;
  for (int round = 0; round < kMostFitRounds && !result.converged; ++round) {
    NormalEquations equations;
    for (const PathRun& run : runs) {
      const LidarImuResiduals residuals = lidar_imu_residuals(run, imu, result.state);
      add_coloured(residuals.turns, equations);
      add_coloured(residuals.velocities, equations);
    }
    equations.information += given.information;
    equations.gradient += given.information * step_from(given.state, result.state);
    const LidarImuMatrix covariance = LargeSymmetricSolver(equations.information).inverse();
    LidarImuStep step = -(covariance * equations.gradient);
    // The samples of the IMU reach so far beyond the ends of the runs only.
    const double late = result.state.imu_late_s - given.state.imu_late_s;
    step[kLatenessParameter] =
        std::clamp(late + step[kLatenessParameter], -kMostLatenessS, kMostLatenessS) - late;
    result.state = stepped(result.state, step);
    result.covariance = covariance;
    const Eigen::VectorXd sigmas =
        step.head<7>().cwiseAbs().cwiseQuotient(covariance.diagonal().head<7>().cwiseSqrt());
    result.converged = sigmas.maxCoeff() < kConvergedSigmas &&
                       std::abs(result.state.imu_late_s - given.state.imu_late_s) <
                           (1.0 - kConvergedSigmas) * kMostLatenessS;
  }
  return result;
}

// Where the gyroscope and the path agree best: lateness on a grid around the given one, and the
// rotation that fits the turns best. Too little turning leaves what is given.
LidarImuState coarse_start(const std::vector<PathRun>& runs, const ImuBuffer& imu,
                           const LidarImuState& given) {
  LidarImuState best = given;
  double least = std::numeric_limits<double>::infinity();
  for (double late = -kSearchS; late <= kSearchS + 1e-9; late += kSearchStepS) {
    Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
    std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> turns;  // of the lidar, of the IMU
    for (const PathRun& run : runs) {
      for (std::size_t k = 1; k < run.size(); ++k) {
        const TimeNs shift = from_seconds(given.imu_late_s + late);
        const auto samples = imu.slice(run[k - 1].stamp + shift, run[k].stamp + shift);
        if (samples.size() < 2) continue;
        const Preintegration motion = preintegrate(samples, Eigen::Vector3d::Zero(),
                                                   Eigen::Vector3d::Zero(), ImuNoiseConfig());
        const Eigen::Vector3d of_lidar = so3_log(run[k - 1].world_from_body.rotation().conjugate() *
                                                 run[k].world_from_body.rotation());
        turns.emplace_back(of_lidar, so3_log(motion.rotation));
        products += of_lidar * turns.back().second.transpose();
      }
    }
    const BestRotation rotation = best_rotation(products);
    if (!(rotation.extents[1] > kEnoughTurning)) return given;
    double sum = 0.0;
    for (const auto& [of_lidar, of_imu] : turns)
      sum += (of_lidar - rotation.rotation * of_imu).squaredNorm();
    if (sum >= least) continue;
    least = sum;
    best.imu_late_s = given.imu_late_s + late;
    best.lidar_from_imu = Pose(Eigen::Quaterniond(rotation.rotation).normalized(),
                               given.lidar_from_imu.translation());
  }
  return best;
}

// Gravity in the frame of the path: against the mean specific force.
Eigen::Vector3d mean_gravity(const std::vector<PathRun>& runs, const ImuBuffer& imu,
                             const LidarImuState& state) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double seconds = 0.0;
  const TimeNs late = from_seconds(state.imu_late_s);
  for (const PathRun& run : runs) {
    for (std::size_t k = 1; k < run.size(); ++k) {
      const auto samples = imu.slice(run[k - 1].stamp + late, run[k].stamp + late);
      if (samples.size() < 2) continue;
      const Preintegration motion =
          preintegrate(samples, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), ImuNoiseConfig());
      const Eigen::Quaterniond world_from_imu =
          run[k - 1].world_from_body.rotation() * state.lidar_from_imu.rotation();
      sum -= world_from_imu * motion.velocity;
      seconds += motion.duration;
    }
  }
  return sum / seconds;
}

// Makes `given` strong along the directions of three parameters that the fit does not tell.
int keep_directions(const Fit& fit, Eigen::Index first, double most_sd, Given& given) {
  const SymmetricEigen3 axes =
      symmetric_eigen(Eigen::Matrix3d(fit.covariance.block<3, 3>(first, first)));
  int kept = 0;
  for (Eigen::Index k = 0; k < 3; ++k) {
    if (axes.values[k] < most_sd * most_sd) continue;
    const Eigen::Vector3d axis = axes.vectors.col(k);
    given.information.block<3, 3>(first, first) += kKept * axis * axis.transpose();
    ++kept;
  }
  return kept;
}

// What the recording does not tell, as it is said; `given` keeps it.
std::vector<std::string> keep_unknown(const Fit& fit, Given& given) {
  std::vector<std::string> kept;
  const char* directions[] = {"", " in one direction", " in two directions", ""};
  if (const int count = keep_directions(fit, 0, kMostRotation, given); count > 0)
    kept.push_back(fmt::format(
        "the turn of the IMU{} was not found and stays as given: tilt the sensor to all sides, too",
        directions[count]));
  if (const int count = keep_directions(fit, 3, kMostPlaceM, given); count > 0)
    kept.push_back(fmt::format(
        "the place of the IMU{} was not found and stays as given: turn and tilt more quickly",
        directions[count]));
  if (std::sqrt(fit.covariance(kLatenessParameter, kLatenessParameter)) > kMostLatenessSdS) {
    given.information(kLatenessParameter, kLatenessParameter) += kKept;
    kept.push_back("the clock was not found and stays as given: turn more quickly");
  }
  return kept;
}

}  // namespace

LidarImuResult calibrate_lidar_imu(const std::vector<StampedPose>& world_from_lidar,
                                   const ImuBuffer& imu, const Pose& given_pose,
                                   double given_late_s) {
  LidarImuResult result;
  const std::vector<PathRun> runs =
      runs_with_imu(world_from_lidar, imu, given_late_s, kMostLatenessS);
  for (const PathRun& run : runs)
    result.duration_s += to_seconds(run.back().stamp - run.front().stamp);
  if (result.duration_s < kShortestPathS) {
    result.problem =
        fmt::format("expected at least {:.0f} s of a path with samples of the IMU, found {:.1f} s",
                    kShortestPathS, result.duration_s);
    return result;
  }
  LidarImuState start;
  start.lidar_from_imu = given_pose;
  start.imu_late_s = given_late_s;
  Given given = weakly_given(start);
  start = coarse_start(runs, imu, start);
  start.gravity = mean_gravity(runs, imu, start);
  given.state.gravity = start.gravity;
  Fit found = fit(runs, imu, start, given);
  result.lateness_found =
      std::sqrt(found.covariance(kLatenessParameter, kLatenessParameter)) <= kMostLatenessSdS;
  result.kept = keep_unknown(found, given);
  if (!result.kept.empty()) {
    const LidarImuState there = found.state;
    found = fit(runs, imu, there, given);
  }
  if (!found.converged) {
    result.problem =
        "path and IMU do not agree at any rotation and offset in reach: expected one machine, "
        "clocks within 0.3 s, and a path without jumps";
    return result;
  }
  result.lidar_from_imu = found.state.lidar_from_imu;
  result.imu_late_s = found.state.imu_late_s;
  result.gyro_bias = found.state.gyro_bias;
  result.accel_bias = found.state.accel_bias;
  result.covariance = kPathsAreWorse * found.covariance.topLeftCorner<7, 7>();
  return result;
}

}  // namespace understory
