#pragma once

#include <string>
#include <vector>

namespace understory {

// Sensors that were measured, as settings of a site ("imu.gyro_noise=..."). A site names one by
// imu_preset or gnss_preset. What it or a setting says of the same keys besides: the preset goes
// over the site's file, a setting over the preset.
struct SensorPreset {
  std::string name;
  std::vector<std::string> settings;
};

// vectornav, xsens: the Allan figures of the two IMUs of the FoMo data set (Foret Montmorency),
// means over the axes.
[[nodiscard]] const std::vector<SensorPreset>& imu_presets();
// phone: as telephones behaved that stood still under trees (docs/method/simulation.md).
[[nodiscard]] const std::vector<SensorPreset>& gnss_presets();

// The settings of a preset; none for the name "site". Throws ConfigError for any other name.
[[nodiscard]] std::vector<std::string> preset_settings(const std::vector<SensorPreset>& presets,
                                                       const std::string& key,
                                                       const std::string& name);

}  // namespace understory
