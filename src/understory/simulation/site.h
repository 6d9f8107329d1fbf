#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "understory/util/config.h"

namespace understory {

// What a site is made of. Every member is a key of the site's YAML file (configs/sites/*.yaml) with
// the unit in its name; docs/simulation.md lists them.

struct OriginConfig {  // where the east-north-up frame of the truth has its zero
  double latitude_deg = 61.2;
  double longitude_deg = 25.1;
  double height_m = 148.0;  // above the ellipsoid
  double start_time_s = 1'700'000'000.0;
};

struct TerrainConfig {
  double cell_m = 0.4;              // of the triangle grid
  double relief_m = 1.2;            // standard deviation of the hills
  double wavelength_m = 45.0;       // of the hills
  double slope_deg = 3.0;           // of the whole site
  double slope_azimuth_deg = 30.0;  // uphill, from east to north
  double hummock_m = 0.10;          // standard deviation of hummocks a few metres wide
  double roughness_m = 0.025;       // standard deviation of the grid's own noise
};

struct StandConfig {
  double size_x_m = 140.0;  // the stand's rectangle around the origin
  double size_y_m = 140.0;
  double trees_per_ha = 750.0;
  double spacing_m = 1.6;         // no two trees closer
  double path_clearance_m = 0.8;  // bark to the sensor's path
  double dbh_mean_m = 0.18;
  double dbh_sd_m = 0.06;
  double dbh_min_m = 0.07;
  double dbh_max_m = 0.42;
  double height_mean_m = 15.0;  // of a tree of mean diameter
  double pine_share = 0.5;
  double spruce_share = 0.3;  // the rest is birch
  double lean_sd_deg = 1.6;
  double sweep_m = 0.08;       // standard deviation of the bow of a stem
  double dead_branches = 1.0;  // density of dead branches below the crown, 1 = usual
  double foliage = 1.0;        // density of leaves and needles, 1 = usual
  double seedlings_per_ha = 400.0;
  double shrubs_per_ha = 500.0;
  double ground_plants_per_ha = 2500.0;
  double stumps_per_ha = 60.0;
  double logs_per_ha = 30.0;
  double wind_sway_m = 0.08;  // standard deviation of the sway of a crown's top
};

struct CarrierConfig {
  std::string kind = "walk";
  std::string body = "imu";  // frame of the path: imu or base_link
  double length_m = 250.0;   // of the route
  double speed_m_s = 1.2;
  double still_s = 3.0;      // standing still at the start
  double height_m = 3.2;     // of the body above the ground
  double gait_m = 0.025;     // amplitude of the step's bob
  double gait_deg = 2.0;     // amplitude of the step's pitch and roll
  double tilt_sd_deg = 3.0;  // slow tilting of the pole
  double yaw_wander_deg = 12.0;
  double turn_interval_s = 11.0;   // mean time between quick turns or work stops
  double turn_deg = 130.0;         // largest quick turn or swing
  double turn_rate_deg_s = 140.0;  // peak rate of a quick turn
};

struct LidarConfig {
  std::string model = "OS0-128";
  double rate_hz = 10.0;
  int columns = 1024;      // a revolution; spinning sensors with fixed firing times ignore it
  double fov_deg = 360.0;  // of azimuth, centred on the sensor's x axis
  std::vector<double> mount_m = {0.0, 0.0, 0.06};  // in the body frame
  std::vector<double> mount_rpy_deg = {0.0, 0.0, 0.0};
  int rays_per_beam = 1;
  double divergence_mrad = 6.1;  // full width of the beam, four standard deviations
  double beam_exit_m = 0.0;      // diameter of the beam at the sensor
  double pulse_m = 0.25;         // returns of one beam closer than this merge into one
  double range_sd_m = 0.012;
  double range_sd_per_m = 0.0004;
  double bark_sd_m = 0.003;      // roughness of bark
  double incidence_gain = 0.35;  // growth of the range noise with the tangent of incidence
  double range_step_m = 0.001;
  double min_range_m = 0.5;
  double max_range_m = 55.0;
  double range_10_percent_m = 17.0;  // where half the returns of a 10 % target are lost
  double dropout = 0.004;            // share of returns lost for no reason
  double azimuth_jitter_deg = 0.01;
};

struct ImuConfig {
  double rate_hz = 200.0;
  std::vector<double> mount_m = {0.0, 0.0, 0.0};  // in the body frame
  std::vector<double> mount_rpy_deg = {0.0, 0.0, 0.0};
  double gyro_noise = 8.7e-5;       // rad/s/sqrt(Hz)
  double accel_noise = 5.0e-4;      // m/s^2/sqrt(Hz)
  double gyro_bias_sd = 2.0e-3;     // rad/s at the start
  double accel_bias_sd = 3.0e-2;    // m/s^2
  double gyro_bias_walk = 4.0e-6;   // rad/s^2/sqrt(Hz)
  double accel_bias_walk = 5.0e-5;  // m/s^3/sqrt(Hz)
  double scale_sd = 5.0e-4;         // of scale and misalignment, both sensors
  double vibration_m_s2 = 0.05;     // amplitude of the carrier's vibration
  double vibration_hz = 31.0;
};

struct GnssConfig {
  bool enabled = true;
  double rate_hz = 5.0;
  std::vector<double> mount_m = {0.0, 0.0, 0.15};  // antenna in the body frame
  double open_sd_m = 0.35;                         // slow error in the plane under open sky
  double canopy_sd_m = 2.2;                        // added under closed canopy
  double correlation_s = 45.0;                     // of the slow error
  double multipath_share = 0.35;                   // fast error (2 s) relative to the slow one
  double white_sd_m = 0.04;
  double height_factor = 1.9;       // height error over plane error
  double reported_factor = 0.5;     // reported over true standard deviation: overconfident
  double outage_interval_s = 70.0;  // mean time between outages under closed canopy
  double outage_s = 4.0;
};

struct SiteConfig {
  int seed = 1;
  double duration_s = 0.0;  // 0: as long as the route takes
  OriginConfig origin;
  TerrainConfig terrain;
  StandConfig stand;
  CarrierConfig carrier;
  LidarConfig lidar;
  ImuConfig imu;
  GnssConfig gnss;
};

// Binds every key of a site to `config`.
void describe(ConfigTable& table, SiteConfig& config);

// A site that the program carries with it.
struct ShippedSite {
  std::string name;
  std::string summary;  // the first comment line of its file
  std::string yaml;
};
[[nodiscard]] const std::vector<ShippedSite>& shipped_sites();

// A site by the name of a shipped one or the path of a YAML file, with "key=value" settings
// applied. Throws InputError if there is no such site, ConfigError with all problems for bad keys
// or values.
[[nodiscard]] SiteConfig load_site(const std::string& name_or_path,
                                   const std::vector<std::string>& settings);

// "sim:handheld?seed=3&lidar.rays_per_beam=1" in its parts.
struct SimulationUri {
  std::string site;
  std::vector<std::string> settings;
};
[[nodiscard]] bool is_simulation_uri(const std::string& text);
// Throws ConfigError if the text is no such URI.
[[nodiscard]] SimulationUri parse_simulation_uri(const std::string& text);

}  // namespace understory
