#include <gtest/gtest.h>

#include <functional>

#include "understory/odometry/motion/motion_model.h"
#include "understory/odometry/test_carrier.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

struct SmoothedRun {
  double position_rmse = 0.0;  // of the smoothed state against the truth, after the start
  double rotation_rmse_deg = 0.0;
  double velocity_rmse = 0.0;
  double prediction_rmse = 0.0;  // of the prediction before the match
  double last_position_error = 0.0;
  double tilt_deg = 0.0;  // of the world at the end
  NavState last;
  Initialisation how = Initialisation::kNone;
  int gated = 0;
  bool levelled = false;
  ImuTrust trust;
  std::string bytes;
};

// The matches of the test tell their noise rightly, so the model takes it as told.
MotionConfig motion_config() {
  MotionConfig config;
  config.lidar.source = LidarNoise::kInformation;
  config.lidar.information_divisor = 1.0;
  return config;
}

struct Play {
  TestCarrier::Config carrier;
  MotionConfig motion = motion_config();
  double duration = 30.0;
  bool use_imu = true;
  std::function<void(double, ImuSample&)> spoil;  // changes a sample
  std::function<bool(double)> imu_there = [](double) { return true; };
  std::function<void(double, std::optional<LidarFactor>&)> spoil_match;
  double save_at = -1.0;  // writes and reads the whole state into a new model at this time
  std::vector<NavState>* states = nullptr;
};

void add_error(const NavState& state, const NavState& predicted, const Pose& truth,
               const Eigen::Vector3d& velocity, SmoothedRun& run) {
  const Vector6d error = right_difference(state.world_from_body, truth);
  run.rotation_rmse_deg += error.head<3>().squaredNorm() / (kDegree * kDegree);
  run.last_position_error = error.tail<3>().norm();
  run.position_rmse += error.tail<3>().squaredNorm();
  run.velocity_rmse += (state.velocity_in_world - velocity).squaredNorm();
  run.prediction_rmse += right_difference(predicted.world_from_body, truth).tail<3>().squaredNorm();
}

// Sums of `n` squares to roots of their means, and what the model knows at the end.
void finish(const MotionModel& model, const Eigen::Vector3d& up, int n, SmoothedRun& run) {
  for (double* sum :
       {&run.position_rmse, &run.rotation_rmse_deg, &run.velocity_rmse, &run.prediction_rmse})
    *sum = std::sqrt(*sum / n);
  run.how = model.initialisation();
  run.trust = model.imu_trust();
  // The true vertical in the model's world, as the model's own levelling sees it.
  run.tilt_deg = std::acos(std::min(1.0, (model.level_from_world() * up).z())) / kDegree;
  BinaryWriter writer;
  model.save(writer);
  run.bytes = writer.bytes();
  if (std::getenv("UNDERSTORY_PRINT") != nullptr)
    std::printf("pos %.4f m rot %.4f deg vel %.4f m/s pred %.4f m tilt %.3f deg gated %d\n",
                run.position_rmse, run.rotation_rmse_deg, run.velocity_rmse, run.prediction_rmse,
                run.tilt_deg, run.gated);
}

SmoothedRun play(const Play& setup) {
  TestCarrier carrier(setup.carrier);
  Log log;
  Rig rig;
  rig.body_from_imu = setup.carrier.body_from_imu;
  const auto make = [&] {
    return setup.use_imu ? make_imu_smoother(setup.motion, rig, &log)
                         : make_constant_velocity_model(setup.motion, &log);
  };
  auto model = make();
  SmoothedRun run;
  Pose model_from_truth;
  double imu_time = 0.0;
  int n = 0;
  const int scans = static_cast<int>(setup.duration * 10.0);
  for (int k = 0; k < scans; ++k) {
    const double t = 0.5 + 0.1 * k;
    for (; imu_time <= t + 0.1; imu_time += 1.0 / setup.carrier.imu_rate_hz) {
      ImuSample sample = carrier.imu(imu_time);
      if (setup.spoil) setup.spoil(imu_time, sample);
      if (setup.imu_there(imu_time) && setup.use_imu) model->add_imu(sample);
    }
    const TimeNs stamp = TestCarrier::stamp(t);
    const NavState predicted = model->predict(stamp);
    std::optional<LidarFactor> match;
    if (k > 0) match = carrier.lidar(t, model_from_truth);
    if (setup.spoil_match) setup.spoil_match(t, match);
    const MotionUpdate update = model->add_scan(stamp, match);
    if (k == 0)
      model_from_truth = update.state.world_from_body * carrier.world_from_body(t).inverse();
    if (update.new_world_from_old_world) {
      model_from_truth = *update.new_world_from_old_world * model_from_truth;
      run.levelled = true;
    }
    if (update.status == MotionStatus::kVelocityGate) ++run.gated;
    if (setup.states != nullptr) setup.states->push_back(update.state);
    if (setup.save_at >= 0.0 && std::abs(t - setup.save_at) < 0.05) {
      BinaryWriter writer;
      model->save(writer);
      model = make();
      BinaryReader reader(writer.bytes(), "test");
      model->load(reader);
      EXPECT_TRUE(reader.at_end());
    }
    run.last = update.state;
    if (t < 6.0) continue;
    add_error(update.state, predicted, model_from_truth * carrier.world_from_body(t),
              model_from_truth.rotation() * carrier.velocity(t), run);
    ++n;
  }
  finish(*model, model_from_truth.rotation() * Eigen::Vector3d::UnitZ(), n, run);
  return run;
}

void expect_good(const SmoothedRun& run) {
  // Better than one match (5 mm and 0.0286 deg per axis).
  EXPECT_LT(run.position_rmse, 0.0087);
  EXPECT_LT(run.rotation_rmse_deg, 0.0496);
  EXPECT_LT(run.velocity_rmse, 0.05);
  EXPECT_LT(run.prediction_rmse, 0.012);
  EXPECT_LT(run.tilt_deg, 0.3);
  EXPECT_EQ(run.gated, 0);
  EXPECT_TRUE(run.trust.trusted) << run.trust.reason;
}

// P3 "prior": positions of other sensors, whose rotation says nothing, stand instead of matches.
TEST(ImuSmoother, PositionsWithTheirOwnCovarianceKeepItOnItsWay) {
  Play setup;
  setup.spoil_match = [](double t, std::optional<LidarFactor>& match) {
    if (t < 8.0 || !match) return;
    Vector6d variance;
    variance << Eigen::Vector3d::Constant(100.0), Eigen::Vector3d::Constant(0.03 * 0.03);
    match->covariance = Matrix6d(variance.asDiagonal());
    const Eigen::Vector3d off(0.03 * std::sin(9.0 * t), 0.03 * std::cos(7.0 * t), 0.0);
    const Pose& there = match->world_from_body;
    match->world_from_body = Pose(so3_exp(Eigen::Vector3d(0.3, -0.2, 0.5)) * there.rotation(),
                                  there.translation() + off);
  };
  const SmoothedRun run = play(setup);
  EXPECT_LT(run.position_rmse, 0.04);
  EXPECT_LT(run.rotation_rmse_deg, 1.0);
  EXPECT_EQ(run.gated, 0);
  EXPECT_TRUE(run.trust.trusted) << run.trust.reason;
}

// Noise that is stated with a wide margin, as by default, weighs as it did. What the state says of
// its error is brought to the size of the error.
TEST(ImuSmoother, StatesErrorsOfTheSizeThatResidualsSpeakFor) {
  Play setup;
  setup.motion = MotionConfig();
  std::vector<NavState> with;
  setup.states = &with;
  const SmoothedRun scaled = play(setup);
  std::vector<NavState> without;
  setup.states = &without;
  setup.motion.covariance_from_residuals = false;
  play(setup);
  const auto stated = [](const NavState& state) {
    return std::sqrt(state.pose_covariance.diagonal().tail<3>().sum());
  };
  EXPECT_GT(stated(without.back()), 2.5 * scaled.position_rmse);
  EXPECT_LT(stated(with.back()), 1.6 * scaled.position_rmse);
  EXPECT_GT(stated(with.back()), 0.6 * scaled.position_rmse);
  ASSERT_EQ(with.size(), without.size());
  for (std::size_t i = 0; i < with.size(); ++i)
    EXPECT_EQ(with[i].world_from_body.matrix(), without[i].world_from_body.matrix());
}

// A scan that found no match has what the model says: residuals of matches do not speak for it.
TEST(ImuSmoother, AScanWithoutAMatchKeepsTheModelsCovariance) {
  Play setup;
  setup.motion = MotionConfig();
  setup.duration = 20.0;
  setup.spoil_match = [](double t, std::optional<LidarFactor>& match) {
    if (t > 20.35) match.reset();
  };
  std::vector<NavState> states;
  setup.states = &states;
  play(setup);
  const auto variance = [&](std::size_t from_end) {
    return states[states.size() - from_end].pose_covariance(4, 4);
  };
  EXPECT_GT(variance(1), 4.0 * variance(3));
}

TEST(ImuSmoother, FollowsFromAStillStart) {
  Play setup;
  setup.carrier.still_s = 2.0;
  const SmoothedRun run = play(setup);
  expect_good(run);
  EXPECT_EQ(run.how, Initialisation::kStill);
}

TEST(ImuSmoother, FollowsFromAStartInMotion) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    Play setup;
    setup.carrier.seed = seed;
    const SmoothedRun run = play(setup);
    expect_good(run);
    EXPECT_EQ(run.how, Initialisation::kInMotion);
    EXPECT_TRUE(run.levelled);
  }
}

TEST(ImuSmoother, BodyAwayFromTheImu) {
  Play setup;
  setup.carrier.body_from_imu = Pose(so3_exp({0.4, -1.2, 2.0}), Eigen::Vector3d(0.5, -0.3, 0.8));
  expect_good(play(setup));
}

TEST(ImuSmoother, Isam2FollowsToo) {
  Play setup;
  setup.motion.method = SmootherMethod::kIsam2;
  setup.motion.isam2_restart = 50;
  SmoothedRun run = play(setup);
  // Gravity is fixed once iSAM2 takes over, so the levelling stays what it was after three seconds.
  EXPECT_LT(run.tilt_deg, 0.8);
  run.tilt_deg = 0.0;
  expect_good(run);
}

TEST(ImuSmoother, ConstantVelocityWithoutImu) {
  Play setup;
  setup.use_imu = false;
  std::vector<NavState> states;
  setup.states = &states;
  const SmoothedRun run = play(setup);
  EXPECT_EQ(run.how, Initialisation::kNoImu);
  EXPECT_LT(run.position_rmse, 0.012);
  EXPECT_LT(run.velocity_rmse, 0.4);
  EXPECT_FALSE(run.levelled);
  EXPECT_LT(states.front().world_from_body.log().norm(), 1e-9);
}

TEST(ImuSmoother, FirstPoseIsAtTheOriginWithHeadingZero) {
  std::vector<NavState> states;
  Play setup;
  setup.duration = 7.0;
  setup.carrier.still_s = 2.0;
  setup.carrier.body_from_imu = Pose(so3_exp({0.4, -1.2, 2.0}), Eigen::Vector3d(0.5, -0.3, 0.8));
  setup.states = &states;
  EXPECT_GT(play(setup).last.stamp, 0);
  EXPECT_LT(states.front().world_from_body.translation().norm(), 1e-9);
  const Eigen::Vector3d forward =
      states.front().world_from_body.rotation() * Eigen::Vector3d::UnitX();
  EXPECT_NEAR(std::atan2(forward.y(), forward.x()), 0.0, 1e-9);
}

// A match that is 0.4 m off for two scans is dropped; the estimate stays with the IMU. P2-8.
TEST(ImuSmoother, VelocityGateDropsWrongMatches) {
  for (const auto method : {SmootherMethod::kFixedLag, SmootherMethod::kIsam2}) {
    Play setup;
    setup.motion.method = method;
    setup.spoil_match = [](double t, std::optional<LidarFactor>& match) {
      if (match && t > 15.05 && t < 15.25)
        match->world_from_body =
            match->world_from_body * Pose(Eigen::Quaterniond::Identity(), {0.4, 0.0, 0.0});
    };
    const SmoothedRun with = play(setup);
    EXPECT_EQ(with.gated, 2);
    EXPECT_LT(with.position_rmse, 0.0087);
    if (method == SmootherMethod::kIsam2) continue;
    setup.motion.velocity_gate_m_s = 0.0;
    setup.motion.angular_gate_deg_s = 0.0;
    EXPECT_GT(play(setup).position_rmse, 2.0 * with.position_rmse);
  }
}

// The paper's form of the gate: velocity against that of the previous state alone.
TEST(ImuSmoother, VelocityGateAgainstThePreviousState) {
  Play setup;
  setup.motion.velocity_gate_reference = VelocityGateReference::kPreviousState;
  setup.motion.velocity_gate_m_s = 0.8;
  setup.spoil_match = [](double t, std::optional<LidarFactor>& match) {
    if (match && t > 15.05 && t < 15.15)
      match->world_from_body =
          match->world_from_body * Pose(Eigen::Quaterniond::Identity(), {3.0, 0.0, 0.0});
  };
  EXPECT_EQ(play(setup).gated, 1);
}

// Where the map itself has moved, the gate gives way after a few scans.
TEST(ImuSmoother, GateOpensWhenTheMatchesInsist) {
  Play setup;
  setup.spoil_match = [](double t, std::optional<LidarFactor>& match) {
    if (match && t > 15.0)
      match->world_from_body =
          Pose(Eigen::Quaterniond::Identity(), {0.5, 0.0, 0.0}) * match->world_from_body;
  };
  const SmoothedRun run = play(setup);
  EXPECT_EQ(run.gated, 5);
  EXPECT_NEAR(run.last_position_error, 0.5, 0.03);
}

TEST(ImuSmoother, GapsAndEndOfTheImu) {
  Play setup;
  setup.imu_there = [](double t) { return (t < 10.0 || t > 10.35) && t < 20.0; };
  const SmoothedRun run = play(setup);
  EXPECT_LT(run.position_rmse, 0.02);
  EXPECT_EQ(run.gated, 0);
}

TEST(ImuSmoother, ImuThatStartsLate) {
  Play setup;
  setup.imu_there = [](double t) { return t > 3.0; };
  setup.duration = 40.0;
  const SmoothedRun run = play(setup);
  EXPECT_EQ(run.how, Initialisation::kInMotion);
  EXPECT_TRUE(run.levelled);
  EXPECT_LT(run.tilt_deg, 0.5);
}

// NaN, saturation and samples out of order change the estimate by no more than their absence.
TEST(ImuSmoother, BadSamplesAreDropped) {
  Play setup;
  setup.spoil = [](double t, ImuSample& sample) {
    const int n = static_cast<int>(std::lround(t * 200.0));
    if (n % 53 == 0) sample.angular_rate.x() = std::nan("");
    if (n % 67 == 0) sample.specific_force.z() = 400.0;
    if (n % 71 == 0) sample.stamp -= 20'000'000;
    if (n % 73 == 0) sample.angular_rate.y() = -60.0;
  };
  expect_good(play(setup));
}

TEST(ImuSmoother, LidarOutageOfASecond) {
  Play setup;
  setup.spoil_match = [](double t, std::optional<LidarFactor>& match) {
    if (t > 15.0 && t < 16.0) match.reset();
  };
  const SmoothedRun run = play(setup);
  EXPECT_EQ(run.gated, 0);
  EXPECT_LT(run.position_rmse, 0.03);
}

TEST(ImuSmoother, SwappedAxesAreFoundOut) {
  Play setup;
  setup.spoil = [](double, ImuSample& sample) {
    std::swap(sample.angular_rate.x(), sample.angular_rate.y());
    std::swap(sample.specific_force.x(), sample.specific_force.y());
  };
  const SmoothedRun run = play(setup);
  EXPECT_FALSE(run.trust.trusted);
  EXPECT_NE(run.trust.reason.find("x=+y y=+x z=+z"), std::string::npos) << run.trust.reason;
  // And the run goes on without it.
  EXPECT_LT(run.last_position_error, 0.03);
}

TEST(ImuSmoother, WrongExtrinsicsAreFoundOut) {
  Play setup;
  const Eigen::Quaterniond turn = so3_exp({0.0, 0.0, 0.8});
  setup.spoil = [&](double, ImuSample& sample) {
    sample.angular_rate = turn * sample.angular_rate;
    sample.specific_force = turn * sample.specific_force;
  };
  const SmoothedRun run = play(setup);
  EXPECT_FALSE(run.trust.trusted);
  EXPECT_NE(run.trust.reason.find("looks mounted about 4"), std::string::npos) << run.trust.reason;
  EXPECT_LT(run.last_position_error, 0.03);
}

TEST(ImuSmoother, WrongUnitOfTheAccelerometerIsFoundOut) {
  Play setup;
  setup.spoil = [](double, ImuSample& sample) { sample.specific_force /= 9.81; };
  const SmoothedRun run = play(setup);
  EXPECT_FALSE(run.trust.trusted);
  EXPECT_LT(run.position_rmse, 0.02);
}

// What a checkpoint holds is everything: the bytes at the end are those of an undisturbed run.
TEST(ImuSmoother, ResumesBitForBit) {
  for (const auto method : {SmootherMethod::kFixedLag, SmootherMethod::kIsam2}) {
    for (const double at : {0.5, 2.0, 9.3}) {
      Play setup;
      setup.motion.method = method;
      setup.motion.isam2_restart = 30;
      setup.duration = 12.0;
      setup.spoil_match = [](double t, std::optional<LidarFactor>& match) {
        if (match && t > 8.95 && t < 9.05)
          match->world_from_body =
              match->world_from_body * Pose(Eigen::Quaterniond::Identity(), {0.4, 0.0, 0.0});
      };
      const SmoothedRun whole = play(setup);
      setup.save_at = at;
      EXPECT_EQ(play(setup).bytes, whole.bytes) << "saved at " << at;
    }
  }
}

TEST(ImuSmoother, MemoryIsBounded) {
  for (const auto method : {SmootherMethod::kFixedLag, SmootherMethod::kIsam2}) {
    Play setup;
    setup.motion.method = method;
    setup.motion.isam2_restart = 20;
    setup.duration = 15.0;
    const std::size_t short_run = play(setup).bytes.size();
    setup.duration = 30.0;
    EXPECT_LT(static_cast<double>(play(setup).bytes.size()), 1.6 * static_cast<double>(short_run));
  }
}

// A strong bias on a carrier that hardly turns is not mistaken for wrong axes.
TEST(ImuSmoother, BiasIsNotMistakenForWrongAxes) {
  Play setup;
  setup.carrier.gyro_bias = {0.03, -0.03, 0.03};
  const SmoothedRun run = play(setup);
  EXPECT_TRUE(run.trust.trusted) << run.trust.reason;
  EXPECT_LT(run.position_rmse, 0.0087);
}

// The world may be moved at any time: the estimates move with it.
TEST(ImuSmoother, MovedWorld) {
  TestCarrier::Config config;
  TestCarrier carrier(config);
  Rig rig;
  rig.body_from_imu = Pose();
  MotionConfig motion = motion_config();
  motion.level_world = false;
  auto a = make_imu_smoother(motion, rig, nullptr);
  auto b = make_imu_smoother(motion, rig, nullptr);
  Pose model_from_truth;
  Pose moved;
  double imu_time = 0.0;
  for (int k = 0; k < 60; ++k) {
    const double t = 0.5 + 0.1 * k;
    for (; imu_time <= t + 0.1; imu_time += 0.005) {
      const ImuSample sample = carrier.imu(imu_time);
      a->add_imu(sample);
      b->add_imu(sample);
    }
    if (k == 30) {
      moved = Pose(so3_exp({0.0, 0.0, 1.3}), Eigen::Vector3d(10.0, -5.0, 2.0));
      b->move_world(moved);
    }
    std::optional<LidarFactor> match;
    if (k > 0) match = carrier.lidar(t, model_from_truth);
    const MotionUpdate in_a = a->add_scan(TestCarrier::stamp(t), match);
    if (match) match->world_from_body = moved * match->world_from_body;
    const MotionUpdate in_b = b->add_scan(TestCarrier::stamp(t), match);
    if (k == 0)
      model_from_truth = in_a.state.world_from_body * carrier.world_from_body(t).inverse();
    EXPECT_LT(
        right_difference(in_b.state.world_from_body, moved * in_a.state.world_from_body).norm(),
        1e-6);
    EXPECT_LT(
        (in_b.state.velocity_in_world - moved.rotation() * in_a.state.velocity_in_world).norm(),
        1e-5);
  }
}

TEST(ImuSmoother, PathOverAScanAgreesWithThePredictions) {
  TestCarrier::Config config;
  TestCarrier carrier(config);
  Rig rig;
  rig.body_from_imu = Pose(so3_exp({0.1, 0.0, 1.0}), Eigen::Vector3d(0.1, 0.0, 0.2));
  auto model = make_imu_smoother(motion_config(), rig, nullptr);
  for (double t = 0.0; t < 0.3; t += 0.005)
    model->add_imu(carrier.imu(t));
  EXPECT_EQ(model->add_scan(TestCarrier::stamp(0.1), std::nullopt).status, MotionStatus::kAccepted);
  const TimeNs from = TestCarrier::stamp(0.1503);
  const TimeNs to = TestCarrier::stamp(0.4);  // the IMU ends before
  const auto path = model->predict_path(from, to);
  EXPECT_EQ(path.front().stamp, from);
  EXPECT_EQ(path.back().stamp, to);
  EXPECT_GT(path.size(), 30U);
  for (std::size_t i = 1; i < path.size(); ++i)
    EXPECT_GT(path[i].stamp, path[i - 1].stamp);
  for (const StampedPose& pose : path) {
    if (pose.stamp > TestCarrier::stamp(0.295)) break;
    const NavState state = model->predict(pose.stamp);
    EXPECT_LT(right_difference(state.world_from_body, pose.world_from_body).norm(), 2e-4);
  }
}

}  // namespace
}  // namespace understory
