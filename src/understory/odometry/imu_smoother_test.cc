#include <gtest/gtest.h>

#include <functional>
#include <numbers>

#include "understory/odometry/motion_model.h"
#include "understory/odometry/test_carrier.h"

namespace understory {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

struct Outcome {
  double position_rmse = 0.0;  // of the smoothed state against the truth, after the start
  double rotation_rmse_deg = 0.0;
  double velocity_rmse = 0.0;
  double prediction_rmse = 0.0;  // of the prediction before the match
  double tilt_deg = 0.0;         // of the world at the end
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

Outcome play(const Play& setup) {
  TestCarrier carrier(setup.carrier);
  Log log;
  Rig rig;
  rig.body_from_imu = setup.carrier.body_from_imu;
  const auto make = [&] {
    return setup.use_imu ? make_imu_smoother(setup.motion, rig, &log)
                         : make_constant_velocity_model(setup.motion, &log);
  };
  auto model = make();
  Outcome run;
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
    const Pose truth = model_from_truth * carrier.world_from_body(t);
    const Vector6d error = right_difference(update.state.world_from_body, truth);
    run.rotation_rmse_deg += error.head<3>().squaredNorm() / (kDegree * kDegree);
    run.position_rmse += error.tail<3>().squaredNorm();
    run.velocity_rmse +=
        (update.state.velocity_in_world - model_from_truth.rotation() * carrier.velocity(t))
            .squaredNorm();
    run.prediction_rmse +=
        right_difference(predicted.world_from_body, truth).tail<3>().squaredNorm();
    ++n;
  }
  for (double* sum :
       {&run.position_rmse, &run.rotation_rmse_deg, &run.velocity_rmse, &run.prediction_rmse})
    *sum = std::sqrt(*sum / n);
  run.how = model->initialisation();
  run.trust = model->imu_trust();
  // The true vertical in the model's world, as the model's own levelling sees it.
  const Eigen::Vector3d up =
      model->level_from_world() * (model_from_truth.rotation() * Eigen::Vector3d::UnitZ());
  run.tilt_deg = std::acos(std::min(1.0, up.z())) / kDegree;
  BinaryWriter writer;
  model->save(writer);
  run.bytes = writer.bytes();
  if (std::getenv("UNDERSTORY_PRINT") != nullptr)
    std::printf("pos %.4f m rot %.4f deg vel %.4f m/s pred %.4f m tilt %.3f deg gated %d\n",
                run.position_rmse, run.rotation_rmse_deg, run.velocity_rmse, run.prediction_rmse,
                run.tilt_deg, run.gated);
  return run;
}

void expect_good(const Outcome& run) {
  // Better than one match (5 mm and 0.0286 deg per axis).
  EXPECT_LT(run.position_rmse, 0.0087);
  EXPECT_LT(run.rotation_rmse_deg, 0.0496);
  EXPECT_LT(run.velocity_rmse, 0.05);
  EXPECT_LT(run.prediction_rmse, 0.012);
  EXPECT_LT(run.tilt_deg, 0.3);
  EXPECT_EQ(run.gated, 0);
  EXPECT_TRUE(run.trust.trusted) << run.trust.reason;
}

TEST(ImuSmoother, FollowsFromAStillStart) {
  Play setup;
  setup.carrier.still_s = 2.0;
  const Outcome run = play(setup);
  expect_good(run);
  EXPECT_EQ(run.how, Initialisation::kStill);
}

TEST(ImuSmoother, FollowsFromAStartInMotion) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    Play setup;
    setup.carrier.seed = seed;
    const Outcome run = play(setup);
    expect_good(run);
    EXPECT_EQ(run.how, Initialisation::kInMotion);
    EXPECT_TRUE(run.levelled);
  }
}

}  // namespace
}  // namespace understory
