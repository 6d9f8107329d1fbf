#include "understory/pipeline/calibration/imu_noise_files.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "understory/pipeline/mapping/front_end_config.h"
#include "understory/util/log.h"

namespace understory {
namespace {

ImuNoise known_noise() {
  ImuNoise noise;
  noise.to = from_seconds(3600.0);
  noise.rate_hz = 200.0;
  noise.samples = 720'000;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double size = 1.0 + 0.1 * static_cast<double>(axis);
    for (SensorNoise* sensor : {&noise.gyroscope, &noise.accelerometer}) {
      sensor->axes[axis].white = {1e-3 * size, 1e-5, true, 1e-3};
      sensor->axes[axis].walk = {1e-5 * size, 1e-5, sensor == &noise.gyroscope, 3e-5};
      sensor->curves[axis] = {{1.0, 1e-3, 100}, {10.0, 3e-4, 10}};
    }
  }
  noise.shortcomings = {"accelerometer: <the> walk does not stand out"};
  return noise;
}

TEST(ImuNoiseFiles, SettingsAreTheNoisiestAxisTimesTheFactor) {
  const std::string yaml = imu_settings_yaml(known_noise(), {"still.mcap", 3.0});
  EXPECT_NE(yaml.find("gyro_noise_rad_s_sqrt_hz: 0.0036\n"), std::string::npos) << yaml;
  EXPECT_NE(yaml.find("gyro_bias_walk_rad_s2_sqrt_hz: 3.6e-05\n"), std::string::npos) << yaml;
  EXPECT_EQ(yaml.find("accel_bias_walk"), std::string::npos) << yaml;  // not found on any axis
}

TEST(ImuNoiseFiles, MapReadsTheSettings) {
  const auto folder = std::filesystem::temp_directory_path() / "understory_imu_noise_files";
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  write_imu_noise(folder, known_noise(), {"still.mcap", 1.0});
  Log log;
  const auto read =
      read_front_end_config(kDenseFrontEnd, "", (folder / "imu.yaml").string(), {}, log);
  EXPECT_NE(yaml_of(read.config).find("gyro_noise_rad_s_sqrt_hz: 0.0012\n"), std::string::npos);
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    EXPECT_TRUE(is_imu_noise_file(entry.path().filename().string()));
  std::ifstream page(folder / "imu_noise.html");
  const std::string html((std::istreambuf_iterator<char>(page)), std::istreambuf_iterator<char>());
  EXPECT_NE(html.find("averaging time (s)"), std::string::npos);
  EXPECT_NE(html.find("Allan deviation (rad/s)"), std::string::npos);
  EXPECT_NE(html.find("&lt;the&gt; walk"), std::string::npos);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace understory
