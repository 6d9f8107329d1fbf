#include "understory/odometry/imu/window_smoother.h"

#include <Eigen/Cholesky>

#include "understory/geometry/pose_io.h"
#include "understory/geometry/rotation_between.h"
#include "understory/odometry/odometry_constants.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace odometry_constants::window_smoother;

using Matrix2x15 = Eigen::Matrix<double, 2, 15>;
using Matrix15x2 = Eigen::Matrix<double, 15, 2>;
using Matrix17d = Eigen::Matrix<double, 17, 17>;
using Vector17d = Eigen::Matrix<double, 17, 1>;

// During the first states the linearisation point can be far off, so more steps are taken.
constexpr std::uint64_t kFirstStates = 30;

// Derivative of the gravity vector by the two tilts (rotation about x and y of its own frame).
Eigen::Matrix<double, 3, 2> gravity_by_tilt(const Eigen::Quaterniond& rotation, double magnitude) {
  const Eigen::Vector3d down(0.0, 0.0, -magnitude);
  return -(rotation.toRotationMatrix() * skew(down)).leftCols<2>();
}

Eigen::Vector2d tilt_difference(const Eigen::Quaterniond& from, const Eigen::Quaterniond& to) {
  return so3_log(from.conjugate() * to).head<2>();
}

}  // namespace

struct WindowSmoother::System {
  explicit System(std::size_t states)
      : diagonal(states, Matrix15d::Zero()),
        next(states, Matrix15d::Zero()),
        tilt(states, Matrix15x2::Zero()),
        right(states, Vector15d::Zero()) {}

  std::vector<Matrix15d> diagonal;
  std::vector<Matrix15d> next;  // block (k, k + 1)
  std::vector<Matrix15x2> tilt;
  std::vector<Vector15d> right;
  Eigen::Matrix2d tilt_diagonal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d tilt_right = Eigen::Vector2d::Zero();

  // Takes state k out of the equations, on to k + 1 and the tilt.
  void eliminate(std::size_t k) {
    const Eigen::LDLT<Matrix15d> factor(diagonal[k]);
    const Matrix15d by_next = factor.solve(next[k]);
    const Matrix15x2 by_tilt = factor.solve(tilt[k]);
    const Vector15d by_right = factor.solve(right[k]);
    diagonal[k + 1] -= next[k].transpose() * by_next;
    tilt[k + 1] -= next[k].transpose() * by_tilt;
    right[k + 1] -= next[k].transpose() * by_right;
    tilt_diagonal -= tilt[k].transpose() * by_tilt;
    tilt_right -= tilt[k].transpose() * by_right;
  }

  // Equations of one state and the tilt.
  [[nodiscard]] Matrix17d joint(std::size_t k) const {
    Matrix17d matrix;
    matrix << diagonal[k], tilt[k], tilt[k].transpose(), tilt_diagonal;
    return 0.5 * (matrix + matrix.transpose());
  }
  [[nodiscard]] Vector17d joint_right(std::size_t k) const {
    Vector17d vector;
    vector << right[k], tilt_right;
    return vector;
  }
};

void WindowSmoother::start(const ImuState& state, const Eigen::Vector3d& up_in_world,
                           const InitialUncertainty& sigma) {
  states_ = {state};
  intervals_.clear();
  lidar_ = {std::nullopt};
  set_up(up_in_world);
  prior_ = Prior();
  prior_.point = state;
  prior_.gravity_rotation = gravity_rotation_;
  Vector17d deviation;
  const auto three = [](double s) { return Eigen::Vector3d::Constant(s); };
  deviation << three(sigma.rotation_rad), three(sigma.position_m), three(sigma.velocity_m_s),
      three(sigma.gyro_bias_rad_s), three(sigma.accel_bias_m_s2),
      Eigen::Vector2d::Constant(sigma.tilt_rad);
  prior_.information = deviation.cwiseAbs2().cwiseInverse().asDiagonal();
  covariance_ = deviation.head<15>().cwiseAbs2().asDiagonal();
  tilt_covariance_ = deviation.tail<2>().cwiseAbs2().asDiagonal();
  added_ = 1;
}

Eigen::Vector3d WindowSmoother::gravity() const {
  return gravity_rotation_ * Eigen::Vector3d(0.0, 0.0, -config_.imu.gravity_m_s2);
}

void WindowSmoother::set_up(const Eigen::Vector3d& up_in_world) {
  gravity_rotation_ = rotation_between(Eigen::Vector3d::UnitZ(), up_in_world);
  prior_.gravity_rotation = gravity_rotation_;
}

void WindowSmoother::add(TimeNs stamp, const MotionInterval& interval,
                         const std::optional<PoseFactor>& lidar) {
  UNDERSTORY_CHECK(started());
  while (states_.size() > static_cast<std::size_t>(std::max(config_.window, 2)))
    marginalise_oldest();
  states_.push_back(predict_state(states_.back(), interval.motion, stamp, gravity()));
  intervals_.push_back(interval);
  lidar_.push_back(lidar);
  ++added_;
  optimise(added_ < kFirstStates ? std::max(kFirstIterations, config_.iterations)
                                 : config_.iterations);
}

void WindowSmoother::add_prior(System& system) const {
  Vector17d d;
  d << local(prior_.point, states_.front()),
      tilt_difference(prior_.gravity_rotation, gravity_rotation_);
  Matrix17d jacobian = Matrix17d::Identity();
  jacobian.topLeftCorner<15, 15>() = local_jacobian(prior_.point, states_.front());
  const Matrix17d information = jacobian.transpose() * prior_.information * jacobian;
  const Vector17d right = jacobian.transpose() * (prior_.vector - prior_.information * d);
  system.diagonal[0] += information.topLeftCorner<15, 15>();
  system.tilt[0] += information.topRightCorner<15, 2>();
  system.tilt_diagonal += information.bottomRightCorner<2, 2>();
  system.right[0] += right.head<15>();
  system.tilt_right += right.tail<2>();
}

void WindowSmoother::add_interval(System& system, std::size_t k) const {
  const Preintegration& motion = intervals_[k].motion;
  const ImuState& from = states_[k];
  const ImuState& to = states_[k + 1];
  const MotionResidual r = motion_residual(from, to, motion, gravity());
  const Eigen::LLT<Matrix9d> root(motion.covariance);
  // Whitened: L^-1 of everything, so that the products below are symmetric to the last bit.
  const Eigen::Matrix<double, 9, 15> by_from = root.matrixL().solve(r.by_from);
  const Eigen::Matrix<double, 9, 15> by_to = root.matrixL().solve(r.by_to);
  const Eigen::Matrix<double, 9, 2> by_tilt = root.matrixL().solve(
      r.by_gravity * gravity_by_tilt(gravity_rotation_, config_.imu.gravity_m_s2));
  const Vector9d error = root.matrixL().solve(r.error);
  system.diagonal[k] += by_from.transpose() * by_from;
  system.next[k] += by_from.transpose() * by_to;
  system.diagonal[k + 1] += by_to.transpose() * by_to;
  system.tilt[k] += by_from.transpose() * by_tilt;
  system.tilt[k + 1] += by_to.transpose() * by_tilt;
  system.tilt_diagonal += by_tilt.transpose() * by_tilt;
  system.right[k] -= by_from.transpose() * error;
  system.right[k + 1] -= by_to.transpose() * error;
  system.tilt_right -= by_tilt.transpose() * error;

  // Random walk of the biases.
  const double gyro = config_.imu.gyro_bias_walk_rad_s2_sqrt_hz;
  const double accel = config_.imu.accel_bias_walk_m_s3_sqrt_hz;
  Vector6d weight;
  weight << Eigen::Vector3d::Constant(1.0 / (gyro * gyro * motion.duration)),
      Eigen::Vector3d::Constant(1.0 / (accel * accel * motion.duration));
  Vector6d walk;
  walk << to.gyro_bias - from.gyro_bias, to.accel_bias - from.accel_bias;
  system.diagonal[k].diagonal().tail<6>() += weight;
  system.diagonal[k + 1].diagonal().tail<6>() += weight;
  system.next[k].diagonal().tail<6>() -= weight;
  system.right[k].tail<6>() += weight.cwiseProduct(walk);
  system.right[k + 1].tail<6>() -= weight.cwiseProduct(walk);
}

void WindowSmoother::add_lidar(System& system, std::size_t k) const {
  if (!lidar_[k]) return;
  const PoseFactor& factor = *lidar_[k];
  const Eigen::Quaterniond back = factor.world_from_imu.rotation().conjugate();
  const Eigen::Quaterniond relative = back * states_[k].world_from_imu.rotation();
  Vector6d error;
  error << so3_log(relative),
      back * (states_[k].world_from_imu.translation() - factor.world_from_imu.translation());
  Matrix6d jacobian = Matrix6d::Zero();
  jacobian.topLeftCorner<3, 3>() = so3_right_jacobian_inverse(error.head<3>());
  jacobian.bottomRightCorner<3, 3>() = relative.toRotationMatrix();
  const Eigen::LLT<Matrix6d> root(factor.covariance);
  const Matrix6d white = root.matrixL().solve(jacobian);
  system.diagonal[k].topLeftCorner<6, 6>() += white.transpose() * white;
  system.right[k].head<6>() -= white.transpose() * Vector6d(root.matrixL().solve(error));
}

WindowSmoother::System WindowSmoother::linearise() const {
  System system(states_.size());
  add_prior(system);
  for (std::size_t k = 0; k < states_.size(); ++k)
    add_lidar(system, k);
  for (std::size_t k = 0; k < intervals_.size(); ++k)
    add_interval(system, k);
  return system;
}

void WindowSmoother::optimise(int iterations) {
  const std::size_t last = states_.size() - 1;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    reintegrate();
    System system = linearise();
    for (std::size_t k = 0; k < last; ++k)
      system.eliminate(k);
    const Eigen::LDLT<Matrix17d> factor(system.joint(last));
    const Vector17d end = factor.solve(system.joint_right(last));
    const Matrix17d marginal = factor.solve(Matrix17d::Identity());
    covariance_ = marginal.topLeftCorner<15, 15>();
    tilt_covariance_ = marginal.bottomRightCorner<2, 2>();

    const Eigen::Vector2d tilt = end.tail<2>();
    Vector15d step = end.head<15>();
    double largest = step.cwiseAbs().maxCoeff();
    states_[last] = retract(states_[last], step);
    for (std::size_t k = last; k-- > 0;) {
      const Vector15d right = system.right[k] - system.next[k] * step - system.tilt[k] * tilt;
      step = Eigen::LDLT<Matrix15d>(system.diagonal[k]).solve(right);
      largest = std::max(largest, step.cwiseAbs().maxCoeff());
      states_[k] = retract(states_[k], step);
    }
    gravity_rotation_ =
        (gravity_rotation_ * so3_exp(Eigen::Vector3d(tilt.x(), tilt.y(), 0.0))).normalized();
    if (largest < kConverged) break;
  }
}

void WindowSmoother::reintegrate() {
  for (std::size_t k = 0; k < intervals_.size(); ++k) {
    MotionInterval& interval = intervals_[k];
    const ImuState& state = states_[k];
    if (interval.samples.empty()) continue;
    if ((state.gyro_bias - interval.motion.gyro_bias).norm() < kGyroBiasShift &&
        (state.accel_bias - interval.motion.accel_bias).norm() < kAccelBiasShift)
      continue;
    interval.motion =
        preintegrate(interval.samples, state.gyro_bias, state.accel_bias, config_.imu);
  }
}

void WindowSmoother::marginalise_oldest() {
  System system(2);
  add_prior(system);
  add_lidar(system, 0);
  add_interval(system, 0);
  system.eliminate(0);
  prior_.point = states_[1];
  prior_.gravity_rotation = gravity_rotation_;
  prior_.information = system.joint(1);
  prior_.vector = system.joint_right(1);
  states_.erase(states_.begin());
  intervals_.erase(intervals_.begin());
  lidar_.erase(lidar_.begin());
}

void WindowSmoother::move_world(const Pose& new_from_old) {
  const auto move = [&](ImuState& state) {
    state.world_from_imu = new_from_old * state.world_from_imu;
    state.velocity = new_from_old.rotation() * state.velocity;
  };
  for (ImuState& state : states_)
    move(state);
  for (auto& factor : lidar_) {
    if (factor) factor->world_from_imu = new_from_old * factor->world_from_imu;
  }
  move(prior_.point);
  gravity_rotation_ = (new_from_old.rotation() * gravity_rotation_).normalized();
  prior_.gravity_rotation = (new_from_old.rotation() * prior_.gravity_rotation).normalized();
  // Velocity is the one part of the tangent that is expressed in the world.
  Matrix17d turn = Matrix17d::Identity();
  turn.block<3, 3>(6, 6) = new_from_old.rotation_matrix();
  prior_.information = (turn * prior_.information * turn.transpose()).eval();
  prior_.vector = (turn * prior_.vector).eval();
  covariance_ =
      (turn.topLeftCorner<15, 15>() * covariance_ * turn.topLeftCorner<15, 15>().transpose())
          .eval();
}

namespace {

void put_quaternion(BinaryWriter& writer, const Eigen::Quaterniond& q) {
  writer.put_doubles(q.coeffs().data(), 4);
}

}  // namespace

void put_interval(BinaryWriter& writer, const MotionInterval& interval) {
  const Preintegration& m = interval.motion;
  writer.put(interval.samples);
  writer.put(m.duration);
  put_quaternion(writer, m.rotation);
  for (const auto* v : {&m.velocity, &m.position, &m.gyro_bias, &m.accel_bias})
    writer.put_doubles(v->data(), 3);
  writer.put_doubles(m.by_bias.data(), 54);
  writer.put_doubles(m.covariance.data(), 81);
  writer.put(m.gravity_weight);
}

MotionInterval get_interval(BinaryReader& reader) {
  MotionInterval interval;
  Preintegration& m = interval.motion;
  interval.samples = reader.get_vector<InertialSample>();
  m.duration = reader.get<double>();
  reader.get_doubles(m.rotation.coeffs().data(), 4);
  for (auto* v : {&m.velocity, &m.position, &m.gyro_bias, &m.accel_bias})
    reader.get_doubles(v->data(), 3);
  reader.get_doubles(m.by_bias.data(), 54);
  reader.get_doubles(m.covariance.data(), 81);
  m.gravity_weight = reader.get<double>();
  return interval;
}

void WindowSmoother::save(BinaryWriter& writer) const {
  writer.put(static_cast<std::uint64_t>(states_.size()));
  for (std::size_t k = 0; k < states_.size(); ++k) {
    put_state(writer, states_[k]);
    writer.put(lidar_[k].has_value());
    if (lidar_[k]) {
      put_pose(writer, lidar_[k]->world_from_imu);
      writer.put_doubles(lidar_[k]->covariance.data(), 36);
    }
    if (k < intervals_.size()) put_interval(writer, intervals_[k]);
  }
  put_quaternion(writer, gravity_rotation_);
  put_state(writer, prior_.point);
  put_quaternion(writer, prior_.gravity_rotation);
  writer.put_doubles(prior_.information.data(), 17 * 17);
  writer.put_doubles(prior_.vector.data(), 17);
  writer.put_doubles(covariance_.data(), 15 * 15);
  writer.put_doubles(tilt_covariance_.data(), 4);
  writer.put(added_);
}

void WindowSmoother::load(BinaryReader& reader) {
  states_.clear();
  intervals_.clear();
  lidar_.clear();
  const auto count = reader.get<std::uint64_t>();
  for (std::uint64_t k = 0; k < count; ++k) {
    states_.push_back(get_state(reader));
    lidar_.emplace_back();
    if (reader.get<bool>()) {
      lidar_.back().emplace();
      lidar_.back()->world_from_imu = get_pose(reader);
      reader.get_doubles(lidar_.back()->covariance.data(), 36);
    }
    if (k + 1 < count) intervals_.push_back(get_interval(reader));
  }
  reader.get_doubles(gravity_rotation_.coeffs().data(), 4);
  prior_.point = get_state(reader);
  reader.get_doubles(prior_.gravity_rotation.coeffs().data(), 4);
  reader.get_doubles(prior_.information.data(), 17 * 17);
  reader.get_doubles(prior_.vector.data(), 17);
  reader.get_doubles(covariance_.data(), 15 * 15);
  reader.get_doubles(tilt_covariance_.data(), 4);
  added_ = reader.get<std::uint64_t>();
}

}  // namespace understory
