#include "understory/simulation/site.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "understory/simulation/drawn_site.h"
#include "understory/simulation/presets.h"
#include "understory/simulation/stand/objects.h"
#include "understory/simulation/stand/stand.h"
#include "understory/util/error.h"
#include "understory/util/files/text_file.h"
#include "understory/util/random.h"

namespace understory {
namespace {

const ConfigTable::Range kPositive{1e-9, 1e9};
const ConfigTable::Range kNotNegative{0.0, 1e9};
const std::vector<std::string> kLidarModels = {"OS0-128", "VLP-16", "OS1-64",  "OS1-128",
                                               "HDL-64",  "RS-16",  "Mid-360", "VLP-32C"};

void describe_mag(ConfigTable& table, MagnetometerConfig& c) {
  table.section("mag", [&] {
    table.add("enabled", c.enabled, "whether the IMU has a magnetometer");
    table.add("rate_hz", c.rate_hz, {1.0, 1000.0}, "Hz", "samples");
    table.add("field_ut", c.field_ut, {1.0, 100.0}, "uT", "of the earth");
    table.add("inclination_deg", c.inclination_deg, {-90.0, 90.0}, "deg", "of it, downwards");
    table.add("declination_deg", c.declination_deg, {-180.0, 180.0}, "deg",
              "of magnetic north, positive to the east");
    table.add("hard_iron_ut", c.hard_iron_ut, {0.0, 1000.0}, "uT", "field of the carrier itself");
    table.add("soft_iron", c.soft_iron, {0.0, 0.5}, "", "how much iron bends the earth's field");
    table.add("noise_ut", c.noise_ut, {0.0, 100.0}, "uT", "white noise of a sample");
  });
}

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
    table.add("ditches", c.terrain.ditches, {0, 100}, "", "ditches across the site");
    table.add("ditch_depth_m", c.terrain.ditch_depth_m, {0.0, 5.0}, "m", "of a ditch");
    table.add("ditch_width_m", c.terrain.ditch_width_m, {0.2, 20.0}, "m", "of a ditch");
    table.add("snow_m", c.terrain.snow_m, {0.0, 3.0}, "m", "depth of the snow on the ground");
    table.add("track_depth", c.terrain.track_depth, {0.0, 1.0}, "",
              "share of the snow that the carrier presses down on its way");
  });
}

void describe_stand(ConfigTable& table, StandConfig& c) {
  table.section("stand", [&] {
    table.add("size_x_m", c.size_x_m, {5.0, 3000.0}, "m", "of the stand, east");
    table.add("size_y_m", c.size_y_m, {5.0, 3000.0}, "m", "of the stand, north");
    table.add("trees_per_ha", c.trees_per_ha, {0.0, 4000.0}, "1/ha", "trees with a diameter");
    table.add("spacing_m", c.spacing_m, {0.3, 20.0}, "m", "no two trees closer");
    table.add("path_clearance_m", c.path_clearance_m, {0.5, 20.0}, "m", "bark to the path");
    table.add("dbh_mean_m", c.dbh_mean_m, {0.005, 1.5}, "m", "mean diameter at 1.3 m");
    table.add("dbh_sd_m", c.dbh_sd_m, {0.0, 0.5}, "m", "its standard deviation");
    table.add("dbh_min_m", c.dbh_min_m, {0.005, 1.5}, "m", "smallest diameter");
    table.add("dbh_max_m", c.dbh_max_m, {0.01, 2.0}, "m", "largest diameter");
    table.add("height_mean_m", c.height_mean_m, {2.0, 50.0}, "m", "of a tree of mean diameter");
    table.add("pine_share", c.pine_share, {0.0, 1.0}, "", "of the trees");
    table.add("spruce_share", c.spruce_share, {0.0, 1.0}, "", "of the trees; the rest is birch");
    table.add("lean_sd_deg", c.lean_sd_deg, {0.0, 20.0}, "deg", "lean in each direction");
    table.add("sweep_m", c.sweep_m, {0.0, 1.0}, "m", "bow of a stem");
    table.add("ovality", c.ovality, {0.0, 0.3}, "",
              "mean of (largest - smallest) / mean diameter of a stem; sections are lobed too");
    table.add("bark_relief_m", c.bark_relief_m, {0.0, 0.03}, "m",
              "relief of bark, standard deviation at the foot of a pine of 25 cm");
    table.add("whorl_swelling_m", c.whorl_swelling_m, {0.0, 0.05}, "m",
              "by which a pine's stem is thicker where branches leave");
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
    table.add("trees", c.trees, "CSV with a list of trees (columns of trees.csv), empty = random");
    table.add("height_min_m", c.height_min_m, {1.5, 50.0}, "m", "no tree lower");
    table.add("crown_base_share", c.crown_base_share, {0.0, 0.95}, "",
              "of a tree's height, 0 = usual for the species");
    table.add("edge_m", c.edge_m, {0.0, 500.0}, "m", "width of a border of tall trees");
    table.add("edge_dbh_mean_m", c.edge_dbh_mean_m, {0.05, 1.5}, "m", "their mean diameter");
    table.add("edge_height_mean_m", c.edge_height_mean_m, {2.0, 50.0}, "m", "their height");
    table.add("margin_m", c.margin_m, {0.0, 1000.0}, "m",
              "the stand reaches so far from the route, 0 = all over its rectangle");
    table.add("narrow_clearance_m", c.narrow_clearance_m, {0.2, 20.0}, "m",
              "bark to the path where it is narrow; branches may reach into it");
    table.add("fork_share", c.fork_share, {0.0, 1.0}, "", "of the trees: two stems higher up");
    table.add("broken_share", c.broken_share, {0.0, 1.0}, "", "of the trees: top broken off");
    table.add("boulders_per_ha", c.boulders_per_ha, {0.0, 5000.0}, "1/ha", "boulders");
    table.add("buildings", c.buildings, {0, 2}, "", "beside the start and the end of the route");
  });
}

void describe_carrier(ConfigTable& table, CarrierConfig& c) {
  table.section("carrier", [&] {
    table.add_choice("kind", c.kind, {"walk", "harvester", "uav", "sleigh", "still"},
                     "how the sensors are carried");
    table.add_choice("body", c.body, {"imu", "base_link"}, "frame whose path is planned");
    table.add("length_m", c.length_m, {1.0, 5000.0}, "m", "of the route");
    table.add("speed_m_s", c.speed_m_s, {0.05, 15.0}, "m/s", "mean while moving");
    table.add("still_s", c.still_s, {0.0, 600.0}, "s", "standing still at the start");
    table.add("first_turn_deg", c.first_turn_deg, {-360.0, 360.0}, "deg",
              "turn on the spot into the route's heading, left positive; it ends 0.5 s before "
              "still_s does, 0 = none");
    table.add("first_turn_rate_deg_s", c.first_turn_rate_deg_s, {1.0, 360.0}, "deg/s",
              "rate of that turn");
    table.add("begins_aloft", c.begins_aloft, "a UAV hovers at the start instead of standing");
    table.add("height_m", c.height_m, {0.0, 100.0}, "m", "of the body above the ground");
    table.add("gait_m", c.gait_m, {0.0, 0.5}, "m", "bob of a step");
    table.add("gait_deg", c.gait_deg, {0.0, 20.0}, "deg", "pitch and roll of a step");
    table.add("tilt_sd_deg", c.tilt_sd_deg, {0.0, 30.0}, "deg", "slow tilting");
    table.add("yaw_wander_deg", c.yaw_wander_deg, {0.0, 90.0}, "deg", "slow turning to and fro");
    table.add("turn_interval_s", c.turn_interval_s, {1.0, 1e6}, "s",
              "mean time between quick turns, or between stops of a machine");
    table.add("turn_deg", c.turn_deg, {0.0, 360.0}, "deg", "largest turn or swing");
    table.add("turn_rate_deg_s", c.turn_rate_deg_s, {1.0, 600.0}, "deg/s", "peak rate of a turn");
    table.add_choice("route", c.route, {"auto", "loop", "strip"},
                     "auto: a strip road for a harvester, a loop for others");
    table.add("laps", c.laps, {1, 20}, "", "of a loop around its middle, each on its own way");
    table.add("route_time_s", c.route_time_s, {0.0, 1e5}, "s",
              "how long the route takes, 0 = as speed and stops give");
    table.add("one_way", c.one_way, "a strip road is driven once, not out and back");
    table.add("strip_roads", c.strip_roads, {1, 50}, "", "parallel roads of the stand");
    table.add("strip_road", c.strip_road, {1, 50}, "", "which of them is driven");
    table.add("strip_spacing_m", c.strip_spacing_m, {3.0, 200.0}, "m", "from road to road");
    table.add_choice("work", c.work, {"quick", "thinning"},
                     "of a harvester at its stops; thinning fills route_time_s with work cycles");
    table.add("back_up_m", c.back_up_m, {0.0, 50.0}, "m", "farthest backing up during a stop");
    table.add("narrow_from", c.narrow_from, {0.0, 1.0}, "", "share of the route: narrow from here");
    table.add("narrow_to", c.narrow_to, {0.0, 1.0}, "", "share of the route: narrow up to here");
    table.add("narrow_speed_m_s", c.narrow_speed_m_s, {0.05, 15.0}, "m/s", "there");
    table.add("halts", c.halts, {0, 1000}, "", "times that a sleigh stands still on its way");
    table.add("halt_s", c.halt_s, {1.0, 1000.0}, "s", "mean length of a halt");
    table.add("tumbles", c.tumbles, {0, 1000}, "", "times that a sleigh nearly turns over");
    table.add("tumble_deg", c.tumble_deg, {0.0, 60.0}, "deg", "its roll then");
  });
}

void describe_lidar(ConfigTable& table, LidarConfig& c) {
  table.section("lidar", [&] {
    table.add_choice("model", c.model, kLidarModels, "beams and firing times");
    table.add("rate_hz", c.rate_hz, {1.0, 40.0}, "Hz", "revolutions");
    table.add("columns", c.columns, {16, 4096}, "", "of a revolution (OS0, OS1)");
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
    table.add("bark_sd_m", c.bark_sd_m, {0.0, 0.1}, "m", "bark finer than the stand's relief");
    table.add("incidence_gain", c.incidence_gain, {0.0, 5.0}, "",
              "growth of the noise with the tangent of incidence");
    table.add("range_step_m", c.range_step_m, {0.0, 0.1}, "m", "resolution of ranges, 0 = none");
    table.add("min_range_m", c.min_range_m, {0.0, 10.0}, "m", "no returns nearer");
    table.add("max_range_m", c.max_range_m, {1.0, 500.0}, "m", "no returns farther");
    table.add("range_10_percent_m", c.range_10_percent_m, {0.1, 1e9}, "m",
              "where half the returns of a 10 % target are lost");
    table.add("dropout", c.dropout, {0.0, 1.0}, "", "share of returns lost for no reason");
    table.add("azimuth_jitter_deg", c.azimuth_jitter_deg, {0.0, 1.0}, "deg", "of the encoder");
    table.add("keep_every", c.keep_every, {1, 100}, "", "only each so-manieth scan is recorded");
    table.add("returns", c.returns, {1, 2}, "", "of a beam: the strongest, or the two strongest");
    table.add("blooming", c.blooming, {0.0, 1.0}, "", "chance that glaring neighbours repeat");
    table.add("crosstalk", c.crosstalk, {0.0, 0.5}, "", "share of ranges out of nothing");
    table.add("snow_fall_per_m", c.snow_fall_per_m, {0.0, 1.0}, "1/m", "flakes in a metre of beam");
    table.add("snow_drop_interval_s", c.snow_drop_interval_s, {0.0, 1e9}, "s",
              "mean time between loads of snow off a branch, 0 = none");
    table.add("cold_noise", c.cold_noise, {0.0, 0.3}, "", "spurious share of a cold lidar");
    table.add("sun_noise", c.sun_noise, {0.0, 1.0}, "", "spurious share of beams into the sun");
    table.add("sun_azimuth_deg", c.sun_azimuth_deg, {0.0, 360.0}, "deg", "clockwise from north");
    table.add("sun_elevation_deg", c.sun_elevation_deg, {-5.0, 90.0}, "deg", "above horizon");
    table.add("elevation_bias_deg", c.elevation_bias_deg, {-5.0, 5.0}, "deg",
              "beams look higher by this than the lidar says");
    table.add("time_offset_s", c.time_offset_s, {-1.0, 1.0}, "s", "scan stamps are late by this");
    table.add("error_m", c.error_m, "m",
              "by which the claimed place is wrong, in the lidar's frame");
    table.add("error_rpy_deg", c.error_rpy_deg, "deg", "by which the claimed attitude is wrong");
  });
}

void describe_second_lidar(ConfigTable& table, SecondLidarConfig& c) {
  table.section("second_lidar", [&] {
    table.add("enabled", c.enabled,
              "whether there is a second lidar, of the model and with the faults of the first one");
    table.add("mount_m", c.mount_m, "m", "its place in the body frame");
    table.add("mount_rpy_deg", c.mount_rpy_deg, "deg", "roll, pitch, yaw in the body frame");
    table.add("rate_hz", c.rate_hz, {1.0, 40.0}, "Hz", "revolutions");
    table.add("fov_deg", c.fov_deg, {1.0, 360.0}, "deg", "of azimuth, centred forward");
    table.add("time_offset_s", c.time_offset_s, {-1.0, 1.0}, "s", "scan stamps are late by this");
    table.add("begins_s", c.begins_s, {0.0, 1e6}, "s", "no scan begins before");
    table.add("ends_s", c.ends_s, {0.0, 1e6}, "s", "when it dies, 0 = it lasts");
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
    table.add("enabled", c.enabled, "whether there is an IMU");
    table.add("vibration_tones", c.vibration_tones, {1, 8}, "", "main tone and harmonics");
    table.add("gyro_instability", c.gyro_instability, kNotNegative, "rad/s",
              "bias instability: the Allan deviation's floor / 0.664");
    table.add("accel_instability", c.accel_instability, kNotNegative, "m/s^2", "bias instability");
    table.add("gyro_temperature", c.gyro_temperature, kNotNegative, "rad/s/K", "bias per kelvin");
    table.add("accel_temperature", c.accel_temperature, kNotNegative, "m/s^2/K", "bias per kelvin");
    table.add("warm_up_k", c.warm_up_k, {0.0, 100.0}, "K", "how much warmer it gets while it runs");
    table.add("warm_up_s", c.warm_up_s, {1.0, 1e5}, "s", "time constant of the warming");
    table.add("shock_m_s2", c.shock_m_s2, kNotNegative, "m/s^2",
              "peak of the ringing when a stem falls or a runner hits");
    table.add("shock_rad_s", c.shock_rad_s, kNotNegative, "rad/s", "the same of the gyroscope");
    table.add("accel_range_m_s2", c.accel_range_m_s2, kNotNegative, "m/s^2",
              "full scale, 0 = unlimited");
    table.add("gyro_range_rad_s", c.gyro_range_rad_s, kNotNegative, "rad/s",
              "full scale, 0 = unlimited");
    table.add("missing", c.missing, {0.0, 0.9}, "", "share of samples lost one by one");
    table.add("gap_interval_s", c.gap_interval_s, {0.0, 1e9}, "s",
              "mean time between gaps, 0 = none");
    table.add("gap_s", c.gap_s, {0.001, 100.0}, "s", "length of a gap");
    table.add("time_offset_s", c.time_offset_s, {-1.0, 1.0}, "s", "stamps are late by this");
  });
}

void describe_gnss(ConfigTable& table, GnssConfig& c) {
  table.section("gnss", [&] {
    table.add("enabled", c.enabled, "whether there is a receiver");
    table.add("rate_hz", c.rate_hz, {0.1, 500.0}, "Hz", "fixes");
    table.add("mount_m", c.mount_m, "m", "antenna in the body frame");
    table.add("second_antenna_m", c.second_antenna_m, "m",
              "second antenna from the first one, body frame; 0 0 0 = none");
    table.add("heading_sd_deg", c.heading_sd_deg, {0.0, 90.0}, "deg",
              "heading of the line to it, open sky, a metre apart; 5 times under closed canopy");
    table.add("second_antenna_positions", c.second_antenna_positions,
              "it gives positions and no headings");
    table.add("second_antenna_common", c.second_antenna_common, {0.0, 1.0}, "",
              "share of the variance of their errors that both positions have in common");
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
    table.add("burst_interval_s", c.burst_interval_s, {0.0, 1e9}, "s",
              "mean time between bursts of error under closed canopy, 0 = none");
    table.add("burst_s", c.burst_s, {0.1, 1e6}, "s", "length of a burst");
    table.add("burst_m", c.burst_m, kNotNegative, "m", "its height in the plane");
    table.add("jump_interval_s", c.jump_interval_s, {0.0, 1e9}, "s",
              "mean time between jumps under closed canopy, 0 = none");
    table.add("jump_m", c.jump_m, kNotNegative, "m", "standard deviation of a jump in the plane");
    table.add("latency_s", c.latency_s, {0.0, 10.0}, "s",
              "from the moment of a fix to its place in the stream");
  });
}

void describe_total_station(ConfigTable& table, TotalStationConfig& c) {
  table.section("total_station", [&] {
    table.add("enabled", c.enabled, "whether a total station follows a prism on the carrier");
    table.add("rate_hz", c.rate_hz, {0.1, 100.0}, "Hz", "measurements");
    table.add("prism_m", c.prism_m, "m", "prism in the body frame of a level carrier");
    table.add("levelling", c.levelling, {0.0, 1.0}, "",
              "share of the carrier's tilt that the prism's link takes away");
    table.add("distance_sd_m", c.distance_sd_m, {0.0, 1.0}, "m", "error of a distance");
    table.add("distance_ppm", c.distance_ppm, {0.0, 1000.0}, "mm/km", "and its growth");
    table.add("angle_sd_arcsec", c.angle_sd_arcsec, {0.0, 3600.0}, "arcsec", "of an angle");
    table.add("setup_sd_m", c.setup_sd_m, {0.0, 10.0}, "m", "of the instrument's own place");
    table.add("time_offset_s", c.time_offset_s, {-10.0, 10.0}, "s", "how late its clock is");
    table.add("time_sd_s", c.time_sd_s, {0.0, 1.0}, "s", "error of a stamp");
    table.add("search_s", c.search_s, {0.0, 600.0}, "s", "to find the prism again");
  });
}

void describe_scanned(ConfigTable& table, SiteConfig& config) {
  table.add("seed", config.seed, {0, 2e9}, "", "of everything random");
  table.add("duration_s", config.duration_s, {0.0, 1e5}, "s",
            "of the recording, 0 = as long as the route takes");
  describe_ground(table, config);
  describe_stand(table, config.stand);
  describe_carrier(table, config.carrier);
  describe_lidar(table, config.lidar);
  describe_imu(table, config.imu);
  describe_gnss(table, config.gnss);
  describe_mag(table, config.mag);
}

void describe_truth(ConfigTable& table, TruthConfig& c) {
  table.section("truth", [&] {
    table.add("points", c.points, "write points.laz: every point at its true place, with its tree");
  });
}

void describe_scans(ConfigTable& table, SiteConfig& config) {
  table.add("scans", config.scans, "whether there is a lidar");
}

void describe_usual(ConfigTable& table, SiteConfig& config) {
  describe_scanned(table, config);
  table.section("receiver_hold", [&] {
    table.add("below_m_s", config.receiver_hold.below_m_s, {0.0, 100.0}, "m/s",
              "speed below which the GNSS receiver holds its position, 0 = never");
    table.add("release_m", config.receiver_hold.release_m, {0.0, 1000.0}, "m",
              "until its solution lies so far away in the plane");
  });
  describe_total_station(table, config.total_station);
  table.section("head_log", [&] {
    table.add("sd_m", config.head_log.sd_m, {0.0, 10.0}, "m",
              "error of the harvester head's place at a cut, each axis");
    table.add("bias_sd_m", config.head_log.bias_sd_m, {0.0, 10.0}, "m",
              "the same for all cuts of a recording");
    table.add("missed", config.head_log.missed, {0.0, 1.0}, "", "share of the cuts not noted");
  });
  table.add("imu_preset", config.imu_preset,
            "measured IMU: site (as the site says), vectornav, xsens");
  table.add(
      "gnss_preset", config.gnss_preset,
      "measured receiver: site (as the site says), phone, phone_wild, faitli_evo1, faitli_evo2, "
      "faitli_tuusniemi1, faitli_tuusniemi3");
}

void check_triple(const std::string& key, const std::vector<double>& value,
                  std::vector<std::string>& problems) {
  if (value.size() != 3) problems.push_back(key + ": expected three numbers");
}

void check_site(const SiteConfig& site) {
  std::vector<std::string> problems;
  check_triple("lidar.mount_m", site.lidar.mount_m, problems);
  check_triple("lidar.mount_rpy_deg", site.lidar.mount_rpy_deg, problems);
  check_triple("lidar.error_m", site.lidar.error_m, problems);
  check_triple("lidar.error_rpy_deg", site.lidar.error_rpy_deg, problems);
  check_triple("second_lidar.mount_m", site.second_lidar.mount_m, problems);
  check_triple("second_lidar.mount_rpy_deg", site.second_lidar.mount_rpy_deg, problems);
  check_triple("imu.mount_m", site.imu.mount_m, problems);
  check_triple("imu.mount_rpy_deg", site.imu.mount_rpy_deg, problems);
  check_triple("gnss.mount_m", site.gnss.mount_m, problems);
  check_triple("gnss.second_antenna_m", site.gnss.second_antenna_m, problems);
  check_triple("total_station.prism_m", site.total_station.prism_m, problems);
  if (site.stand.pine_share + site.stand.spruce_share > 1.0 + 1e-9) {
    problems.push_back("stand: pine_share and spruce_share add up to more than 1");
  }
  if (site.stand.dbh_min_m > site.stand.dbh_max_m) {
    problems.push_back("stand: dbh_min_m is larger than dbh_max_m");
  }
  if (site.lidar.min_range_m >= site.lidar.max_range_m) {
    problems.push_back("lidar: min_range_m is not below max_range_m");
  }
  if (site.carrier.strip_road > site.carrier.strip_roads) {
    problems.push_back("carrier: strip_road is larger than strip_roads");
  }
  if (site.carrier.narrow_from > site.carrier.narrow_to) {
    problems.push_back("carrier: narrow_from is larger than narrow_to");
  }
  if (site.carrier.kind == "still" && site.duration_s <= 0.0) {
    problems.push_back("carrier: kind still needs duration_s");
  }
  if (site.carrier.work == "thinning" && site.carrier.route_time_s <= 0.0) {
    problems.push_back("carrier: work thinning needs route_time_s");
  }
  if (!problems.empty()) throw ConfigError(problems);
}

}  // namespace

void describe_used(ConfigTable& table, SiteConfig& config) {
  describe_usual(table, config);
  if (!config.scans) describe_scans(table, config);
  if (config.objects.any()) describe_objects(table, config.objects);
  if (config.truth.points) describe_truth(table, config.truth);
  if (config.second_lidar.enabled) describe_second_lidar(table, config.second_lidar);
}

void describe(ConfigTable& table, SiteConfig& config) {
  describe_usual(table, config);
  describe_scans(table, config);
  describe_objects(table, config.objects);
  describe_truth(table, config.truth);
  describe_second_lidar(table, config.second_lidar);
  table.add("draw", config.draw,
            "whether the seed draws ground, stand, objects, carrier and scanner; what a setting "
            "names is not drawn");
}

namespace {

// Nothing of a file that is not there: whoever needs it says so.
void append_file(const std::string& path, std::string& text) {
  std::ifstream file(path, std::ios::binary);
  std::vector<char> part(std::size_t{1} << 16);
  while (file.read(part.data(), static_cast<std::streamsize>(part.size())) || file.gcount() > 0)
    text.append(part.data(), static_cast<std::size_t>(file.gcount()));
  check_readable(file, path, "");
}

}  // namespace

std::uint64_t site_key(const SiteConfig& config) {
  SiteConfig copy = config;
  ConfigTable table;
  describe_scanned(table, copy);
  if (copy.objects.any()) describe_objects(table, copy.objects);
  // The number counts what the program itself makes otherwise of the same settings.
  const bool bundles = config.lidar.rays_per_beam >= kBundleRays;
  std::string text = (bundles ? "3\n" : "2\n") + table.to_yaml(false);
  if (!config.stand.trees.empty()) {  // the content of files counts, not their names alone
    std::vector<std::string> files = tree_cloud_files(config.stand.trees);
    files.insert(files.begin(), config.stand.trees);
    for (const std::string& path : files) {
      append_file(path, text);
    }
  }
  std::uint64_t key = 0;
  for (const char c : text)
    key = hash_numbers(key, static_cast<std::uint64_t>(c));
  return key;
}

namespace {

// Settings are set once more, as they go over a preset that they may have named themselves.
void work_in_presets(SiteConfig& site, ConfigTable& table,
                     const std::vector<std::string>& settings) {
  table.set(preset_settings(imu_presets(), "imu_preset", site.imu_preset));
  table.set(preset_settings(gnss_presets(), "gnss_preset", site.gnss_preset));
  table.set(settings);
  site.imu_preset = site.gnss_preset = "site";
}

// What the seed draws goes under the settings. The site that comes of it draws nothing more.
void work_in_draws(SiteConfig& site, ConfigTable& table, const std::vector<std::string>& settings) {
  if (!site.draw) return;
  table.set(drawn_settings(static_cast<std::uint64_t>(site.seed)));
  table.set(settings);
  site.draw = false;
}

}  // namespace

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
  work_in_draws(site, table, settings);
  work_in_presets(site, table, settings);
  check_site(site);
  return site;
}

bool is_shipped_site(const std::string& name) {
  const std::vector<ShippedSite>& all = shipped_sites();
  return std::any_of(all.begin(), all.end(),
                     [&](const ShippedSite& site) { return site.name == name; });
}

}  // namespace understory
