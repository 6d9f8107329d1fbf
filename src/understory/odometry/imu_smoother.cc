#include "understory/odometry/imu_smoother.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "understory/geometry/pose_io.h"
#include "understory/odometry/imu_sums.h"
#include "understory/odometry/initial_state.h"

namespace understory {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr TimeNs kHistory = 2 * kNsPerSecond;  // of the IMU, kept before the first scan
// The world is levelled once its tilt is known this well, or after this long.
constexpr double kLevelSigma = 0.1 * kDegree;
constexpr double kLevelFirstS = 1.0;
constexpr double kLevelLastS = 3.0;
constexpr double kLevelSmallest = 0.02 * kDegree;
constexpr double kPathStepS = 0.02;  // between poses where constant velocity stands in

}  // namespace

ImuSmoother::ImuSmoother(const MotionConfig& config, const Pose& body_from_imu, Log* log)
    : config_(config),
      body_from_imu_(body_from_imu),
      log_(log),
      buffer_(config.imu, log),
      window_({config.window, config.iterations, config.imu}),
      monitor_(config.imu.gravity_m_s2) {}

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

Preintegration ImuSmoother::coast(double duration, const Eigen::Vector3d& angular_rate) const {
  return constant_velocity_interval(duration, angular_rate, config_.motion_accel_sigma_m_s2,
                                    config_.motion_angular_accel_sigma_rad_s2);
}

ImuSmoother::Prediction ImuSmoother::advance(const Prediction& from, const Preintegration& motion,
                                             TimeNs stamp) const {
  Prediction to;
  to.state = predict_state(from.state, motion, stamp, gravity());
  const MotionResidual r = motion_residual(from.state, to.state, motion, gravity());
  const Matrix9d back = r.by_to.leftCols<9>().inverse();
  const Eigen::Matrix<double, 9, 9> transition = -back * r.by_from.leftCols<9>();
  to.covariance = transition * from.covariance * transition.transpose() +
                  back * motion.covariance * back.transpose();
  to.angular_rate = from.angular_rate;
  return to;
}

ImuSmoother::Prediction ImuSmoother::predict_full(TimeNs t) const {
  Prediction prediction;
  if (!window_.started()) return prediction;
  prediction.state = latest();
  prediction.angular_rate = angular_rate_;
  prediction.covariance = covariance().topLeftCorner<9, 9>();
  if (t <= prediction.state.stamp) return prediction;
  if (use_imu()) {
    const auto samples = buffer_.slice_available(prediction.state.stamp, t);
    if (samples.size() >= 2) {
      const ImuState& start = prediction.state;
      prediction =
          advance(prediction, preintegrate(samples, start.gyro_bias, start.accel_bias, config_.imu),
                  samples.back().stamp);
      prediction.angular_rate = samples.back().angular_rate() - prediction.state.gyro_bias;
    }
  }
  if (prediction.state.stamp < t) {
    prediction = advance(prediction,
                         coast(to_seconds(t - prediction.state.stamp), prediction.angular_rate), t);
  }
  return prediction;
}

NavState ImuSmoother::to_nav(const Prediction& prediction) const {
  const ImuState& state = prediction.state;
  const Pose imu_from_body = body_from_imu_.inverse();
  NavState nav;
  nav.stamp = state.stamp;
  nav.world_from_body = state.world_from_imu * imu_from_body;
  nav.velocity_in_world =
      state.velocity +
      state.world_from_imu.rotation() * prediction.angular_rate.cross(imu_from_body.translation());
  nav.gyro_bias = state.gyro_bias;
  nav.accel_bias = state.accel_bias;
  const Matrix6d adjoint = body_from_imu_.adjoint();
  const Matrix6d covariance =
      adjoint * prediction.covariance.topLeftCorner<6, 6>() * adjoint.transpose();
  nav.pose_covariance = 0.5 * (covariance + covariance.transpose());
  return nav;
}

NavState ImuSmoother::predict(TimeNs t) const {
  NavState nav = to_nav(predict_full(t));
  if (!window_.started()) nav.stamp = t;
  return nav;
}

std::vector<StampedPose> ImuSmoother::predict_path(TimeNs from, TimeNs to) const {
  const Pose imu_from_body = body_from_imu_.inverse();
  std::vector<StampedPose> path;
  Prediction at = predict_full(from);
  if (!window_.started()) {
    // Nothing is known yet but how the sensor turns: enough to deskew the first scan.
    at.state.world_from_imu = body_from_imu_;
    const auto samples = buffer_.samples(from - kHistory, to);
    if (is_still(samples, config_.imu)) {
      for (const InertialSample& s : samples)
        at.state.gyro_bias += s.angular_rate() / static_cast<double>(samples.size());
    }
  }
  const Eigen::Vector3d start_velocity = at.state.world_from_imu.rotation() *
                                         body_from_imu_.rotation().conjugate() *
                                         initial_velocity_.value_or(Eigen::Vector3d::Zero());
  if (!window_.started()) at.state.velocity = start_velocity;
  at.state.stamp = from;
  path.push_back({from, at.state.world_from_imu * imu_from_body});
  std::vector<InertialSample> samples;
  if (use_imu()) samples = buffer_.slice_available(from, to);
  for (std::size_t i = 1; i < samples.size(); ++i) {
    if (samples[i].stamp <= samples[i - 1].stamp) continue;
    ImuState next = step_state(at.state, samples[i - 1], samples[i], gravity());
    if (!window_.started()) {
      next.velocity = start_velocity;
      next.world_from_imu = Pose(next.world_from_imu.rotation(),
                                 at.state.world_from_imu.translation() +
                                     start_velocity * to_seconds(next.stamp - at.state.stamp));
    }
    at.state = next;
    at.angular_rate = samples[i].angular_rate() - at.state.gyro_bias;
    path.push_back({at.state.stamp, at.state.world_from_imu * imu_from_body});
  }
  while (at.state.stamp < to) {
    const TimeNs next = std::min(to, at.state.stamp + from_seconds(kPathStepS));
    const double dt = to_seconds(next - at.state.stamp);
    at.state = predict_state(at.state, coast(dt, at.angular_rate), next, gravity());
    path.push_back({next, at.state.world_from_imu * imu_from_body});
  }
  return path;
}

void ImuSmoother::set_initial_motion(const Eigen::Vector3d& velocity_m_s,
                                     const Eigen::Vector3d& angular_rate_rad_s) {
  initial_velocity_ = velocity_m_s;
  if (!use_imu()) angular_rate_ = angular_rate_rad_s;
}

ImuTrust ImuSmoother::imu_trust() const {
  ImuTrust trust = monitor_.trust();
  trust.on_probation = monitor_.on_probation();
  return trust;
}

void ImuSmoother::suspect_imu(TimeNs now) {
  monitor_.suspect(now);
  note_standing(now, false, monitor_.trust().trusted);
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
  interval.motion = interval.samples.empty() ? coast(to_seconds(to - from), angular_rate_)
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

// Once for each stretch without IMU.
void ImuSmoother::note_silence(const MotionInterval& interval, TimeNs from, TimeNs stamp) {
  const bool silent = interval.samples.empty() && buffer_.ever_filled() && use_imu();
  if (silent && !silent_ && log_ != nullptr) {
    log_->warn("imu.silent", "no IMU between the scans at " + format_seconds(from) + " s and " +
                                 format_seconds(stamp) +
                                 " s: until it comes back the motion between scans is taken to be "
                                 "even");
  }
  silent_ = silent;
}

void ImuSmoother::add_state(TimeNs stamp, const MotionInterval& interval,
                            const std::optional<PoseFactor>& lidar) {
  if (isam_) {
    isam_->add(stamp, interval, lidar);
  } else {
    window_.add(stamp, interval, lidar);
  }
}

std::string ImuSmoother::gate(const Prediction& predicted, const ImuState& before,
                              const PoseFactor& lidar, double& jump) const {
  const double dt = to_seconds(predicted.state.stamp - before.stamp);
  const bool previous = config_.velocity_gate_reference == VelocityGateReference::kPreviousState;
  const Eigen::Vector3d& reference = previous ? before.velocity : predicted.state.velocity;
  jump = (latest().velocity - reference).norm();
  // What the prediction itself does not know opens the gate.
  const auto sigma = [&](int at) {
    return std::sqrt(predicted.covariance.diagonal().segment<3>(at).maxCoeff());
  };
  const double velocity_limit = std::hypot(config_.velocity_gate_m_s, 3.0 * sigma(6));
  if (config_.velocity_gate_m_s > 0.0 && jump > velocity_limit)
    return "the match would change the velocity by " + std::to_string(jump) + " m/s";
  if (previous) return "";
  // A stiff prediction hides a wrong match from the velocity, so the way is looked at, too.
  const double way =
      (lidar.world_from_imu.translation() - predicted.state.world_from_imu.translation()).norm();
  if (config_.velocity_gate_m_s > 0.0 &&
      way > std::hypot(config_.velocity_gate_m_s * dt, 3.0 * sigma(3))) {
    jump = std::max(jump, way / dt);
    return "the match is " + std::to_string(way) + " m from the prediction";
  }
  const double turn = (predicted.state.world_from_imu.inverse() * lidar.world_from_imu).angle();
  if (config_.angular_gate_deg_s > 0.0 &&
      turn > std::hypot(config_.angular_gate_deg_s * kDegree * dt, 3.0 * sigma(0)))
    return "the match is turned by " + std::to_string(turn / kDegree) +
           " degrees against the prediction";
  return "";
}

void ImuSmoother::watch(TimeNs stamp, const MotionInterval& interval,
                        const std::optional<PoseFactor>& lidar) {
  if (!lidar) return;
  const bool was_trusted = monitor_.trust().trusted;
  const bool was_on_probation = monitor_.on_probation();
  monitor_.pass_time(stamp);
  // An IMU on probation is not in the interval, but it is looked at.
  std::vector<InertialSample> apart;
  if (monitor_.on_probation()) apart = buffer_.slice(latest().stamp, stamp);
  const std::vector<InertialSample>& samples = apart.empty() ? interval.samples : apart;
  if (last_match_ && last_match_->stamp == latest().stamp && !samples.empty()) {
    const Eigen::Quaterniond turned =
        last_match_->world_from_imu.rotation().conjugate() * lidar->world_from_imu.rotation();
    monitor_.add_turn(so3_log(turned), raw_turn(samples), turning(samples),
                      interval.motion.duration);
    monitor_.add_force(
        last_match_->world_from_imu.rotation().slerp(0.5, lidar->world_from_imu.rotation()),
        mean_force(samples), interval.motion.duration);
  }
  last_match_ = LastMatch{stamp, lidar->world_from_imu};
  note_standing(stamp, was_on_probation, was_trusted);
}

void ImuSmoother::note_standing(TimeNs stamp, bool was_on_probation, bool was_trusted) {
  if (log_ == nullptr) return;
  if (was_trusted && !monitor_.trust().trusted) {
    log_->warn("imu.untrusted",
               monitor_.trust().reason +
                   (!monitor_.usable() ? "; the rest of the run does without the IMU" : ""));
  } else if (!was_on_probation && monitor_.on_probation()) {
    log_->warn("imu.probation",
               "IMU and lidar contradict each other at " + format_seconds(stamp) +
                   " s: the IMU is left out until it is clear whether it is right");
  } else if (was_on_probation && !monitor_.on_probation()) {
    log_->info("the IMU is used again from " + format_seconds(stamp) + " s on");
  }
}

// After matches have insisted against the prediction for long, or the IMU turned out to be
// unusable, nothing that the estimate says of the motion is worth keeping.
void ImuSmoother::restart_at(TimeNs stamp, const PoseFactor& lidar,
                             const Eigen::Vector3d& velocity) {
  ImuState state = latest();
  state.stamp = stamp;
  state.world_from_imu = lidar.world_from_imu;
  state.velocity = velocity;
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

MotionUpdate ImuSmoother::add_matched(TimeNs stamp, const MotionInterval& interval,
                                      const PoseFactor& lidar,
                                      const Eigen::Vector3d& match_velocity) {
  const ImuState before = latest();
  const Prediction predicted = predict_full(stamp);
  const WindowSmoother backup = window_;
  add_state(stamp, interval, lidar);
  MotionUpdate update;
  update.status = MotionStatus::kAccepted;
  // Constant velocity is no witness against a match: a walker's quick turn would be dropped.
  const bool previous = config_.velocity_gate_reference == VelocityGateReference::kPreviousState;
  if (!interval.samples.empty() || previous)
    update.reason = gate(predicted, before, lidar, update.velocity_jump_m_s);
  if (update.reason.empty()) {
    dropped_in_a_row_ = 0;
    return update;
  }
  if (dropped_in_a_row_ >= config_.velocity_gate_patience) {
    dropped_in_a_row_ = 0;
    monitor_.suspect(stamp);
    restart_at(stamp, lidar, match_velocity);
    update.reason.clear();
    if (log_ != nullptr)
      log_->warn("odometry.restart",
                 "the matches insist against the prediction; the estimate of "
                 "the motion starts anew at " +
                     format_seconds(stamp) + " s");
    note_standing(stamp, false, monitor_.trust().trusted);
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

MotionUpdate ImuSmoother::add_scan(TimeNs stamp, const std::optional<LidarFactor>& factor) {
  if (!window_.started()) return begin(stamp);
  const ImuState before = latest();
  if (stamp <= before.stamp) {
    MotionUpdate update{MotionStatus::kIgnored, "scan not after the last one", {}, 0.0, {}};
    update.state = to_nav(predict_full(before.stamp));
    return update;
  }
  std::optional<PoseFactor> lidar;
  Eigen::Vector3d match_velocity = before.velocity;
  if (factor) {
    const Matrix6d adjoint = body_from_imu_.inverse().adjoint();
    lidar = PoseFactor{factor->world_from_body * body_from_imu_,
                       adjoint * lidar_covariance(*factor, config_.lidar) * adjoint.transpose()};
    if (last_match_) {
      match_velocity =
          (lidar->world_from_imu.translation() - last_match_->world_from_imu.translation()) /
          to_seconds(stamp - last_match_->stamp);
    }
  }
  MotionInterval interval = make_interval(before.stamp, stamp);
  const bool was_usable = use_imu();
  watch(stamp, interval, lidar);
  note_silence(interval, before.stamp, stamp);

  MotionUpdate update;
  if (was_usable != use_imu()) {
    restart_at(stamp, *lidar, match_velocity);
    update.status = MotionStatus::kAccepted;
  } else {
    learn_vertical(interval);
    if (lidar) {
      update = add_matched(stamp, interval, *lidar, match_velocity);
    } else {
      update.reason = "no match";
      add_state(stamp, interval, std::nullopt);
    }
  }
  const Eigen::Quaterniond turned =
      before.world_from_imu.rotation().conjugate() * latest().world_from_imu.rotation();
  angular_rate_ = so3_log(turned) / to_seconds(stamp - before.stamp);
  buffer_.forget_before(stamp);
  if (config_.level_world) level(update);
  hand_over_to_isam();
  Prediction now = predict_full(stamp);
  if (!interval.samples.empty() && use_imu())
    now.angular_rate = interval.samples.back().angular_rate() - now.state.gyro_bias;
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
  return Eigen::Quaterniond::FromTwoVectors(-gravity(), Eigen::Vector3d::UnitZ());
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
  monitor_.save(writer);
  writer.put(how_);
  writer.put_doubles(angular_rate_.data(), 3);
  writer.put(vertical_since_.has_value());
  writer.put(vertical_since_.value_or(0));
  writer.put(levelled_);
  writer.put(dropped_in_a_row_);
  writer.put(silent_);
  writer.put(last_match_.has_value());
  writer.put(last_match_ ? last_match_->stamp : TimeNs{0});
  put_pose(writer, last_match_ ? last_match_->world_from_imu : Pose());
}

void ImuSmoother::load(BinaryReader& reader) {
  buffer_.load(reader);
  if (!reader.get<bool>()) return;
  window_.load(reader);
  if (reader.get<bool>()) {
    isam_ = std::make_unique<Isam2Smoother>(
        Isam2Smoother::Config{config_.isam2_restart, config_.imu}, reader);
  }
  monitor_.load(reader);
  how_ = reader.get<Initialisation>();
  reader.get_doubles(angular_rate_.data(), 3);
  const bool vertical = reader.get<bool>();
  const auto since = reader.get<TimeNs>();
  vertical_since_ = vertical ? std::optional<TimeNs>(since) : std::nullopt;
  levelled_ = reader.get<bool>();
  dropped_in_a_row_ = reader.get<int>();
  silent_ = reader.get<bool>();
  const bool matched = reader.get<bool>();
  const auto stamp = reader.get<TimeNs>();
  const Pose pose = get_pose(reader);
  if (matched) last_match_ = LastMatch{stamp, pose};
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
