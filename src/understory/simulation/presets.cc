#include "understory/simulation/presets.h"

#include "understory/util/error.h"

namespace understory {

const std::vector<SensorPreset>& imu_presets() {
  static const std::vector<SensorPreset> presets = {
      {"vectornav",
       {"imu.rate_hz=200", "imu.gyro_noise=5.55e-5", "imu.accel_noise=1.14e-3",
        "imu.gyro_instability=1.04e-5", "imu.accel_instability=1.47e-4",
        "imu.gyro_bias_walk=1.05e-6", "imu.accel_bias_walk=1.67e-5"}},
      {"xsens",
       {"imu.rate_hz=200", "imu.gyro_noise=5.30e-4", "imu.accel_noise=9.9e-4",
        "imu.gyro_instability=7.22e-5", "imu.accel_instability=2.1e-4", "imu.gyro_bias_walk=7.7e-6",
        "imu.accel_bias_walk=2.33e-5"}}};
  return presets;
}

const std::vector<SensorPreset>& gnss_presets() {
  static const std::vector<SensorPreset> presets = {
      {"phone",
       {"gnss.rate_hz=1", "gnss.open_sd_m=1.5", "gnss.canopy_sd_m=2.2", "gnss.correlation_s=600",
        "gnss.multipath_share=0.35", "gnss.white_sd_m=0.02", "gnss.height_factor=1.7",
        "gnss.outage_interval_s=60", "gnss.outage_s=12", "gnss.jump_interval_s=150",
        "gnss.jump_m=4", "receiver_hold.below_m_s=0.4", "receiver_hold.release_m=3.5"}},
      {"phone_wild",
       {"gnss.rate_hz=1", "gnss.open_sd_m=1", "gnss.canopy_sd_m=1", "gnss.correlation_s=200",
        "gnss.multipath_share=0.2", "gnss.white_sd_m=0.05", "gnss.height_factor=1.7",
        "gnss.outage_interval_s=1", "gnss.outage_s=1.8", "gnss.jump_interval_s=3",
        "gnss.jump_m=5.5", "gnss.burst_interval_s=40", "gnss.burst_m=50", "gnss.burst_s=5",
        "receiver_hold.below_m_s=0"}},
      {"faitli_evo1",
       {"gnss.open_sd_m=0.5", "gnss.canopy_sd_m=5", "gnss.correlation_s=200",
        "gnss.multipath_share=0.25", "gnss.height_factor=5", "gnss.reported_factor=0.5",
        "gnss.jump_interval_s=120", "gnss.jump_m=1"}},
      {"faitli_evo2",
       {"gnss.open_sd_m=0.5", "gnss.canopy_sd_m=18", "gnss.correlation_s=200",
        "gnss.multipath_share=0.2", "gnss.height_factor=2", "gnss.reported_factor=0.5",
        "gnss.jump_interval_s=120", "gnss.jump_m=1"}},
      {"faitli_tuusniemi1",
       {"gnss.open_sd_m=2", "gnss.canopy_sd_m=24", "gnss.correlation_s=600",
        "gnss.multipath_share=0.2", "gnss.height_factor=1.4", "gnss.reported_factor=0.12",
        "gnss.burst_interval_s=300", "gnss.burst_m=16", "gnss.jump_interval_s=200",
        "gnss.jump_m=4"}},
      {"faitli_tuusniemi3",
       {"gnss.open_sd_m=5", "gnss.canopy_sd_m=60", "gnss.correlation_s=500",
        "gnss.multipath_share=0.2", "gnss.height_factor=1.2", "gnss.reported_factor=0.12",
        "gnss.burst_interval_s=300", "gnss.burst_m=25", "gnss.jump_interval_s=200",
        "gnss.jump_m=6.5"}}};
  return presets;
}

std::vector<std::string> preset_settings(const std::vector<SensorPreset>& presets,
                                         const std::string& key, const std::string& name) {
  if (name == "site") return {};
  std::string names = "site";
  for (const SensorPreset& preset : presets) {
    if (preset.name == name) return preset.settings;
    names += ", " + preset.name;
  }
  throw ConfigError({key + ": is \"" + name + "\", expected one of " + names});
}

}  // namespace understory
