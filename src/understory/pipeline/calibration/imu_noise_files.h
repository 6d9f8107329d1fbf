#pragma once

#include <filesystem>
#include <string>

#include "understory/calibration/imu_noise/imu_noise_calibration.h"

namespace understory {

// What the files say beside the figures.
struct ImuNoiseFacts {
  std::string recording;  // as the user named it
  double factor = 1.0;    // times the figures, for the settings; above 0
};

// The names of the files below, of which a folder holds nothing else.
[[nodiscard]] bool is_imu_noise_file(const std::string& name);

// The settings of `map` for this IMU, as YAML for `--config`: of each figure the largest of the
// three axes, times the factor. A figure that was found on no axis is left out.
[[nodiscard]] std::string imu_settings_yaml(const ImuNoise& noise, const ImuNoiseFacts& facts);

// Writes imu.yaml (the settings), imu_noise.csv (figures of each axis), allan.csv (the curves) and
// imu_noise.html (a page with figures and plots) into a folder that exists. Throws OutputError.
void write_imu_noise(const std::filesystem::path& folder, const ImuNoise& noise,
                     const ImuNoiseFacts& facts);

}  // namespace understory
