#include "understory/georeference/satellites/satellite_smoothing.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include "understory/georeference/georeference_constants.h"
#include "understory/odometry/imu/chain_equations.h"
#include "understory/odometry/imu/imu_state.h"
#include "understory/odometry/imu/preintegration.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace georeference_constants::satellite_smoothing;

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Normal gravity on the ellipsoid, m/s^2, downwards (Somigliana's formula as a series).
Vector3d gravity_at(double latitude_deg) {
  const double s = std::pow(std::sin(latitude_deg * M_PI / 180.0), 2.0);
  return {0.0, 0.0, -9.780327 * (1.0 + 5.3024e-3 * s - 5.8e-6 * 4.0 * s * (1.0 - s))};
}

const Eigen::Matrix<double, 3, 2> kKnownGravity = Eigen::Matrix<double, 3, 2>::Zero();

// A position of the antenna at one state; weights are inverse variances of east, north, up.
struct AntennaFactor {
  Vector3d place_in_enu = Vector3d::Zero();
  Vector3d sd_m = Vector3d::Ones();  // of one position by itself
  Vector3d weight = Vector3d::Zero();
};

class SatelliteChain {
 public:
  SatelliteChain(const SatelliteSmoothingConfig& config, const Vector3d& gravity)
      : config_(config),
        gravity_(gravity),
        arm_in_imu_(config.body_from_imu.inverse() * config.pairing.antenna_in_body) {}

  void add(const ImuState& guess, const AntennaFactor& antenna, std::vector<InertialSample> since) {
    states_.push_back(guess);
    antennas_.push_back(antenna);
    if (states_.size() > 1) samples_.push_back(std::move(since));
  }
  [[nodiscard]] std::size_t size() const { return states_.size(); }

  std::vector<SmoothedPose> smooth() {
    for (int step = 0; step < config_.iterations; ++step) {
      integrate();
      if (solve() < kConverged) break;
    }
    return poses();
  }

 private:
  void integrate() {
    motions_.clear();
    for (std::size_t k = 0; k < samples_.size(); ++k)
      motions_.push_back(
          preintegrate(samples_[k], states_[k].gyro_bias, states_[k].accel_bias, config_.imu));
  }

  [[nodiscard]] ChainEquations linearise() const {
    ChainEquations system(states_.size());
    // The prior of velocity and biases, and next to nothing of the attitude.
    Vector15d weight = Vector15d::Zero();
    weight.head<3>().setConstant(kAttitudeWeight);
    weight.segment<3>(6).setConstant(std::pow(kVelocitySdMS, -2.0));
    weight.segment<3>(9).setConstant(std::pow(config_.imu.gyro_bias_sigma_rad_s, -2.0));
    weight.tail<3>().setConstant(std::pow(config_.imu.accel_bias_sigma_m_s2, -2.0));
    system.diagonal[0].diagonal() += weight;
    system.right[0].segment<3>(6) -= weight.segment<3>(6).cwiseProduct(states_[0].velocity);
    system.right[0].segment<3>(9) -= weight.segment<3>(9).cwiseProduct(states_[0].gyro_bias);
    system.right[0].tail<3>() -= weight.tail<3>().cwiseProduct(states_[0].accel_bias);
    for (std::size_t k = 0; k < states_.size(); ++k) {
      add_antenna(k, system);
      if (k + 1 < states_.size())
        system.add_motion(k, states_[k], states_[k + 1], motions_[k], gravity_, kKnownGravity,
                          config_.imu);
    }
    return system;
  }

  void add_antenna(std::size_t k, ChainEquations& system) const {
    const Matrix3d r = states_[k].world_from_imu.rotation_matrix();
    const Vector3d error = states_[k].world_from_imu * arm_in_imu_ - antennas_[k].place_in_enu;
    Eigen::Matrix<double, 3, 6> j;
    j << -r * skew(arm_in_imu_), r;
    // Cauchy's weight: runaways have little say.
    const Vector3d ratio = error.cwiseQuotient(antennas_[k].sd_m);
    const Vector3d weight =
        antennas_[k].weight / (1.0 + ratio.squaredNorm() / (kCauchyWidth * kCauchyWidth));
    system.diagonal[k].topLeftCorner<6, 6>() += j.transpose() * weight.asDiagonal() * j;
    system.right[k].head<6>() -= j.transpose() * weight.cwiseProduct(error);
  }

  // One Gauss-Newton step by elimination from the first state on; marginals on the way back.
  // Returns the largest change.
  double solve() {
    ChainEquations system = linearise();
    const std::size_t last = states_.size() - 1;
    for (std::size_t k = 0; k < last; ++k)
      system.eliminate(k);
    marginals_.assign(states_.size(), Matrix15d::Zero());
    Vector15d step = Vector15d::Zero();
    double largest = 0.0;
    for (std::size_t k = states_.size(); k-- > 0;) {
      const StateSolver pivot(system.diagonal[k]);
      const Matrix15d own = pivot.inverse();
      const Matrix15d gain = own * system.next[k];
      const Vector15d right =
          k < last ? Vector15d(system.right[k] - system.next[k] * step) : system.right[k];
      step = pivot.solve(right);
      marginals_[k] = k < last ? Matrix15d(own + gain * marginals_[k + 1] * gain.transpose()) : own;
      largest = std::max(largest, step.head<6>().cwiseAbs().maxCoeff());
      states_[k] = retract(states_[k], step);
    }
    return largest;
  }

  [[nodiscard]] std::vector<SmoothedPose> poses() const {
    const Pose imu_from_body = config_.body_from_imu.inverse();
    const Matrix6d carry = config_.body_from_imu.adjoint();
    std::vector<SmoothedPose> result;
    for (std::size_t k = 0; k < states_.size(); ++k) {
      const Matrix6d own = marginals_[k].topLeftCorner<6, 6>();
      result.push_back({states_[k].stamp, states_[k].world_from_imu * imu_from_body,
                        carry * own * carry.transpose()});
    }
    return result;
  }

  const SatelliteSmoothingConfig& config_;
  Vector3d gravity_;
  Vector3d arm_in_imu_;
  std::vector<ImuState> states_;
  std::vector<AntennaFactor> antennas_;
  std::vector<std::vector<InertialSample>> samples_;
  std::vector<Preintegration> motions_;
  std::vector<Matrix15d> marginals_;
};

InertialSample plain(const ImuSample& sample, TimeNs stamp) {
  InertialSample one;
  one.stamp = stamp;
  for (int axis = 0; axis < 3; ++axis) {
    one.gyro[axis] = sample.angular_rate(axis);
    one.accel[axis] = sample.specific_force(axis);
  }
  return one;
}

// The samples from one time to another; the nearest stand at the ends. Empty across a gap.
std::vector<InertialSample> between(const std::vector<ImuSample>& samples, TimeNs from, TimeNs to) {
  const auto before = [](const ImuSample& sample, TimeNs t) { return sample.stamp < t; };
  const auto first = std::lower_bound(samples.begin(), samples.end(), from, before);
  const auto last = std::lower_bound(first, samples.end(), to, before);
  if (last == samples.end() || first == last) return {};
  std::vector<InertialSample> result{plain(*first, from)};
  TimeNs longest = 0;
  TimeNs previous = from;
  for (auto sample = first; sample != last; ++sample) {
    longest = std::max(longest, sample->stamp - previous);
    previous = sample->stamp;
    if (sample->stamp > result.back().stamp) result.push_back(plain(*sample, sample->stamp));
  }
  longest = std::max(longest, to - previous);
  result.push_back(plain(*last, to));
  return to_seconds(longest) > kLongestGapS ? std::vector<InertialSample>() : result;
}

// The first pose of the path from a time on, half a second later at most.
std::optional<StampedPose> pose_from(const std::vector<StampedPose>& trajectory, TimeNs stamp) {
  const auto after =
      std::lower_bound(trajectory.begin(), trajectory.end(), stamp,
                       [](const StampedPose& pose, TimeNs t) { return pose.stamp < t; });
  if (after == trajectory.end() || after->stamp - stamp > kNsPerSecond / 2) return std::nullopt;
  return *after;
}

}  // namespace

std::vector<SmoothedPose> smooth_satellites(const std::vector<StampedPose>& trajectory,
                                            const std::vector<GnssFix>& fixes,
                                            const std::vector<ImuSample>& samples,
                                            const Pose& start,
                                            const SatelliteSmoothingConfig& config) {
  const SatellitePairs pairs = pair_by_time(trajectory, fixes, config.pairing);
  if (pairs.pairs.size() < 3) return {};
  TimeNs first = fixes.front().stamp;
  for (const GnssFix& fix : fixes)
    first = std::min(first, fix.stamp);
  first += from_seconds(config.pairing.time_offset_s);
  SatelliteChain chain(config, gravity_at(pairs.origin->latitude_deg));
  std::optional<StampedPose> last;
  for (const SatellitePair& pair : with_height(pairs.pairs)) {
    // States stand at poses of the path, the positions are carried there along it.
    const auto pose = pose_from(trajectory, first + from_seconds(pair.time_s));
    if (!pose || (last && pose->stamp <= last->stamp)) continue;
    std::vector<InertialSample> since;
    if (last) since = between(samples, last->stamp, pose->stamp);
    if (last && since.empty()) continue;
    const double dt = last ? to_seconds(pose->stamp - last->stamp) : config.pairing.interval_s;
    const Pose placed = start * pose->world_from_body;
    AntennaFactor antenna;
    antenna.place_in_enu =
        pair.fix_in_enu +
        start.rotation() *
            (pose->world_from_body * config.pairing.antenna_in_body - pair.antenna_in_world);
    // Positions whose errors stay the same for a while count as few independent ones.
    const double repeats = std::max(1.0, 2.0 * config.correlation_s / dt);
    antenna.sd_m = config.overconfidence * pair.covariance.diagonal().cwiseSqrt();
    antenna.weight = (repeats * antenna.sd_m.cwiseAbs2()).cwiseInverse();
    ImuState guess;
    guess.stamp = pose->stamp;
    guess.world_from_imu = placed * config.body_from_imu;
    guess.velocity = start.rotation() * pair.velocity_in_world;
    chain.add(guess, antenna, std::move(since));
    last = pose;
  }
  if (chain.size() < 3) return {};
  return chain.smooth();
}

}  // namespace understory
