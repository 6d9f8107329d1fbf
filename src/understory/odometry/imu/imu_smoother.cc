#include "understory/odometry/imu/imu_smoother.h"

#include <algorithm>
#include <cmath>

#include "understory/geometry/pose_io.h"
#include "understory/geometry/rotation_between.h"
#include "understory/odometry/dense/match_gate.h"
#include "understory/odometry/imu/imu_sums.h"
#include "understory/odometry/imu/initial_state.h"
#include "understory/odometry/odometry_constants.h"

namespace understory {
namespace {

using namespace odometry_constants::imu_smoother;

constexpr TimeNs kHistory = 2 * kNsPerSecond;  // of the IMU, kept before the first scan

}  // namespace

ImuSmoother::ImuSmoother(const MotionConfig& config, const Pose& body_from_imu, Log* log)
    : config_(config),
      body_from_imu_(body_from_imu),
      log_(log),
      buffer_(config.imu, log),
      window_({config.window, config.iterations, config.imu}),
      watch_(config.imu.gravity_m_s2, log) {}

void ImuSmoother::add_imu(const ImuSample& sample) {
  buffer_.add(sample);
  if (!window_.started()) buffer_.forget_before(sample.stamp - kHistory);
}

const ImuState& ImuSmoother::latest() const {
  return isam_ ? isam_->latest() : window_.latest();
}
const Matrix15d& ImuSmoother::covariance() const {
  return isam_ ? isam_->covariance() : window_.covariance();
}
Eigen::Vector3d ImuSmoother::gravity() const {
  return isam_ ? isam_->gravity() : window_.gravity();
}

MotionPredictor ImuSmoother::predictor() const {
  return {config_, use_imu() ? &buffer_ : nullptr, gravity()};
}

MotionPrediction ImuSmoother::predict_full(TimeNs t) const {
  if (!window_.started()) return {};
  return predictor().predict({latest(), angular_rate_, covariance().topLeftCorner<9, 9>()}, t);
}

NavState ImuSmoother::to_nav(const MotionPrediction& prediction) const {
  return body_state(prediction, body_from_imu_);
}

NavState ImuSmoother::predict(TimeNs t) const {
  NavState nav = to_nav(predict_full(t));
  if (!window_.started()) nav.stamp = t;
  return nav;
}

std::vector<StampedPose> ImuSmoother::predict_path(TimeNs from, TimeNs to) const {
  MotionPrediction start = predict_full(from);
  std::optional<Eigen::Vector3d> fixed_velocity;
  if (!window_.started()) {
    // Nothing is known yet but how the sensor turns: enough to deskew the first scan.
    start.state.world_from_imu = body_from_imu_;
    const auto samples = buffer_.samples(from - kHistory, to);
    if (is_still(samples, config_.imu)) {
      for (const InertialSample& s : samples)
        start.state.gyro_bias += s.angular_rate() / static_cast<double>(samples.size());
    }
    fixed_velocity = initial_velocity_.value_or(Eigen::Vector3d::Zero());
  }
  start.state.stamp = from;
  const Pose imu_from_body = body_from_imu_.inverse();
  std::vector<StampedPose> path;
  for (const ImuState& state : predictor().path(start, to, fixed_velocity))
    path.push_back({state.stamp, state.world_from_imu * imu_from_body});
  return path;
}

void ImuSmoother::set_initial_motion(const Eigen::Vector3d& velocity_m_s,
                                     const Eigen::Vector3d& angular_rate_rad_s) {
  initial_velocity_ = velocity_m_s;
  if (!use_imu()) angular_rate_ = angular_rate_rad_s;
}

void ImuSmoother::take_over(const NavState& state) {
  ImuState start;
  start.stamp = state.stamp;
  start.world_from_imu = state.world_from_body * body_from_imu_;
  start.velocity = state.velocity_in_world;  // but for the lever arm
  InitialUncertainty sigma;
  const Eigen::Vector<double, 6> sigmas =
      state.pose_covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  sigma.rotation_rad = std::max(sigmas.head<3>().maxCoeff(), sigma.rotation_rad);
  sigma.position_m = std::max(sigmas.tail<3>().maxCoeff(), sigma.position_m);
  sigma.velocity_m_s = 1.0;
  sigma.gyro_bias_rad_s = config_.imu.gyro_bias_sigma_rad_s;
  sigma.accel_bias_m_s2 = config_.imu.accel_bias_sigma_m_s2;
  window_.start(start, Eigen::Vector3d::UnitZ(), sigma);
  how_ = Initialisation::kNoImu;
  buffer_.forget_before(state.stamp);
}

MotionUpdate ImuSmoother::begin(TimeNs stamp) {
  const auto samples = buffer_.samples(stamp - kHistory, stamp + kHistory);
  InitialState initial = find_initial_state(samples, stamp, body_from_imu_, config_.imu);
  if (initial_velocity_) {
    const Pose world_from_body = initial.state.world_from_imu * body_from_imu_.inverse();
    initial.state.velocity = world_from_body.rotation() * *initial_velocity_;
    initial.sigma.velocity_m_s = 0.5;
  }
  window_.start(initial.state, initial.up_in_world, initial.sigma);
  how_ = initial.how;
  if (how_ != Initialisation::kNoImu) vertical_since_ = stamp;
  buffer_.forget_before(stamp);
  MotionUpdate update;
  update.status = MotionStatus::kAccepted;
  update.state = to_nav(predict_full(stamp));
  return update;
}

MotionInterval ImuSmoother::make_interval(TimeNs from, TimeNs to) const {
  MotionInterval interval;
  if (use_imu()) interval.samples = buffer_.slice(from, to);
  interval.motion = interval.samples.empty() ? coast(to_seconds(to - from), angular_rate_, config_)
                                             : preintegrate(interval.samples, latest().gyro_bias,
                                                            latest().accel_bias, config_.imu);
  return interval;
}

void ImuSmoother::learn_vertical(const MotionInterval& interval) {
  if (vertical_since_ || interval.samples.empty() || isam_) return;
  const Eigen::Vector3d force = mean_force(interval.samples);
  if (force.norm() == 0.0) return;
  window_.set_up((latest().world_from_imu.rotation() * force).normalized());
  vertical_since_ = latest().stamp;
  how_ = Initialisation::kInMotion;
}

void ImuSmoother::add_state(TimeNs stamp, const MotionInterval& interval,
                            const std::optional<PoseFactor>& lidar) {
  if (isam_) {
    isam_->add(stamp, interval, lidar);
  } else {
    window_.add(stamp, interval, lidar);
  }
}

void ImuSmoother::watch_imu(TimeNs stamp, const MotionInterval& interval,
                            const std::optional<PoseFactor>& lidar) {
  if (lidar) {
    watch_.pass_time(stamp);
    // An IMU on probation is not in the interval, but it is looked at.
    std::vector<InertialSample> apart;
    if (watch_.on_probation()) apart = buffer_.slice(latest().stamp, stamp);
    const std::vector<InertialSample>& samples = apart.empty() ? interval.samples : apart;
    const double sigma = std::sqrt(lidar->covariance.diagonal().head<3>().maxCoeff());
    const ImuMatch match{stamp, lidar->world_from_imu, sigma};
    if (last_match_ && last_match_->stamp == latest().stamp && !samples.empty())
      watch_.compare(*last_match_, match, samples);
    last_match_ = match;
  }
  if (buffer_.ever_filled()) watch_.note_samples(!interval.samples.empty(), latest().stamp, stamp);
}

// Scan matches have contradicted the prediction for long, or the IMU turned out to be unusable.
// Nothing that the estimate says of the motion is then worth keeping.
void ImuSmoother::restart_at(TimeNs stamp, const PoseFactor& lidar, const MatchMotion& motion) {
  restarted_ = stamp;
  ImuState state = latest();
  state.stamp = stamp;
  state.world_from_imu = lidar.world_from_imu;
  state.velocity = motion.velocity;
  InitialUncertainty sigma;
  sigma.rotation_rad = std::sqrt(lidar.covariance.diagonal().head<3>().maxCoeff());
  sigma.position_m = std::sqrt(lidar.covariance.diagonal().tail<3>().maxCoeff());
  sigma.velocity_m_s = 1.0;
  sigma.gyro_bias_rad_s = config_.imu.gyro_bias_sigma_rad_s;
  sigma.accel_bias_m_s2 = config_.imu.accel_bias_sigma_m_s2;
  if (!use_imu()) {
    state.gyro_bias.setZero();
    state.accel_bias.setZero();
  }
  const Eigen::Vector3d up = -gravity().normalized();
  isam_.reset();
  window_.start(state, up, sigma);
}

void ImuSmoother::note_residual(const MotionPrediction& predicted, const PoseFactor& lidar) {
  const Vector6d variance = predicted.covariance.diagonal().head<6>() + lidar.covariance.diagonal();
  residual_scale_.add((predicted.state.world_from_imu.inverse() * lidar.world_from_imu).log(),
                      variance);
}

MotionUpdate ImuSmoother::add_matched(TimeNs stamp, const MotionInterval& interval,
                                      const PoseFactor& lidar, const MatchMotion& match_motion) {
  const ImuState before = latest();
  const MotionPrediction predicted = predict_full(stamp);
  const WindowSmoother backup = window_;
  add_state(stamp, interval, lidar);
  MotionUpdate update;
  update.status = MotionStatus::kAccepted;
  // Constant velocity does not refute a match: a walker's quick turn would be dropped.
  const bool previous = config_.velocity_gate_reference == VelocityGateReference::kPreviousState;
  if (!interval.samples.empty() || previous) {
    const GateVerdict verdict =
        judge_match(config_, before, predicted, latest(), lidar.world_from_imu, lidar.covariance);
    update.reason = verdict.reason;
    update.velocity_jump_m_s = verdict.velocity_jump_m_s;
  }
  if (update.reason.empty()) {
    dropped_in_a_row_ = 0;
    if (!interval.samples.empty()) note_residual(predicted, lidar);
    return update;
  }
  if (dropped_in_a_row_ >= config_.velocity_gate_patience && !watch_.vouched_for(stamp)) {
    dropped_in_a_row_ = 0;
    watch_.suspect(stamp);
    restart_at(stamp, lidar, match_motion);
    update.reason.clear();
    if (log_ != nullptr)
      log_->warn("odometry.restart",
                 "scan matching keeps contradicting the prediction; the estimate of "
                 "the motion starts anew at " +
                     format_seconds(stamp) + " s");
    return update;
  }
  update.status = MotionStatus::kVelocityGate;
  ++dropped_in_a_row_;
  if (isam_) {
    isam_->drop_latest_lidar();
  } else {
    window_ = backup;
    add_state(stamp, interval, std::nullopt);
  }
  return update;
}

ImuSmoother::MatchMotion ImuSmoother::motion_since_last_match(TimeNs stamp,
                                                              const Pose& world_from_imu) const {
  const Pose& from = last_match_->world_from_imu;
  const double seconds = to_seconds(stamp - last_match_->stamp);
  return {(world_from_imu.translation() - from.translation()) / seconds,
          so3_log(from.rotation().conjugate() * world_from_imu.rotation()) / seconds};
}

MotionUpdate ImuSmoother::add_scan(TimeNs stamp, const std::optional<LidarFactor>& factor) {
  if (!window_.started()) return begin(stamp);
  const ImuState before = latest();
  if (stamp <= before.stamp) {
    MotionUpdate update{MotionStatus::kIgnored, "scan not after the last one", {}, 0.0, {}};
    update.state = to_nav(predict_full(before.stamp));
    return update;
  }
  std::optional<PoseFactor> lidar;
  bool matched = false;
  MatchMotion match_motion{before.velocity, angular_rate_};
  if (factor) {
    const Matrix6d adjoint = body_from_imu_.inverse().adjoint();
    lidar = PoseFactor{factor->world_from_body * body_from_imu_,
                       adjoint * lidar_covariance(*factor, config_.lidar) * adjoint.transpose()};
    matched = !factor->covariance;
    if (matched && last_match_)
      match_motion = motion_since_last_match(stamp, lidar->world_from_imu);
  }
  MotionInterval interval = make_interval(before.stamp, stamp);
  const bool was_usable = use_imu();
  watch_imu(stamp, interval, matched ? lidar : std::nullopt);

  MotionUpdate update;
  if (was_usable != use_imu()) {
    restart_at(stamp, *lidar, match_motion);
    update.status = MotionStatus::kAccepted;
  } else {
    learn_vertical(interval);
    if (matched) {
      update = add_matched(stamp, interval, *lidar, match_motion);
    } else if (lidar) {
      // A pose by other sensors has its own covariance, and jumps within it.
      add_state(stamp, interval, lidar);
      update.status = MotionStatus::kAccepted;
    } else {
      update.reason = "no match";
      add_state(stamp, interval, std::nullopt);
    }
  }
  const Eigen::Quaterniond turned =
      before.world_from_imu.rotation().conjugate() * latest().world_from_imu.rotation();
  // A restart corrects the attitude. What it corrects is no motion.
  angular_rate_ = restarted_ == stamp ? match_motion.angular_rate
                                      : so3_log(turned) / to_seconds(stamp - before.stamp);
  buffer_.forget_before(stamp);
  if (config_.level_world) level(update);
  hand_over_to_isam();
  MotionPrediction now = predict_full(stamp);
  if (!interval.samples.empty() && use_imu())
    now.angular_rate = interval.samples.back().angular_rate() - now.state.gyro_bias;
  if (config_.covariance_from_residuals && matched && update.status == MotionStatus::kAccepted &&
      !interval.samples.empty()) {
    now.covariance.topLeftCorner<6, 6>() =
        residual_scale_.scaled(now.covariance.topLeftCorner<6, 6>());
  }
  update.state = to_nav(now);
  return update;
}

void ImuSmoother::level(MotionUpdate& update) {
  if (levelled_ || !vertical_since_ || isam_ || !use_imu()) return;
  const double age = to_seconds(latest().stamp - *vertical_since_);
  const double sigma = std::sqrt(window_.tilt_covariance().diagonal().maxCoeff());
  if (age < kLevelFirstS || (age < kLevelLastS && sigma > kLevelSigma)) return;
  levelled_ = true;
  const Eigen::Quaterniond rotation = level_from_world();
  if (Pose(rotation, Eigen::Vector3d::Zero()).angle() < kLevelSmallest) return;
  const Pose moved(rotation, Eigen::Vector3d::Zero());
  move_world(moved);
  update.new_world_from_old_world = moved;
}

void ImuSmoother::hand_over_to_isam() {
  if (config_.method != SmootherMethod::kIsam2 || isam_ || !vertical_since_) return;
  if (to_seconds(latest().stamp - *vertical_since_) < kLevelLastS) return;
  isam_ =
      std::make_unique<Isam2Smoother>(Isam2Smoother::Config{config_.isam2_restart, config_.imu},
                                      window_.latest(), window_.covariance(), window_.gravity());
}

Eigen::Quaterniond ImuSmoother::level_from_world() const {
  if (!vertical_since_ || !use_imu()) return Eigen::Quaterniond::Identity();
  return rotation_between(-gravity(), Eigen::Vector3d::UnitZ());
}

void ImuSmoother::move_world(const Pose& new_world_from_old_world) {
  if (!window_.started()) return;
  window_.move_world(new_world_from_old_world);
  if (isam_) isam_->move_world(new_world_from_old_world);
  if (last_match_)
    last_match_->world_from_imu = new_world_from_old_world * last_match_->world_from_imu;
}

void ImuSmoother::save(BinaryWriter& writer) const {
  buffer_.save(writer);
  writer.put(window_.started());
  if (!window_.started()) return;
  window_.save(writer);
  writer.put(isam_ != nullptr);
  if (isam_) isam_->save(writer);
  watch_.save(writer);
  writer.put(how_);
  writer.put_doubles(angular_rate_.data(), 3);
  writer.put(vertical_since_.has_value());
  writer.put(vertical_since_.value_or(0));
  writer.put(levelled_);
  writer.put(dropped_in_a_row_);
  writer.put(last_match_.has_value());
  writer.put(last_match_ ? last_match_->stamp : TimeNs{0});
  put_pose(writer, last_match_ ? last_match_->world_from_imu : Pose());
  writer.put(last_match_ ? last_match_->rotation_sigma_rad : 0.0);
  residual_scale_.save(writer);
}

void ImuSmoother::load(BinaryReader& reader) {
  buffer_.load(reader);
  if (!reader.get<bool>()) return;
  window_.load(reader);
  if (reader.get<bool>()) {
    isam_ = std::make_unique<Isam2Smoother>(
        Isam2Smoother::Config{config_.isam2_restart, config_.imu}, reader);
  }
  watch_.load(reader);
  how_ = reader.get_enum(Initialisation::kNoImu);
  reader.get_doubles(angular_rate_.data(), 3);
  const bool vertical = reader.get<bool>();
  const auto since = reader.get<TimeNs>();
  vertical_since_ = vertical ? std::optional<TimeNs>(since) : std::nullopt;
  levelled_ = reader.get<bool>();
  dropped_in_a_row_ = reader.get<int>();
  const bool matched = reader.get<bool>();
  const auto stamp = reader.get<TimeNs>();
  const Pose pose = get_pose(reader);
  const auto sigma = reader.get<double>();
  if (matched) last_match_ = ImuMatch{stamp, pose, sigma};
  residual_scale_.load(reader);
}

std::unique_ptr<MotionModel> make_imu_smoother(const MotionConfig& config, const Rig& rig,
                                               Log* log) {
  UNDERSTORY_CHECK(rig.body_from_imu.has_value());
  return std::make_unique<ImuSmoother>(config, *rig.body_from_imu, log);
}

std::unique_ptr<MotionModel> make_constant_velocity_model(const MotionConfig& config, Log* log) {
  // Without samples the smoother is the constant-velocity model: one code, one behaviour when the
  // IMU falls silent and when there is none.
  return std::make_unique<ImuSmoother>(config, Pose(), log);
}

}  // namespace understory
