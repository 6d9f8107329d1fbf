// Errors of the IMU noise calibration over seeds: imu_noise HOURS [SEEDS [PRESET]]. Prints the
// medians over axes and seeds of the shares by which the figures are off, and how the errors
// compare with their standard deviations.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "understory/calibration/imu_noise/imu_noise_calibration.h"
#include "understory/simulation/carrier/carrier.h"
#include "understory/simulation/sensors/inertial.h"
#include "understory/simulation/site.h"

namespace understory {
namespace {

struct Errors {
  std::vector<double> shares;
  double squares = 0.0;  // over the variance
  void add(const NoiseFigure& figure, double truth) {
    shares.push_back(std::abs(figure.value / truth - 1.0));
    squares += std::pow((figure.value - truth) / figure.sd, 2.0);
  }
  void print(const char* name) {
    std::sort(shares.begin(), shares.end());
    std::printf("  %-16s median error %6.2f %%, worst %6.1f %%, mean square over variance %.2f\n",
                name, 100.0 * shares[shares.size() / 2], 100.0 * shares.back(),
                squares / static_cast<double>(shares.size()));
  }
};

void measure(double hours, int seeds, const std::string& preset) {
  Errors white;
  Errors instability;
  Errors walk;
  for (int seed = 0; seed < seeds; ++seed) {
    SiteConfig site = load_site("still", {"imu_preset=" + preset});
    site.seed = seed;
    const CarrierPath path(CarrierPath::Spline({Vector6d::Zero()}, 0.05));
    InertialSensor imu(site, path, 0);
    ImuNoiseCalibration calibration;
    while (to_seconds(imu.next_stamp()) < 3600.0 * hours)
      calibration.add(imu.next());
    const ImuNoiseResult result = calibration.result(0);
    if (result.problem != ImuNoiseProblem::kNone) {
      std::printf("seed %d: %s\n", seed, result.reason.c_str());
      continue;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const AxisNoise& gyro = result.noise.gyroscope.axes[axis];
      const AxisNoise& accel = result.noise.accelerometer.axes[axis];
      white.add(gyro.white, site.imu.gyro_noise);
      white.add(accel.white, site.imu.accel_noise);
      instability.add(gyro.instability, site.imu.gyro_instability);
      instability.add(accel.instability, site.imu.accel_instability);
      walk.add(gyro.walk, site.imu.gyro_bias_walk);
      walk.add(accel.walk, site.imu.accel_bias_walk);
    }
  }
  std::printf("%s, %g h, %d seeds\n", preset.c_str(), hours, seeds);
  white.print("white noise");
  instability.print("bias instability");
  walk.print("random walk");
}

}  // namespace
}  // namespace understory

int main(int argc, char** argv) {
  const double hours = argc > 1 ? std::atof(argv[1]) : 1.0;
  const int seeds = argc > 2 ? std::atoi(argv[2]) : 20;
  understory::measure(hours, seeds, argc > 3 ? argv[3] : "vectornav");
  return 0;
}
