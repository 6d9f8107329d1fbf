#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "understory/util/config/config.h"

namespace understory {

// What a site is made of. Every member is a key of the site's YAML file (configs/sites/*.yaml) with
// the unit in its name; docs/method/simulation.md lists them.

struct OriginConfig {  // where the east-north-up frame of the truth has its zero
  double latitude_deg = 61.2;
  double longitude_deg = 25.1;
  double height_m = 148.0;  // above the ellipsoid
  double start_time_s = 1'700'000'000.0;
};

// The ground of a site.
struct TerrainConfig {
  double cell_m = 0.4;              // of the triangle grid
  double relief_m = 1.2;            // standard deviation of the hills
  double wavelength_m = 45.0;       // of the hills
  double slope_deg = 3.0;           // of the whole site
  double slope_azimuth_deg = 30.0;  // uphill, from east to north
  double hummock_m = 0.10;          // standard deviation of hummocks a few metres wide
  double roughness_m = 0.025;       // standard deviation of the grid's own noise
  int ditches = 0;                  // across the site, evenly apart
  double ditch_depth_m = 0.8;
  double ditch_width_m = 2.0;
  double snow_m = 0.0;       // depth of snow: hides hummocks and the feet of plants
  double track_depth = 0.0;  // share of the snow that the carrier presses down on its way
};

// The trees and plants of a site. Per hectare, metres.
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
  double sweep_m = 0.08;            // standard deviation of the bow of a stem
  double ovality = 0.04;            // mean of (largest - smallest diameter) / mean of a stem
  double bark_relief_m = 0.003;     // standard deviation at the foot of a pine of 25 cm
  double whorl_swelling_m = 0.004;  // of the radius where a pine's branches leave
  double dead_branches = 1.0;       // density of dead branches below the crown, 1 = usual
  double foliage = 1.0;             // density of leaves and needles, 1 = usual
  double seedlings_per_ha = 400.0;
  double shrubs_per_ha = 500.0;
  double ground_plants_per_ha = 2500.0;
  double stumps_per_ha = 60.0;
  double logs_per_ha = 30.0;
  double wind_sway_m = 0.08;      // standard deviation of the sway of a crown's top
  std::string trees;              // file with a list of trees instead of random ones
  double height_min_m = 3.0;      // no tree lower
  double crown_base_share = 0.0;  // of the tree's height, 0 = usual for the species
  double edge_m = 0.0;            // width of a border of tall trees
  double edge_dbh_mean_m = 0.24;
  double edge_height_mean_m = 19.0;
  double margin_m = 0.0;  // the stand reaches so far from the route, 0 = all over its rectangle
  double narrow_clearance_m = 0.5;  // bark to the path where it is narrow
  double fork_share = 0.0;          // of the trees: two stems from a height on
  double broken_share = 0.0;        // of the trees: without their top
  double boulders_per_ha = 0.0;
  int buildings = 0;  // beside the route: the first at its start, the second at its end
};

// Things among the trees that are none, beside the route.
struct ObjectsConfig {
  int houses = 0;  // corners of buildings: two walls each
  int posts = 0;
  int fences = 0;
  int vehicles = 0;
  int people = 0;            // who stand
  int walkers = 0;           // who walk to and fro
  double clearance_m = 1.5;  // from the route to the nearest part
  double reach_m = 10.0;     // farther than that from there, none is placed
  int followers = 0;         // who walk behind the carrier all the way, two abreast
  double follow_m = 1.5;     // from the body to the first of them, in the plane

  [[nodiscard]] bool any() const {
    return houses + posts + fences + vehicles + people + walkers + followers > 0;
  }
};

// What carries the sensors, and how it moves.
struct CarrierConfig {
  std::string kind = "walk";
  std::string body = "imu";  // frame of the path: imu or base_link
  double length_m = 250.0;   // of the route
  double speed_m_s = 1.2;
  double still_s = 3.0;                 // standing still at the start
  double first_turn_deg = 0.0;          // on the spot at the start, left positive; within still_s
  double first_turn_rate_deg_s = 20.0;  // of that turn
  bool begins_aloft = false;            // a UAV hovers at the start instead of standing
  double height_m = 3.2;                // of the body above the ground
  double gait_m = 0.025;                // amplitude of the step's bob
  double gait_deg = 2.0;                // amplitude of the step's pitch and roll
  double tilt_sd_deg = 3.0;             // slow tilting of the pole
  double yaw_wander_deg = 12.0;
  double turn_interval_s = 11.0;   // mean time between quick turns or work stops
  double turn_deg = 130.0;         // largest quick turn or swing
  double turn_rate_deg_s = 140.0;  // peak rate of a quick turn
  std::string route = "auto";      // loop, strip; auto: as suits the kind
  int laps = 1;                    // of a loop around its middle, each on a way of its own
  int rounds = 1;                  // of the whole loop, each on the same way
  double route_time_s = 0.0;       // how long a round takes, 0 = as speed and stops give
  bool one_way = false;            // a strip road is driven once, not out and back
  int strip_roads = 1;             // parallel roads of the stand
  int strip_road = 1;              // which of them is driven
  double strip_spacing_m = 22.5;
  std::string work = "quick";  // of a harvester at its stops: quick, thinning
  double back_up_m = 0.0;      // farthest that it backs up during a stop
  double narrow_from = 0.0;    // share of the route where a narrow path begins
  double narrow_to = 0.0;      // and ends
  double narrow_speed_m_s = 1.0;
  int halts = 0;  // of a sleigh on its way
  double halt_s = 20.0;
  int tumbles = 0;  // times that a sleigh nearly turns over
  double tumble_deg = 30.0;
};

// Rays a beam from which on they are cast together: another way, which sees some grazing rays
// otherwise (scene.h).
constexpr int kBundleRays = 4;

// The lidar and its faults.
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
  double bark_sd_m = 0.002;      // roughness of bark finer than the stand's relief
  double incidence_gain = 0.35;  // growth of the range noise with the tangent of incidence
  double range_step_m = 0.001;
  double min_range_m = 0.5;
  double max_range_m = 55.0;
  double range_10_percent_m = 17.0;  // where half the returns of a 10 % target are lost
  double dropout = 0.004;            // share of returns lost for no reason
  double azimuth_jitter_deg = 0.01;
  int keep_every = 1;                 // of the scans only each so-manieth is recorded
  int returns = 1;                    // of a beam: the strongest, or two
  double blooming = 0.0;              // chance that a beam beside a glaring echo repeats its range
  double crosstalk = 0.0;             // share of beams that report a range out of nothing
  double snow_fall_per_m = 0.0;       // snow flakes that a beam meets in a metre
  double snow_drop_interval_s = 0.0;  // mean time between loads of snow off a branch, 0 = none
  double cold_noise = 0.0;            // share of spurious ranges of a lidar too cold for its rating
  double sun_noise = 0.0;             // share of spurious ranges of beams that look into the sun
  double sun_azimuth_deg = 180.0;     // of the sun, clockwise from north
  double sun_elevation_deg = 8.0;     // above the horizon
  double elevation_bias_deg = 0.0;    // beams look higher by this than the lidar says
  double time_offset_s = 0.0;         // of the lidar's clock: stamps are late by this much
  std::vector<double> error_m = {0.0, 0.0, 0.0};  // of the extrinsics that the recording claims
  std::vector<double> error_rpy_deg = {0.0, 0.0, 0.0};
};

// Times when the lidar is covered, and nothing comes back: the scans are there, without points.
struct BlindnessConfig {
  double interval_s = 0.0;  // from one to the next, the first after half of it; 0 = none
  double length_s = 3.0;

  // Whether a time, in seconds since the path's zero, is one of these.
  [[nodiscard]] bool covers(double time_s) const;
};

// A second lidar: of the model and with the faults of the first one, and with a clock of its own.
struct SecondLidarConfig {
  bool enabled = false;
  std::vector<double> mount_m = {-1.2, 0.0, 2.4};  // in the body frame
  std::vector<double> mount_rpy_deg = {0.0, 0.0, 180.0};
  double rate_hz = 9.97;
  double fov_deg = 360.0;
  double time_offset_s = 0.0;  // of its clock: stamps are late by this much
  double begins_s = 0.0;       // since the start of the recording: no scan begins before
  double ends_s = 0.0;         // it dies then; 0: it lasts
};

// The IMU and its faults. Noise densities as data sheets give them.
struct ImuConfig {
  bool enabled = true;
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
  int vibration_tones = 1;         // the main one and its harmonics, ever weaker
  double gyro_instability = 0.0;   // bias instability, rad/s: Allan deviation's floor / 0.664
  double accel_instability = 0.0;  // m/s^2
  double gyro_temperature = 0.0;   // bias per kelvin, rad/s
  double accel_temperature = 0.0;  // m/s^2
  double warm_up_k = 0.0;          // how much warmer the sensor gets while it runs
  double warm_up_s = 300.0;        // time constant of that
  double shock_m_s2 = 0.0;         // peak of the ringing when a stem falls or a runner hits
  double shock_rad_s = 0.0;
  double accel_range_m_s2 = 0.0;  // full scale, 0 = unlimited
  double gyro_range_rad_s = 0.0;
  double missing = 0.0;         // share of samples lost one by one
  double gap_interval_s = 0.0;  // mean time between gaps, 0 = none
  double gap_s = 0.1;           // their length
  double time_offset_s = 0.0;   // of the IMU's clock: stamps are late by this much
};

// The GNSS receiver and its faults.
struct GnssConfig {
  double jump_interval_s = 0.0;  // mean time between jumps under closed canopy, 0 = none
  double jump_m = 1.5;           // standard deviation of a jump in the plane
  double latency_s = 0.0;        // from the moment of a fix to its place in the stream
  bool enabled = true;
  double rate_hz = 5.0;
  std::vector<double> mount_m = {0.0, 0.0, 0.15};          // antenna in the body frame
  std::vector<double> second_antenna_m = {0.0, 0.0, 0.0};  // from the first one; zero: none
  // Of the heading of their line, a metre apart, under open sky; five times that under closed
  // canopy.
  double heading_sd_deg = 0.2;
  // The second antenna gives positions and no headings. Its errors are as large as those of the
  // first one, and so much of their variance is common to both.
  bool second_antenna_positions = false;
  double second_antenna_common = 0.5;
  double open_sd_m = 0.35;        // slow error in the plane under open sky
  double canopy_sd_m = 2.2;       // added under closed canopy
  double correlation_s = 45.0;    // of the slow error
  double multipath_share = 0.35;  // fast error (2 s) relative to the slow one
  double white_sd_m = 0.04;
  double height_factor = 1.9;       // height error over plane error
  double reported_factor = 0.5;     // reported over true standard deviation: overconfident
  double outage_interval_s = 70.0;  // mean time between outages under closed canopy
  double outage_s = 4.0;
  // From, to: no fixes between these seconds of the recording. Empty: none are left out.
  std::vector<double> silent_s = {};
  double burst_interval_s = 0.0;  // mean time between bursts under closed canopy, 0 = none
  double burst_s = 25.0;          // length of a burst
  double burst_m = 4.0;           // its height in the plane
};

struct ReceiverHoldConfig {  // a receiver that holds its position while the carrier stands
  double below_m_s = 0.0;    // speed below which it does, 0 = never
  double release_m = 3.0;    // until its solution lies so far away in the plane
};

// The magnetometer and its faults; microtesla.
struct MagnetometerConfig {
  bool enabled = false;
  double rate_hz = 100.0;
  double field_ut = 54.0;          // of the earth
  double inclination_deg = 72.0;   // downwards
  double declination_deg = -12.0;  // of magnetic north, positive to the east
  double hard_iron_ut = 0.0;       // size of the field of the carrier itself
  double soft_iron = 0.0;          // how much iron bends the earth's field
  double noise_ut = 0.15;
};

struct TotalStationConfig {  // a reference beside the recording: REC.truth/total_station.csv
  bool enabled = false;
  double rate_hz = 8.0;
  std::vector<double> prism_m = {-0.3, 0.4, 2.6};  // in the body frame when the carrier is level
  double levelling = 0.1;  // share of the body's tilt that its link takes away
  double distance_sd_m = 0.002;
  double distance_ppm = 1.5;
  double angle_sd_arcsec = 3.0;
  double setup_sd_m = 0.005;   // of the instrument's own place
  double time_offset_s = 0.0;  // its clock is late by this much
  double time_sd_s = 0.001;    // of a stamp
  double search_s = 2.0;       // to find the prism again
};

struct HeadLogConfig {  // what a harvester's computer notes at each felling cut: REC.truth/head.csv
  double sd_m = 0.15;   // error of the head's place, each axis, from cut to cut
  double bias_sd_m = 0.15;  // the same for all cuts: the boom as it was last calibrated
  double missed = 0.02;     // share of the cuts that are not in the log
};

struct TruthConfig {    // what the truth has beside its usual files
  bool points = false;  // points.laz: every point with its tree
};

// All that a site is made of: the keys of configs/sites/*.yaml.
struct SiteConfig {
  int seed = 1;
  double duration_s = 0.0;  // 0: as long as the route takes
  bool scans = true;        // false: no lidar, the other sensors alone
  OriginConfig origin;
  TerrainConfig terrain;
  StandConfig stand;
  CarrierConfig carrier;
  LidarConfig lidar;
  BlindnessConfig blindness;
  SecondLidarConfig second_lidar;
  ImuConfig imu;
  GnssConfig gnss;
  MagnetometerConfig mag;
  TotalStationConfig total_station;
  HeadLogConfig head_log;
  ReceiverHoldConfig receiver_hold;
  ObjectsConfig objects;
  TruthConfig truth;
  bool draw = false;  // stand, ground, scanner, carrier and objects are drawn by the seed
  std::string imu_preset = "site";  // a loaded site has them worked in: "site"
  std::string gnss_preset = "site";
};

// Binds every key of a site to `config`.
void describe(ConfigTable& table, SiteConfig& config);
// The same without the sections that ask for nothing: objects of a site without any, and truth
// where it is the usual one. The site.yaml of a truth has these keys.
void describe_used(ConfigTable& table, SiteConfig& config);

// A key of all of a site that its scans depend on, with the content of its list of trees and of
// their clouds. It names entries of the cache of scans. IMU, GNSS, magnetometer, total station and
// what is wrong with the lidar's clock and claimed place are not among them.
[[nodiscard]] std::uint64_t site_key(const SiteConfig& config);

// A site that the program carries with it.
struct ShippedSite {
  std::string name;
  std::string summary;  // the first comment line of its file
  std::string yaml;
};
[[nodiscard]] const std::vector<ShippedSite>& shipped_sites();
[[nodiscard]] bool is_shipped_site(const std::string& name);

// A site by the name of a shipped one or the path of a YAML file, with "key=value" settings
// applied. Throws InputError if there is no such site, ConfigError with all problems for bad keys
// or values.
[[nodiscard]] SiteConfig load_site(const std::string& name_or_path,
                                   const std::vector<std::string>& settings);

}  // namespace understory
