// Smoothers of the first graph on a carrier with known truth: time per scan, and root mean square
// errors over five seeds (docs/method/decisions/002-smoother.md).
#include <benchmark/benchmark.h>

#include "understory/odometry/motion/motion_model.h"
#include "understory/odometry/test_carrier.h"

namespace understory {
namespace {

struct Errors {
  double position = 0.0;
  double rotation = 0.0;
  double velocity = 0.0;
  double prediction = 0.0;
  int count = 0;
};

void run(const MotionConfig& config, std::uint64_t seed, benchmark::State& state, Errors& errors) {
  TestCarrier::Config carrier_config;
  carrier_config.seed = seed;
  TestCarrier carrier(carrier_config);
  Rig rig;
  rig.body_from_imu = Pose();
  const auto model = make_imu_smoother(config, rig, nullptr);
  Pose model_from_truth;
  double imu_time = 0.0;
  for (int k = 0; k < 400; ++k) {
    const double t = 0.5 + 0.1 * k;
    std::vector<ImuSample> samples;
    for (; imu_time <= t + 0.1; imu_time += 0.005)
      samples.push_back(carrier.imu(imu_time));
    std::optional<LidarFactor> match;
    if (k > 0) match = carrier.lidar(t, model_from_truth);
    state.ResumeTiming();
    for (const ImuSample& sample : samples)
      model->add_imu(sample);
    const NavState predicted = model->predict(TestCarrier::stamp(t));
    benchmark::DoNotOptimize(
        model->predict_path(TestCarrier::stamp(t), TestCarrier::stamp(t + 0.1)));
    const MotionUpdate update = model->add_scan(TestCarrier::stamp(t), match);
    state.PauseTiming();
    if (k == 0)
      model_from_truth = update.state.world_from_body * carrier.world_from_body(t).inverse();
    if (update.new_world_from_old_world)
      model_from_truth = *update.new_world_from_old_world * model_from_truth;
    if (t < 6.0) continue;
    const Pose truth = model_from_truth * carrier.world_from_body(t);
    const Vector6d error = right_difference(update.state.world_from_body, truth);
    errors.rotation += error.head<3>().squaredNorm();
    errors.position += error.tail<3>().squaredNorm();
    errors.velocity +=
        (update.state.velocity_in_world - model_from_truth.rotation() * carrier.velocity(t))
            .squaredNorm();
    errors.prediction += right_difference(predicted.world_from_body, truth).tail<3>().squaredNorm();
    ++errors.count;
  }
}

void smoother(benchmark::State& state, SmootherMethod method) {
  MotionConfig config;
  config.method = method;
  config.lidar.source = LidarNoise::kInformation;
  config.lidar.information_divisor = 1.0;
  (method == SmootherMethod::kFixedLag ? config.window : config.isam2_restart) =
      static_cast<int>(state.range(0));
  config.iterations = static_cast<int>(state.range(1));
  Errors errors;
  std::uint64_t seed = 1;
  for (auto _ : state) {
    state.PauseTiming();
    run(config, seed++, state, errors);
    state.ResumeTiming();
  }
  state.counters["cpu_per_scan"] =
      benchmark::Counter(static_cast<double>(state.iterations()) * 400.0,
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
  const auto rms = [&](double sum) { return std::sqrt(sum / errors.count); };
  state.counters["position_mm"] = 1000.0 * rms(errors.position);
  state.counters["rotation_mdeg"] = 57295.8 * rms(errors.rotation);
  state.counters["velocity_mm_s"] = 1000.0 * rms(errors.velocity);
  state.counters["prediction_mm"] = 1000.0 * rms(errors.prediction);
}

BENCHMARK_CAPTURE(smoother, fixed_lag, SmootherMethod::kFixedLag)
    ->ArgNames({"states", "steps"})
    ->ArgsProduct({{3, 10, 15, 30}, {1, 2, 4}})
    ->Iterations(5)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(smoother, isam2, SmootherMethod::kIsam2)
    ->ArgNames({"states", "steps"})
    ->ArgsProduct({{20, 100, 400}, {1}})
    ->Iterations(5)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace understory
