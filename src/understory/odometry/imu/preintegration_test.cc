#include "understory/odometry/imu/preintegration.h"

#include <gtest/gtest.h>
#include <gtsam/navigation/ImuFactor.h>

#include "understory/odometry/test_carrier.h"

namespace understory {
namespace {

std::vector<InertialSample> samples_of(TestCarrier& carrier, double from, double to, double rate) {
  std::vector<InertialSample> samples;
  const int n = static_cast<int>(std::lround((to - from) * rate));
  for (int i = 0; i <= n; ++i) {
    const ImuSample s = carrier.imu(from + i / rate);
    InertialSample sample;
    sample.stamp = s.stamp;
    for (int k = 0; k < 3; ++k) {
      sample.gyro[k] = s.angular_rate[k];
      sample.accel[k] = s.specific_force[k];
    }
    samples.push_back(sample);
  }
  return samples;
}

TestCarrier::Config clean() {
  TestCarrier::Config config;
  config.gyro_noise = config.accel_noise = 0.0;
  config.gyro_bias.setZero();
  config.accel_bias.setZero();
  return config;
}

ImuState truth(const TestCarrier& carrier, double t) {
  ImuState state;
  state.stamp = TestCarrier::stamp(t);
  state.world_from_imu = carrier.world_from_body(t);
  state.velocity = carrier.velocity(t);
  return state;
}

const Eigen::Vector3d kGravity(0.0, 0.0, -9.81);

// P2 (3): a second of clean samples leads from the true state to the true state.
TEST(Preintegration, FollowsTheTruth) {
  TestCarrier carrier(clean());
  const auto motion = preintegrate(samples_of(carrier, 3.0, 4.0, 200.0), Eigen::Vector3d::Zero(),
                                   Eigen::Vector3d::Zero(), {});
  const ImuState end = truth(carrier, 4.0);
  const ImuState predicted = predict_state(truth(carrier, 3.0), motion, end.stamp, kGravity);
  const Vector15d difference = local(end, predicted);
  EXPECT_LT(difference.head<3>().norm(), 2e-5);
  EXPECT_LT(difference.segment<3>(3).norm(), 5e-4);
  EXPECT_LT(difference.segment<3>(6).norm(), 1e-3);
  // P2 (4): the residual of the predicted state is zero.
  EXPECT_LT(motion_residual(truth(carrier, 3.0), predicted, motion, kGravity).error.norm(), 1e-12);
}

// GTSAM's preintegration is an independent hand: with the mean of both ends as its input it differs
// only in second order of the sampling interval.
TEST(Preintegration, AgreesWithGtsam) {
  TestCarrier::Config config;
  TestCarrier carrier(config);
  const auto samples = samples_of(carrier, 1.0, 1.5, 400.0);
  const ImuNoiseConfig noise;
  const Eigen::Vector3d gyro_bias(0.01, 0.02, -0.01);
  const Eigen::Vector3d accel_bias(0.1, -0.1, 0.05);
  const auto ours = preintegrate(samples, gyro_bias, accel_bias, noise);

  auto params = gtsam::PreintegrationParams::MakeSharedU(9.81);
  params->gyroscopeCovariance = gtsam::I_3x3 * std::pow(noise.gyro_noise_rad_s_sqrt_hz, 2);
  params->accelerometerCovariance = gtsam::I_3x3 * std::pow(noise.accel_noise_m_s2_sqrt_hz, 2);
  params->integrationCovariance = gtsam::I_3x3 * 1e-16;
  gtsam::PreintegratedImuMeasurements theirs(params, {accel_bias, gyro_bias});
  for (std::size_t i = 1; i < samples.size(); ++i) {
    theirs.integrateMeasurement(
        0.5 * (samples[i].specific_force() + samples[i - 1].specific_force()),
        0.5 * (samples[i].angular_rate() + samples[i - 1].angular_rate()),
        to_seconds(samples[i].stamp - samples[i - 1].stamp));
  }
  EXPECT_LT(so3_log(ours.rotation.conjugate() * theirs.deltaRij().toQuaternion()).norm(), 1e-5);
  EXPECT_LT((ours.velocity - theirs.deltaVij()).norm(), 1e-3 * ours.velocity.norm());
  EXPECT_LT((ours.position - theirs.deltaPij()).norm(), 1e-3 * ours.position.norm());
  // Ours is (rotation, velocity, position), theirs (rotation, position, velocity).
  const gtsam::Matrix cov = theirs.preintMeasCov();
  const auto near = [](const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
    EXPECT_LT((a - b).norm(), 0.03 * b.norm()) << a << "\n\n" << b;
  };
  near(ours.covariance.block<3, 3>(0, 0), cov.block<3, 3>(0, 0));
  near(ours.covariance.block<3, 3>(3, 3), cov.block<3, 3>(6, 6));
  near(ours.covariance.block<3, 3>(6, 6), cov.block<3, 3>(3, 3));
}

TEST(Preintegration, BiasDerivativesAreTheNumericOnes) {
  TestCarrier carrier(clean());
  const auto samples = samples_of(carrier, 2.0, 2.6, 100.0);
  const ImuNoiseConfig noise;
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  const auto base = preintegrate(samples, zero, zero, noise);
  const double h = 1e-6;
  for (int column = 0; column < 6; ++column) {
    Vector6d shift = Vector6d::Zero();
    shift[column] = h;
    const auto moved = preintegrate(samples, shift.head<3>(), shift.tail<3>(), noise);
    Vector9d numeric;
    numeric << so3_log(base.rotation.conjugate() * moved.rotation), moved.velocity - base.velocity,
        moved.position - base.position;
    numeric /= h;
    EXPECT_LT((numeric - base.by_bias.col(column)).norm(), 1e-5) << "column " << column;
  }
}

TEST(Preintegration, ResidualDerivativesAreTheNumericOnes) {
  TestCarrier carrier(clean());
  auto motion = preintegrate(samples_of(carrier, 2.0, 2.3, 100.0), Eigen::Vector3d::Zero(),
                             Eigen::Vector3d::Zero(), {});
  Random random(5);
  const auto disturb = [&](ImuState state) {
    Vector15d d;
    for (double& x : d)
      x = 0.1 * random.normal();
    return retract(state, d);
  };
  const ImuState from = disturb(truth(carrier, 2.0));
  const ImuState to = disturb(truth(carrier, 2.3));
  const MotionResidual base = motion_residual(from, to, motion, kGravity);
  const double h = 1e-6;
  for (int column = 0; column < 15; ++column) {
    Vector15d d = Vector15d::Zero();
    d[column] = h;
    const Vector9d by_from =
        (motion_residual(retract(from, d), to, motion, kGravity).error - base.error) / h;
    const Vector9d by_to =
        (motion_residual(from, retract(to, d), motion, kGravity).error - base.error) / h;
    EXPECT_LT((by_from - base.by_from.col(column)).norm(), 1e-4) << "from " << column;
    EXPECT_LT((by_to - base.by_to.col(column)).norm(), 1e-4) << "to " << column;
  }
  for (int column = 0; column < 3; ++column) {
    const Eigen::Vector3d g = kGravity + h * Eigen::Vector3d::Unit(column);
    const Vector9d numeric = (motion_residual(from, to, motion, g).error - base.error) / h;
    EXPECT_LT((numeric - base.by_gravity.col(column)).norm(), 1e-6);
  }
}

// The covariance is what repeated noise really does.
TEST(Preintegration, CovarianceIsThatOfRepeatedNoise) {
  TestCarrier::Config config = clean();
  TestCarrier clean_carrier(config);
  ImuNoiseConfig noise;
  const auto clean_samples = samples_of(clean_carrier, 1.0, 1.5, 200.0);
  const auto base =
      preintegrate(clean_samples, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), noise);
  Random random(7);
  const double gyro = noise.gyro_noise_rad_s_sqrt_hz * std::sqrt(200.0);
  const double accel = noise.accel_noise_m_s2_sqrt_hz * std::sqrt(200.0);
  Vector9d sum = Vector9d::Zero();
  const int runs = 2000;
  for (int run = 0; run < runs; ++run) {
    auto samples = clean_samples;
    for (InertialSample& s : samples) {
      for (int k = 0; k < 3; ++k) {
        s.gyro[k] += gyro * random.normal();
        s.accel[k] += accel * random.normal();
      }
    }
    const auto noisy =
        preintegrate(samples, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), noise);
    Vector9d error;
    error << so3_log(base.rotation.conjugate() * noisy.rotation), noisy.velocity - base.velocity,
        noisy.position - base.position;
    sum += error.cwiseAbs2() / runs;
  }
  for (int i = 0; i < 9; ++i)
    EXPECT_NEAR(std::sqrt(sum[i] / base.covariance(i, i)), 1.0, 0.08) << i;
}

// Rotors shake the sensor faster than it samples: what they add counts as noise. A motion does not.
TEST(Preintegration, AccelerometerThatIsShakenIsLessSure) {
  TestCarrier carrier(clean());
  const ImuNoiseConfig noise;
  const auto still = samples_of(carrier, 1.0, 1.5, 200.0);
  const auto sure = preintegrate(still, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), noise);
  auto samples = still;
  for (std::size_t i = 0; i < samples.size(); ++i)
    samples[i].accel[0] += i % 2 == 0 ? 1.0 : -1.0;
  const auto shaken =
      preintegrate(samples, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), noise);
  // Second differences of 4: a variance of 16 / 18 a sample, over 200 samples a second.
  const double expected = std::sqrt(16.0 / 18.0 / 200.0) / noise.accel_noise_m_s2_sqrt_hz;
  EXPECT_NEAR(std::sqrt(shaken.covariance(3, 3) / sure.covariance(3, 3)), expected, 0.1 * expected);
  // The carrier of the test moves all the time, and its noise is that of the setting.
  const double sigma = std::sqrt(sure.covariance(3, 3) / 0.5);
  EXPECT_NEAR(sigma, noise.accel_noise_m_s2_sqrt_hz, 0.1 * noise.accel_noise_m_s2_sqrt_hz);
}

// A walk shakes a slow sensor as much as its second differences show; a gap makes them larger
// still.
TEST(Preintegration, SlowSensorsAndGapsShowNoNoise) {
  const ImuNoiseConfig noise;
  const auto sigma_of = [&](double rate, double gap_s) {
    std::vector<InertialSample> samples;
    for (double t = 0.0; t < 0.5; t += 1.0 / rate) {
      if (t > 0.2 && t < 0.2 + gap_s) continue;
      InertialSample sample;
      sample.stamp = from_seconds(t);
      sample.accel[0] = 3.0 * std::sin(2.0 * M_PI * 8.0 * t);
      samples.push_back(sample);
    }
    const auto sum = preintegrate(samples, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), noise);
    return std::sqrt(sum.covariance(3, 3) / to_seconds(samples.back().stamp));
  };
  for (const double rate : {50.0, 100.0, 200.0})
    EXPECT_NEAR(sigma_of(rate, 0.0) / noise.accel_noise_m_s2_sqrt_hz, 1.0, 0.05) << rate;
  EXPECT_NEAR(sigma_of(200.0, 0.2) / sigma_of(200.0, 0.0), 1.0, 0.3);
}

}  // namespace
}  // namespace understory
