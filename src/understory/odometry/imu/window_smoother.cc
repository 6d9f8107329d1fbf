#include "understory/odometry/imu/window_smoother.h"

#include <Eigen/Cholesky>

#include "understory/geometry/pose_io.h"
#include "understory/geometry/rotation_between.h"
#include "understory/odometry/imu/chain_equations.h"
#include "understory/odometry/odometry_constants.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace odometry_constants::window_smoother;

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

// Turns the velocity of a matrix over the tangent: T M T^T, where T is the identity but there.
template <int N>
void turn_velocity(const Eigen::Matrix3d& turn, Eigen::Matrix<double, N, N>& matrix) {
  matrix.template middleRows<3>(6) = (turn * matrix.template middleRows<3>(6)).eval();
  matrix.template middleCols<3>(6) = (matrix.template middleCols<3>(6) * turn.transpose()).eval();
}

}  // namespace

struct WindowSmoother::System {
  explicit System(std::size_t states) : chain(states), tilt(states, Matrix15x2::Zero()) {}

  ChainEquations chain;
  std::vector<Matrix15x2> tilt;
  Eigen::Matrix2d tilt_diagonal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d tilt_right = Eigen::Vector2d::Zero();

  // Takes state k out of the equations, on to k + 1 and the tilt.
  void eliminate(std::size_t k) {
    const StateSolver solver = chain.eliminate(k);
    const Matrix15x2 by_tilt = solver.solve(tilt[k]);
    tilt[k + 1] -= chain.next[k].transpose() * by_tilt;
    tilt_diagonal -= tilt[k].transpose() * by_tilt;
    tilt_right -= tilt[k].transpose() * solver.solve(chain.right[k]);
  }

  // Equations of one state and the tilt.
  [[nodiscard]] Matrix17d joint(std::size_t k) const {
    Matrix17d matrix;
    matrix << chain.diagonal[k], tilt[k], tilt[k].transpose(), tilt_diagonal;
    return 0.5 * (matrix + matrix.transpose());
  }
  [[nodiscard]] Vector17d joint_right(std::size_t k) const {
    Vector17d vector;
    vector << chain.right[k], tilt_right;
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
  // The tilt's derivative is the identity.
  const Matrix15d jacobian = local_jacobian(prior_.point, states_.front());
  const Matrix15d own = prior_.information.topLeftCorner<15, 15>();
  const Matrix15x2 with_tilt = prior_.information.topRightCorner<15, 2>();
  const Vector17d right = prior_.vector - prior_.information * d;
  const Matrix15d carried = own * jacobian;
  system.chain.diagonal[0] += jacobian.transpose() * carried;
  system.tilt[0] += jacobian.transpose() * with_tilt;
  system.tilt_diagonal += prior_.information.bottomRightCorner<2, 2>();
  system.chain.right[0] += jacobian.transpose() * right.head<15>();
  system.tilt_right += right.tail<2>();
}

void WindowSmoother::add_interval(System& system, std::size_t k) const {
  const WhiteMotion white = system.chain.add_motion(
      k, states_[k], states_[k + 1], intervals_[k].motion, gravity(),
      gravity_by_tilt(gravity_rotation_, config_.imu.gravity_m_s2), config_.imu);
  system.tilt[k] += white.by_from.transpose() * white.by_tilt;
  system.tilt[k + 1] += white.by_to.transpose() * white.by_tilt;
  system.tilt_diagonal += white.by_tilt.transpose() * white.by_tilt;
  system.tilt_right -= white.by_tilt.transpose() * white.error;
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
  system.chain.diagonal[k].topLeftCorner<6, 6>() += white.transpose() * white;
  system.chain.right[k].head<6>() -= white.transpose() * Vector6d(root.matrixL().solve(error));
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
      const Vector15d right =
          system.chain.right[k] - system.chain.next[k] * step - system.tilt[k] * tilt;
      step = StateSolver(system.chain.diagonal[k]).solve(right);
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
  const Eigen::Matrix3d turn = new_from_old.rotation_matrix();
  turn_velocity(turn, prior_.information);
  turn_velocity(turn, covariance_);
  prior_.vector.segment<3>(6) = (turn * prior_.vector.segment<3>(6)).eval();
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
