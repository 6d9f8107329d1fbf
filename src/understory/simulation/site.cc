#include "understory/simulation/site.h"

#include <filesystem>

#include "understory/util/error.h"

namespace understory {
namespace {

const ConfigTable::Range kPositive{1e-9, 1e9};
const ConfigTable::Range kNotNegative{0.0, 1e9};

void describe_ground(ConfigTable& table, SiteConfig& c) {
  table.section("origin", [&] {
    table.add("latitude_deg", c.origin.latitude_deg, {-89.0, 89.0}, "deg", "of the truth's origin");
    table.add("longitude_deg", c.origin.longitude_deg, {-180.0, 180.0}, "deg", "of the origin");
    table.add("height_m", c.origin.height_m, {-500.0, 9000.0}, "m", "above the ellipsoid");
    table.add("start_time_s", c.origin.start_time_s, {0.0, 4e9}, "s", "Unix time of the start");
  });
  table.section("terrain", [&] {
    table.add("cell_m", c.terrain.cell_m, {0.1, 5.0}, "m", "edge of the ground's grid");
    table.add("relief_m", c.terrain.relief_m, {0.0, 50.0}, "m", "standard deviation of hills");
    table.add("wavelength_m", c.terrain.wavelength_m, {5.0, 1000.0}, "m", "of hills");
    table.add("slope_deg", c.terrain.slope_deg, {0.0, 35.0}, "deg", "of the whole site");
    table.add("slope_azimuth_deg", c.terrain.slope_azimuth_deg, {-360.0, 360.0}, "deg",
              "uphill, counted from east to north");
    table.add("hummock_m", c.terrain.hummock_m, {0.0, 1.0}, "m", "standard deviation of hummocks");
    table.add("roughness_m", c.terrain.roughness_m, {0.0, 0.3}, "m",
              "standard deviation of the grid's own noise");
  });
}

void describe_stand(ConfigTable& table, StandConfig& c) {
  table.section("stand", [&] {
    table.add("size_x_m", c.size_x_m, {5.0, 3000.0}, "m", "of the stand, east");
    table.add("size_y_m", c.size_y_m, {5.0, 3000.0}, "m", "of the stand, north");
    table.add("trees_per_ha", c.trees_per_ha, {0.0, 4000.0}, "1/ha", "trees with a diameter");
    table.add("spacing_m", c.spacing_m, {0.3, 20.0}, "m", "no two trees closer");
    table.add("path_clearance_m", c.path_clearance_m, {0.5, 20.0}, "m", "bark to the path");
    table.add("dbh_mean_m", c.dbh_mean_m, {0.05, 1.5}, "m", "mean diameter at 1.3 m");
    table.add("dbh_sd_m", c.dbh_sd_m, {0.0, 0.5}, "m", "its standard deviation");
    table.add("dbh_min_m", c.dbh_min_m, {0.03, 1.5}, "m", "smallest diameter");
    table.add("dbh_max_m", c.dbh_max_m, {0.05, 2.0}, "m", "largest diameter");
    table.add("height_mean_m", c.height_mean_m, {2.0, 50.0}, "m", "of a tree of mean diameter");
    table.add("pine_share", c.pine_share, {0.0, 1.0}, "", "of the trees");
    table.add("spruce_share", c.spruce_share, {0.0, 1.0}, "", "of the trees; the rest is birch");
    table.add("lean_sd_deg", c.lean_sd_deg, {0.0, 20.0}, "deg", "lean in each direction");
    table.add("sweep_m", c.sweep_m, {0.0, 1.0}, "m", "bow of a stem");
    table.add("dead_branches", c.dead_branches, {0.0, 5.0}, "", "density below the crown");
    table.add("foliage", c.foliage, {0.0, 5.0}, "", "density of leaves and needles");
    table.add("seedlings_per_ha", c.seedlings_per_ha, {0.0, 50000.0}, "1/ha", "small trees");
    table.add("shrubs_per_ha", c.shrubs_per_ha, {0.0, 50000.0}, "1/ha", "bushes");
    table.add("ground_plants_per_ha", c.ground_plants_per_ha, {0.0, 50000.0}, "1/ha",
              "patches of knee-high plants");
    table.add("stumps_per_ha", c.stumps_per_ha, {0.0, 5000.0}, "1/ha", "stumps");
    table.add("logs_per_ha", c.logs_per_ha, {0.0, 5000.0}, "1/ha", "lying stems");
    table.add("wind_sway_m", c.wind_sway_m, {0.0, 2.0}, "m",
              "standard deviation of the sway of a crown's top");
  });
}

void describe_carrier(ConfigTable& table, CarrierConfig& c) {
  table.section("carrier", [&] {
    table.add_choice("kind", c.kind, {"walk", "harvester"}, "how the sensors are carried");
    table.add_choice("body", c.body, {"imu", "base_link"}, "frame whose path is planned");
    table.add("length_m", c.length_m, {1.0, 5000.0}, "m", "of the route");
    table.add("speed_m_s", c.speed_m_s, {0.05, 15.0}, "m/s", "mean while moving");
    table.add("still_s", c.still_s, {0.0, 600.0}, "s", "standing still at the start");
    table.add("height_m", c.height_m, {0.0, 100.0}, "m", "of the body above the ground");
    table.add("gait_m", c.gait_m, {0.0, 0.5}, "m", "bob of a step");
    table.add("gait_deg", c.gait_deg, {0.0, 20.0}, "deg", "pitch and roll of a step");
    table.add("tilt_sd_deg", c.tilt_sd_deg, {0.0, 30.0}, "deg", "slow tilting");
    table.add("yaw_wander_deg", c.yaw_wander_deg, {0.0, 90.0}, "deg", "slow turning to and fro");
    table.add("turn_interval_s", c.turn_interval_s, {1.0, 1e6}, "s",
              "mean time between quick turns, or between stops of a machine");
    table.add("turn_deg", c.turn_deg, {0.0, 360.0}, "deg", "largest turn or swing");
    table.add("turn_rate_deg_s", c.turn_rate_deg_s, {1.0, 600.0}, "deg/s", "peak rate of a turn");
  });
}

void describe_lidar(ConfigTable& table, LidarConfig& c) {
  table.section("lidar", [&] {
    table.add_choice("model", c.model, {"OS0-128", "VLP-16"}, "beams and firing times");
    table.add("rate_hz", c.rate_hz, {1.0, 40.0}, "Hz", "revolutions");
    table.add("columns", c.columns, {16, 4096}, "", "of a revolution (OS0-128)");
    table.add("fov_deg", c.fov_deg, {1.0, 360.0}, "deg", "of azimuth, centred forward");
    table.add("mount_m", c.mount_m, "m", "place in the body frame");
    table.add("mount_rpy_deg", c.mount_rpy_deg, "deg", "roll, pitch, yaw in the body frame");
    table.add("rays_per_beam", c.rays_per_beam, {1, 64}, "",
              "rays over the beam's footprint; more than one mixes returns at edges");
    table.add("divergence_mrad", c.divergence_mrad, {0.0, 20.0}, "mrad",
              "full width of the beam (four standard deviations)");
    table.add("beam_exit_m", c.beam_exit_m, {0.0, 0.1}, "m", "beam diameter at the sensor");
    table.add("pulse_m", c.pulse_m, {0.0, 3.0}, "m", "returns closer than this merge into one");
    table.add("range_sd_m", c.range_sd_m, {0.0, 1.0}, "m", "range noise at close range");
    table.add("range_sd_per_m", c.range_sd_per_m, {0.0, 0.1}, "", "its growth with range");
    table.add("bark_sd_m", c.bark_sd_m, {0.0, 0.1}, "m", "roughness of bark");
    table.add("incidence_gain", c.incidence_gain, {0.0, 5.0}, "",
              "growth of the noise with the tangent of incidence");
    table.add("range_step_m", c.range_step_m, {0.0, 0.1}, "m", "resolution of ranges, 0 = none");
    table.add("min_range_m", c.min_range_m, {0.0, 10.0}, "m", "no returns nearer");
    table.add("max_range_m", c.max_range_m, {1.0, 500.0}, "m", "no returns farther");
    table.add("range_10_percent_m", c.range_10_percent_m, {0.1, 1e9}, "m",
              "where half the returns of a 10 % target are lost");
    table.add("dropout", c.dropout, {0.0, 1.0}, "", "share of returns lost for no reason");
    table.add("azimuth_jitter_deg", c.azimuth_jitter_deg, {0.0, 1.0}, "deg", "of the encoder");
  });
}

void describe_imu(ConfigTable& table, ImuConfig& c) {
  table.section("imu", [&] {
    table.add("rate_hz", c.rate_hz, {10.0, 2000.0}, "Hz", "samples");
    table.add("mount_m", c.mount_m, "m", "place in the body frame");
    table.add("mount_rpy_deg", c.mount_rpy_deg, "deg", "roll, pitch, yaw in the body frame");
    table.add("gyro_noise", c.gyro_noise, kNotNegative, "rad/s/sqrt(Hz)", "white noise");
    table.add("accel_noise", c.accel_noise, kNotNegative, "m/s^2/sqrt(Hz)", "white noise");
    table.add("gyro_bias_sd", c.gyro_bias_sd, kNotNegative, "rad/s", "bias at the start");
    table.add("accel_bias_sd", c.accel_bias_sd, kNotNegative, "m/s^2", "bias at the start");
    table.add("gyro_bias_walk", c.gyro_bias_walk, kNotNegative, "rad/s^2/sqrt(Hz)", "random walk");
    table.add("accel_bias_walk", c.accel_bias_walk, kNotNegative, "m/s^3/sqrt(Hz)", "random walk");
    table.add("scale_sd", c.scale_sd, {0.0, 0.1}, "", "scale and misalignment errors");
    table.add("vibration_m_s2", c.vibration_m_s2, kNotNegative, "m/s^2", "of the carrier");
    table.add("vibration_hz", c.vibration_hz, kPositive, "Hz", "its main frequency");
  });
}

void describe_gnss(ConfigTable& table, GnssConfig& c) {
  table.section("gnss", [&] {
    table.add("enabled", c.enabled, "whether there is a receiver");
    table.add("rate_hz", c.rate_hz, {0.1, 50.0}, "Hz", "fixes");
    table.add("mount_m", c.mount_m, "m", "antenna in the body frame");
    table.add("open_sd_m", c.open_sd_m, {0.0, 100.0}, "m", "slow plane error under open sky");
    table.add("canopy_sd_m", c.canopy_sd_m, {0.0, 100.0}, "m", "added under closed canopy");
    table.add("correlation_s", c.correlation_s, {0.1, 1e5}, "s", "of the slow error");
    table.add("multipath_share", c.multipath_share, {0.0, 5.0}, "", "fast over slow error");
    table.add("white_sd_m", c.white_sd_m, {0.0, 100.0}, "m", "white error");
    table.add("height_factor", c.height_factor, {0.0, 10.0}, "", "height over plane error");
    table.add("reported_factor", c.reported_factor, {0.01, 10.0}, "",
              "reported over true standard deviation");
    table.add("outage_interval_s", c.outage_interval_s, {1.0, 1e9}, "s",
              "mean time between outages under closed canopy");
    table.add("outage_s", c.outage_s, {0.0, 1e6}, "s", "mean length of an outage");
  });
}

void check_triple(const std::string& key, const std::vector<double>& value,
                  std::vector<std::string>& problems) {
  if (value.size() != 3) problems.push_back(key + ": expected three numbers");
}

void check_site(const SiteConfig& site) {
  std::vector<std::string> problems;
  check_triple("lidar.mount_m", site.lidar.mount_m, problems);
  check_triple("lidar.mount_rpy_deg", site.lidar.mount_rpy_deg, problems);
  check_triple("imu.mount_m", site.imu.mount_m, problems);
  check_triple("imu.mount_rpy_deg", site.imu.mount_rpy_deg, problems);
  check_triple("gnss.mount_m", site.gnss.mount_m, problems);
  if (site.stand.pine_share + site.stand.spruce_share > 1.0 + 1e-9) {
    problems.push_back("stand: pine_share and spruce_share add up to more than 1");
  }
  if (site.stand.dbh_min_m > site.stand.dbh_max_m) {
    problems.push_back("stand: dbh_min_m is larger than dbh_max_m");
  }
  if (site.lidar.min_range_m >= site.lidar.max_range_m) {
    problems.push_back("lidar: min_range_m is not below max_range_m");
  }
  if (!problems.empty()) throw ConfigError(problems);
}

}  // namespace

void describe(ConfigTable& table, SiteConfig& config) {
  table.add("seed", config.seed, {0, 2e9}, "", "of everything random");
  table.add("duration_s", config.duration_s, {0.0, 1e5}, "s",
            "of the recording, 0 = as long as the route takes");
  describe_ground(table, config);
  describe_stand(table, config.stand);
  describe_carrier(table, config.carrier);
  describe_lidar(table, config.lidar);
  describe_imu(table, config.imu);
  describe_gnss(table, config.gnss);
}

SiteConfig load_site(const std::string& name_or_path, const std::vector<std::string>& settings) {
  SiteConfig site;
  ConfigTable table;
  describe(table, site);
  const ShippedSite* shipped = nullptr;
  std::string names;
  for (const ShippedSite& candidate : shipped_sites()) {
    if (candidate.name == name_or_path) shipped = &candidate;
    names += (names.empty() ? "" : ", ") + candidate.name;
  }
  if (shipped != nullptr) {
    table.read_yaml(shipped->yaml, "site " + shipped->name);
  } else if (std::filesystem::is_regular_file(name_or_path)) {
    table.read_file(name_or_path);
  } else {
    throw InputError(
        name_or_path, "",
        "no such site: expected one of " + names + ", or the path of a site's YAML file");
  }
  table.set(settings);
  check_site(site);
  return site;
}

bool is_simulation_uri(const std::string& text) {
  return text.rfind("sim:", 0) == 0;
}

SimulationUri parse_simulation_uri(const std::string& text) {
  if (!is_simulation_uri(text)) throw ConfigError({text + ": expected sim:SITE?key=value&..."});
  SimulationUri uri;
  const std::size_t question = text.find('?');
  uri.site = text.substr(4, question == std::string::npos ? question : question - 4);
  if (uri.site.empty()) throw ConfigError({text + ": names no site"});
  std::size_t start = question;
  while (start != std::string::npos) {
    const std::size_t end = text.find('&', start + 1);
    const std::string part =
        text.substr(start + 1, end == std::string::npos ? end : end - start - 1);
    if (!part.empty()) uri.settings.push_back(part);
    start = end;
  }
  return uri;
}

}  // namespace understory
