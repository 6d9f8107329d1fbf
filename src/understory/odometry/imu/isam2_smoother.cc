#include "understory/odometry/imu/isam2_smoother.h"

#include <gtsam/geometry/Pose3.h>
#include <gtsam/inference/Symbol.h>
#include <gtsam/navigation/ImuFactor.h>
#include <gtsam/nonlinear/ISAM2.h>
#include <gtsam/nonlinear/PriorFactor.h>
#include <gtsam/slam/BetweenFactor.h>

#include "understory/geometry/pose_io.h"

namespace understory {
namespace {

using gtsam::symbol_shorthand::B;
using gtsam::symbol_shorthand::V;
using gtsam::symbol_shorthand::X;
using Bias = gtsam::imuBias::ConstantBias;

gtsam::Pose3 to_gtsam(const Pose& pose) {
  return {gtsam::Rot3(pose.rotation()), pose.translation()};
}

Pose from_gtsam(const gtsam::Pose3& pose) {
  return {pose.rotation().toQuaternion(), pose.translation()};
}

// GTSAM orders the bias accelerometer first.
Bias to_bias(const ImuState& state) {
  return {state.accel_bias, state.gyro_bias};
}

gtsam::SharedNoiseModel gaussian(const gtsam::Matrix& covariance) {
  return gtsam::noiseModel::Gaussian::Covariance(covariance);
}

// The joint belief in one state as a linear factor on its pose, velocity and bias. It is the
// marginal of the part of the history that was left behind. A nonlinear factor, because iSAM2
// relinearises.
class StatePrior : public gtsam::NoiseModelFactor3<gtsam::Pose3, gtsam::Vector3, Bias> {
 public:
  StatePrior(std::size_t k, const ImuState& state, const Matrix15d& covariance)
      : NoiseModelFactor3(gaussian(covariance), X(k), V(k), B(k)), state_(state) {}

  gtsam::Vector evaluateError(const gtsam::Pose3& pose, const gtsam::Vector3& velocity,
                              const Bias& bias, boost::optional<gtsam::Matrix&> by_pose,
                              boost::optional<gtsam::Matrix&> by_velocity,
                              boost::optional<gtsam::Matrix&> by_bias) const override {
    ImuState now;
    now.world_from_imu = from_gtsam(pose);
    now.velocity = velocity;
    now.gyro_bias = bias.gyroscope();
    now.accel_bias = bias.accelerometer();
    const Matrix15d jacobian = local_jacobian(state_, now);
    if (by_pose) *by_pose = jacobian.leftCols<6>();
    if (by_velocity) *by_velocity = jacobian.middleCols<3>(6);
    if (by_bias) {
      by_bias->setZero(15, 6);
      by_bias->block<3, 3>(9, 3).setIdentity();
      by_bias->block<3, 3>(12, 0).setIdentity();
    }
    return local(state_, now);
  }

 private:
  ImuState state_;
};

// Constant velocity where the IMU is silent.
class CoastFactor
    : public gtsam::NoiseModelFactor4<gtsam::Pose3, gtsam::Vector3, gtsam::Pose3, gtsam::Vector3> {
 public:
  CoastFactor(std::size_t k, const Preintegration& motion)
      : NoiseModelFactor4(gaussian(motion.covariance), X(k), V(k), X(k + 1), V(k + 1)),
        motion_(motion) {}

  gtsam::Vector evaluateError(const gtsam::Pose3& pose_i, const gtsam::Vector3& velocity_i,
                              const gtsam::Pose3& pose_j, const gtsam::Vector3& velocity_j,
                              boost::optional<gtsam::Matrix&> h1,
                              boost::optional<gtsam::Matrix&> h2,
                              boost::optional<gtsam::Matrix&> h3,
                              boost::optional<gtsam::Matrix&> h4) const override {
    ImuState from;
    ImuState to;
    from.world_from_imu = from_gtsam(pose_i);
    from.velocity = velocity_i;
    to.world_from_imu = from_gtsam(pose_j);
    to.velocity = velocity_j;
    const MotionResidual r = motion_residual(from, to, motion_, Eigen::Vector3d::Zero());
    if (h1) *h1 = r.by_from.leftCols<6>();
    if (h2) *h2 = r.by_from.middleCols<3>(6);
    if (h3) *h3 = r.by_to.leftCols<6>();
    if (h4) *h4 = r.by_to.middleCols<3>(6);
    return r.error;
  }

 private:
  Preintegration motion_;
};

gtsam::ISAM2Params isam_params() {
  gtsam::ISAM2Params params;
  params.relinearizeThreshold = 0.001;
  params.relinearizeSkip = 1;
  params.factorization = gtsam::ISAM2Params::CHOLESKY;
  params.findUnusedFactorSlots = true;
  return params;
}

}  // namespace

struct Isam2Smoother::Graph {
  gtsam::ISAM2 isam{isam_params()};
  std::size_t last = 0;                            // number of the latest state
  std::optional<gtsam::FactorIndex> latest_lidar;  // to take it out again
  boost::shared_ptr<gtsam::PreintegrationParams> params;
};

Isam2Smoother::Isam2Smoother(const Config& config, const ImuState& state,
                             const Matrix15d& covariance, const Eigen::Vector3d& gravity)
    : config_(config), gravity_(gravity) {
  start(state, covariance);
}

Isam2Smoother::~Isam2Smoother() = default;

void Isam2Smoother::start(const ImuState& state, const Matrix15d& covariance) {
  start_state_ = state;
  start_covariance_ = 0.5 * (covariance + covariance.transpose());
  steps_.clear();
  latest_ = state;
  covariance_ = start_covariance_;
  graph_ = std::make_unique<Graph>();
  const ImuNoiseConfig& imu = config_.imu;
  graph_->params = boost::make_shared<gtsam::PreintegrationParams>(gravity_);
  const auto unit = gtsam::I_3x3;
  graph_->params->gyroscopeCovariance =
      unit * imu.gyro_noise_rad_s_sqrt_hz * imu.gyro_noise_rad_s_sqrt_hz;
  graph_->params->accelerometerCovariance =
      unit * imu.accel_noise_m_s2_sqrt_hz * imu.accel_noise_m_s2_sqrt_hz;
  graph_->params->integrationCovariance = unit * 1e-8;

  gtsam::NonlinearFactorGraph factors;
  factors.emplace_shared<StatePrior>(0, start_state_, start_covariance_);
  gtsam::Values values;
  values.insert(X(0), to_gtsam(state.world_from_imu));
  values.insert(V(0), gtsam::Vector3(state.velocity));
  values.insert(B(0), to_bias(state));
  graph_->isam.update(factors, values);
}

void Isam2Smoother::apply(const Step& step) {
  const std::size_t i = graph_->last;
  const std::size_t j = i + 1;
  const Preintegration& motion = step.interval.motion;
  gtsam::NonlinearFactorGraph factors;
  if (step.interval.samples.empty()) {
    factors.emplace_shared<CoastFactor>(i, motion);
  } else {
    gtsam::PreintegratedImuMeasurements sum(graph_->params, to_bias(latest_));
    const auto& samples = step.interval.samples;
    for (std::size_t s = 1; s < samples.size(); ++s) {
      const double dt = to_seconds(samples[s].stamp - samples[s - 1].stamp);
      if (dt <= 0.0) continue;
      sum.integrateMeasurement(
          0.5 * (samples[s - 1].specific_force() + samples[s].specific_force()),
          0.5 * (samples[s - 1].angular_rate() + samples[s].angular_rate()), dt);
    }
    factors.emplace_shared<gtsam::ImuFactor>(X(i), V(i), X(j), V(j), B(i), sum);
  }
  const double gyro = config_.imu.gyro_bias_walk_rad_s2_sqrt_hz * std::sqrt(motion.duration);
  const double accel = config_.imu.accel_bias_walk_m_s3_sqrt_hz * std::sqrt(motion.duration);
  gtsam::Vector6 walk;
  walk << gtsam::Vector3::Constant(accel), gtsam::Vector3::Constant(gyro);
  factors.emplace_shared<gtsam::BetweenFactor<Bias>>(B(i), B(j), Bias(),
                                                     gtsam::noiseModel::Diagonal::Sigmas(walk));
  if (step.lidar) {
    factors.emplace_shared<gtsam::PriorFactor<gtsam::Pose3>>(
        X(j), to_gtsam(step.lidar->world_from_imu), gaussian(step.lidar->covariance));
  }
  const ImuState predicted = predict_state(latest_, motion, step.stamp, gravity_);
  gtsam::Values values;
  values.insert(X(j), to_gtsam(predicted.world_from_imu));
  values.insert(V(j), gtsam::Vector3(predicted.velocity));
  values.insert(B(j), to_bias(predicted));
  const gtsam::ISAM2Result result = graph_->isam.update(factors, values);
  graph_->latest_lidar.reset();
  if (step.lidar) graph_->latest_lidar = result.newFactorsIndices.back();
  graph_->last = j;
  read_estimate(step.stamp);
}

void Isam2Smoother::read_estimate(TimeNs stamp) {
  const std::size_t k = graph_->last;
  latest_.stamp = stamp;
  latest_.world_from_imu = from_gtsam(graph_->isam.calculateEstimate<gtsam::Pose3>(X(k)));
  latest_.velocity = graph_->isam.calculateEstimate<gtsam::Vector3>(V(k));
  const auto bias = graph_->isam.calculateEstimate<Bias>(B(k));
  latest_.gyro_bias = bias.gyroscope();
  latest_.accel_bias = bias.accelerometer();
  // The covariances between pose, velocity and bias of one state are left out, as LIO-SAM does.
  covariance_.setZero();
  covariance_.topLeftCorner<6, 6>() = graph_->isam.marginalCovariance(X(k));
  covariance_.block<3, 3>(6, 6) = graph_->isam.marginalCovariance(V(k));
  const gtsam::Matrix bias_covariance = graph_->isam.marginalCovariance(B(k));
  covariance_.block<3, 3>(9, 9) = bias_covariance.bottomRightCorner<3, 3>();
  covariance_.block<3, 3>(12, 12) = bias_covariance.topLeftCorner<3, 3>();
}

void Isam2Smoother::add(TimeNs stamp, const MotionInterval& interval,
                        const std::optional<PoseFactor>& lidar) {
  if (steps_.size() >= static_cast<std::size_t>(config_.restart)) {
    const ImuState state = latest_;
    const Matrix15d covariance = covariance_;
    start(state, covariance);
  }
  steps_.push_back({stamp, interval, lidar, false});
  apply(steps_.back());
}

void Isam2Smoother::drop_latest_lidar() {
  if (steps_.empty() || !graph_->latest_lidar) return;
  steps_.back().dropped = true;
  apply_drop();
}

void Isam2Smoother::apply_drop() {
  graph_->isam.update(gtsam::NonlinearFactorGraph(), gtsam::Values(),
                      gtsam::FactorIndices{*graph_->latest_lidar});
  graph_->latest_lidar.reset();
  read_estimate(steps_.back().stamp);
}

void Isam2Smoother::move_world(const Pose& new_from_old) {
  ImuState state = latest_;
  state.world_from_imu = new_from_old * state.world_from_imu;
  state.velocity = new_from_old.rotation() * state.velocity;
  gravity_ = new_from_old.rotation() * gravity_;
  Matrix15d turn = Matrix15d::Identity();
  turn.block<3, 3>(6, 6) = new_from_old.rotation_matrix();
  const Matrix15d covariance = turn * covariance_ * turn.transpose();
  start(state, covariance);
}

void Isam2Smoother::save(BinaryWriter& writer) const {
  put_state(writer, start_state_);
  writer.put_doubles(start_covariance_.data(), 15 * 15);
  writer.put_doubles(gravity_.data(), 3);
  writer.put(static_cast<std::uint64_t>(steps_.size()));
  for (const Step& step : steps_) {
    writer.put(step.stamp);
    put_interval(writer, step.interval);
    writer.put(step.dropped);
    writer.put(step.lidar.has_value());
    const PoseFactor lidar = step.lidar.value_or(PoseFactor());
    put_pose(writer, lidar.world_from_imu);
    writer.put_doubles(lidar.covariance.data(), 36);
  }
}

Isam2Smoother::Isam2Smoother(const Config& config, BinaryReader& reader) : config_(config) {
  const ImuState state = get_state(reader);
  Matrix15d covariance;
  reader.get_doubles(covariance.data(), 15 * 15);
  reader.get_doubles(gravity_.data(), 3);
  start(state, covariance);
  const auto count = reader.get<std::uint64_t>();
  for (std::uint64_t k = 0; k < count; ++k) {
    Step step;
    step.stamp = reader.get<TimeNs>();
    step.interval = get_interval(reader);
    step.dropped = reader.get<bool>();
    const bool matched = reader.get<bool>();
    PoseFactor lidar;
    lidar.world_from_imu = get_pose(reader);
    reader.get_doubles(lidar.covariance.data(), 36);
    if (matched) step.lidar = lidar;
    steps_.push_back(step);
    apply(steps_.back());
    if (step.dropped) apply_drop();
  }
}

}  // namespace understory
