#include "understory/calibration/lidar_imu/path_and_imu.h"

#include <algorithm>

#include "understory/calibration/calibration_constants.h"
#include "understory/odometry/imu/preintegration.h"
#include "understory/util/error.h"

namespace understory {

using namespace calibration_constants::path_and_imu;

namespace {

// What the IMU says of each step of a run.
using StepMotions = std::vector<Preintegration>;

StepMotions step_motions(const PathRun& run, const ImuBuffer& imu, const LidarImuState& state,
                         double later_s) {
  const TimeNs late = from_seconds(state.imu_late_s + later_s);
  StepMotions motions;
  motions.reserve(run.size() - 1);
  for (std::size_t k = 1; k < run.size(); ++k) {
    const auto samples = imu.slice(run[k - 1].stamp + late, run[k].stamp + late);
    UNDERSTORY_CHECK(samples.size() >= 2);
    motions.push_back(preintegrate(samples, state.gyro_bias, state.accel_bias, ImuNoiseConfig()));
  }
  return motions;
}

// The motion at other biases and axes, to first order.
Preintegration with_errors(const Preintegration& motion, const LidarImuState& state) {
  Eigen::Matrix<double, 6, 1> change;
  change << state.gyro_bias - motion.gyro_bias, state.accel_bias - motion.accel_bias;
  const Eigen::Matrix<double, 9, 1> moved = motion.by_bias * change;
  Preintegration corrected = motion;
  corrected.rotation =
      motion.rotation * so3_exp(moved.head<3>() + state.gyro_axes * so3_log(motion.rotation));
  corrected.velocity += moved.segment<3>(3) + state.accel_axes * motion.velocity;
  corrected.position += moved.tail<3>() + state.accel_axes * motion.position;
  return corrected;
}

struct ResidualValues {
  Eigen::VectorXd turns;
  Eigen::VectorXd velocities;
};

// Errors of the path at each pose by the bends: attitude in the frame of the IMU, place in that of
// the path. The third derivatives come from the IMU's turns and accelerations; the two poses at
// each end have none.
struct BendErrors {
  std::vector<Eigen::Vector3d> turns;
  std::vector<Eigen::Vector3d> places;
};

BendErrors bend_errors(const PathRun& run, const StepMotions& motions, const LidarImuState& state) {
  BendErrors errors{std::vector<Eigen::Vector3d>(run.size(), Eigen::Vector3d::Zero()),
                    std::vector<Eigen::Vector3d>(run.size(), Eigen::Vector3d::Zero())};
  if (state.turn_bend == 0.0 && state.place_bend == 0.0) return errors;
  std::vector<Eigen::Vector3d> rates;
  std::vector<Eigen::Vector3d> accelerations;  // those of gravity cancel in their difference
  for (std::size_t k = 0; k < motions.size(); ++k) {
    const Eigen::Quaterniond world_from_imu =
        run[k].world_from_body.rotation() * state.lidar_from_imu.rotation();
    rates.emplace_back(so3_log(motions[k].rotation) / motions[k].duration);
    accelerations.emplace_back(world_from_imu * motions[k].velocity / motions[k].duration);
  }
  for (std::size_t k = 2; k + 2 < run.size(); ++k) {
    const double step = motions[k].duration;
    errors.turns[k] =
        0.5 * state.turn_bend * step * (rates[k + 1] - rates[k] - rates[k - 1] + rates[k - 2]);
    errors.places[k] = state.place_bend * step * step * (accelerations[k] - accelerations[k - 1]);
  }
  return errors;
}

ResidualValues residual_values(const PathRun& run, const StepMotions& motions,
                               const LidarImuState& state) {
  const std::size_t steps = motions.size();
  ResidualValues values{Eigen::VectorXd(3 * static_cast<Eigen::Index>(steps)),
                        Eigen::VectorXd(3 * static_cast<Eigen::Index>(steps - 1))};
  const BendErrors bends = bend_errors(run, motions, state);
  Eigen::Vector3d velocity_before = Eigen::Vector3d::Zero();
  Eigen::Vector3d gained_before = Eigen::Vector3d::Zero();
  double duration_before = 0.0;
  for (std::size_t k = 0; k < steps; ++k) {
    const auto row = 3 * static_cast<Eigen::Index>(k);
    const Preintegration motion = with_errors(motions[k], state);
    const Pose from = run[k].world_from_body * state.lidar_from_imu;
    const Pose to = run[k + 1].world_from_body * state.lidar_from_imu;
    values.turns.segment<3>(row) =
        so3_log(motion.rotation.conjugate() * (from.rotation().conjugate() * to.rotation())) -
        (bends.turns[k + 1] - bends.turns[k]);
    // The mean velocity over a step is that at its start plus g D / 2 + R P / D.
    const double duration = motion.duration;
    const Eigen::Vector3d velocity =
        (to.translation() - bends.places[k + 1] - (from.translation() - bends.places[k])) /
        duration;
    const Eigen::Vector3d in_step = from.rotation() * (motion.position / duration);
    if (k > 0) {
      values.velocities.segment<3>(row - 3) = velocity - velocity_before -
                                              0.5 * (duration + duration_before) * state.gravity -
                                              gained_before - in_step;
    }
    velocity_before = velocity;
    gained_before = from.rotation() * motion.velocity - in_step;
    duration_before = duration;
  }
  return values;
}

// Steps by which derivatives are found: small beside the noise, large beside rounding.
double derivative_step(Eigen::Index parameter) {
  return parameter == kLatenessParameter ? kLatenessStepS : kDerivativeStep;
}

bool covered(const ImuBuffer& imu, TimeNs from, TimeNs to) {
  return imu.slice(from, to).size() >= 2;
}

}  // namespace

LidarImuState stepped(const LidarImuState& state, const LidarImuStep& step) {
  LidarImuState next = state;
  next.lidar_from_imu = Pose(state.lidar_from_imu.rotation() * so3_exp(step.head<3>()),
                             state.lidar_from_imu.translation() + step.segment<3>(3));
  next.imu_late_s += step[kLatenessParameter];
  next.gyro_bias += step.segment<3>(7);
  next.accel_bias += step.segment<3>(10);
  next.gravity += step.segment<3>(13);
  next.gyro_axes += step.segment<9>(16).reshaped(3, 3);
  next.accel_axes += step.segment<9>(25).reshaped(3, 3);
  next.turn_bend += step[34];
  next.place_bend += step[35];
  return next;
}

std::vector<PathRun> runs_with_imu(const std::vector<StampedPose>& world_from_lidar,
                                   const ImuBuffer& imu, double imu_late_s, double latest_s) {
  const TimeNs early = from_seconds(imu_late_s - latest_s);
  const TimeNs late = from_seconds(imu_late_s + latest_s);
  std::vector<PathRun> runs;
  PathRun run;
  const auto end_run = [&] {
    if (run.size() >= kFewestPoses) runs.push_back(run);
    run.clear();
  };
  for (const StampedPose& pose : world_from_lidar) {
    const bool goes_on = !run.empty() && pose.stamp > run.back().stamp &&
                         to_seconds(pose.stamp - run.back().stamp) < kLongestStepS &&
                         covered(imu, run.back().stamp + early, pose.stamp + late);
    if (!goes_on || run.size() == kMostPoses) {
      const bool full = goes_on;
      const StampedPose last = run.empty() ? pose : run.back();
      end_run();
      if (full) run.push_back(last);
    }
    run.push_back(pose);
  }
  end_run();
  return runs;
}

LidarImuResiduals lidar_imu_residuals(const PathRun& run, const ImuBuffer& imu,
                                      const LidarImuState& state) {
  const StepMotions motions = step_motions(run, imu, state, 0.0);
  const ResidualValues values = residual_values(run, motions, state);
  LidarImuResiduals residuals;
  residuals.turns.values = values.turns;
  residuals.velocities.values = values.velocities;
  residuals.turns.by_step.resize(values.turns.size(), kLidarImuParameters);
  residuals.velocities.by_step.resize(values.velocities.size(), kLidarImuParameters);
  for (Eigen::Index k = 0; k < kLidarImuParameters; ++k) {
    const double size = derivative_step(k);
    const auto beside = [&](double sign) {
      LidarImuStep step = LidarImuStep::Zero();
      step[k] = sign * size;
      if (k != kLatenessParameter) return residual_values(run, motions, stepped(state, step));
      return residual_values(run, step_motions(run, imu, state, step[k]), state);
    };
    const ResidualValues more = beside(1.0);
    const ResidualValues less = beside(-1.0);
    residuals.turns.by_step.col(k) = (more.turns - less.turns) / (2.0 * size);
    residuals.velocities.by_step.col(k) = (more.velocities - less.velocities) / (2.0 * size);
  }
  return residuals;
}

}  // namespace understory
