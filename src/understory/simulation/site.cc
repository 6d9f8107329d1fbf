#include "understory/simulation/site.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "understory/simulation/drawn_site.h"
#include "understory/simulation/presets.h"
#include "understory/simulation/site_sensors.h"
#include "understory/simulation/stand/objects.h"
#include "understory/simulation/stand/stand.h"
#include "understory/util/error.h"
#include "understory/util/files/text_file.h"
#include "understory/util/random.h"

namespace understory {
namespace {

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
    table.add("rounds", c.rounds, {1, 1000}, "", "of the whole loop, each on the same way");
    table.add("route_time_s", c.route_time_s, {0.0, 1e5}, "s",
              "how long the route (of a walk: a round) takes, 0 = as speed and stops give");
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

void describe_blindness(ConfigTable& table, BlindnessConfig& c) {
  table.section("blindness", [&] {
    table.add(
        "interval_s", c.interval_s, {0.0, 1e6}, "s",
        "from one time when nothing comes back to the lidar to the next, the first after half "
        "of it; 0 = none");
    table.add("length_s", c.length_s, {0.0, 1e6}, "s", "how long nothing comes back");
  });
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

// The recording says that the body is the IMU, so no mount can be told to its reader.
void check_imu_mount(const SiteConfig& site, std::vector<std::string>& problems) {
  if (site.carrier.body != "imu") return;
  for (const std::vector<double>& mount : {site.imu.mount_m, site.imu.mount_rpy_deg}) {
    if (std::all_of(mount.begin(), mount.end(), [](double value) { return value == 0.0; }))
      continue;
    problems.push_back(
        "imu: mount_m and mount_rpy_deg are 0 where the body is the IMU: set "
        "carrier.body=base_link");
    return;
  }
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
  check_imu_mount(site, problems);
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
  const std::vector<double>& silent = site.gnss.silent_s;
  if (!silent.empty() && (silent.size() != 2 || silent[0] > silent[1])) {
    problems.push_back("gnss.silent_s: expected [] or two times, the first no later");
  }
  if (site.carrier.narrow_from > site.carrier.narrow_to) {
    problems.push_back("carrier: narrow_from is larger than narrow_to");
  }
  if (site.carrier.kind == "still" && site.duration_s <= 0.0) {
    problems.push_back("carrier: kind still needs duration_s");
  }
  const bool strip = site.carrier.route == "strip" ||
                     (site.carrier.route == "auto" && site.carrier.kind == "harvester");
  if (site.carrier.rounds > 1 && (strip || site.carrier.work == "thinning")) {
    problems.push_back("carrier: rounds above 1 need a loop, and no work thinning");
  }
  if (site.blindness.interval_s > 0.0 && site.blindness.length_s >= site.blindness.interval_s) {
    problems.push_back("blindness: length_s is not below interval_s");
  }
  if (site.carrier.work == "thinning" && site.carrier.route_time_s <= 0.0) {
    problems.push_back("carrier: work thinning needs route_time_s");
  }
  if (!problems.empty()) throw ConfigError(problems);
}

}  // namespace

bool BlindnessConfig::covers(double time_s) const {
  if (interval_s <= 0.0 || time_s < 0.5 * interval_s) return false;
  return std::fmod(time_s - 0.5 * interval_s, interval_s) < length_s;
}

void describe_used(ConfigTable& table, SiteConfig& config) {
  describe_usual(table, config);
  if (!config.scans) describe_scans(table, config);
  if (config.objects.any()) describe_objects(table, config.objects);
  if (config.truth.points) describe_truth(table, config.truth);
  if (config.second_lidar.enabled) describe_second_lidar(table, config.second_lidar);
  if (config.blindness.interval_s > 0.0) describe_blindness(table, config.blindness);
}

void describe(ConfigTable& table, SiteConfig& config) {
  describe_usual(table, config);
  describe_scans(table, config);
  describe_objects(table, config.objects);
  describe_truth(table, config.truth);
  describe_second_lidar(table, config.second_lidar);
  describe_blindness(table, config.blindness);
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
  // What the lidar does not see, and what its recording claims: scans are the same.
  copy.imu = {};
  copy.gnss = {};
  copy.mag = {};
  copy.lidar.time_offset_s = 0.0;
  copy.lidar.error_m = copy.lidar.error_rpy_deg = {0.0, 0.0, 0.0};
  ConfigTable table;
  describe_scanned(table, copy);
  if (copy.objects.any()) describe_objects(table, copy.objects);
  if (copy.blindness.interval_s > 0.0) describe_blindness(table, copy.blindness);
  // The number counts what the program itself makes otherwise of the same settings.
  const bool bundles = config.lidar.rays_per_beam >= kBundleRays;
  std::string text = (bundles ? "5\n" : "4\n") + table.to_yaml(false);
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
