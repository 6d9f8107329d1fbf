#include "understory/simulation/site_sensors.h"

#include <string>
#include <vector>

namespace understory {
namespace {

const ConfigTable::Range kPositive{1e-9, 1e9};
const ConfigTable::Range kNotNegative{0.0, 1e9};
const std::vector<std::string> kLidarModels = {"OS0-128", "VLP-16",  "OS1-64",  "OS1-128", "HDL-64",
                                               "RS-16",   "Mid-360", "VLP-32C", "XT32"};

}  // namespace

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
    table.add("silent_s", c.silent_s, "s",
              "[from, to]: no fixes between these times of the recording; []: never");
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

}  // namespace understory
