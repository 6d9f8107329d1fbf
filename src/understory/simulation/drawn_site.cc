#include "understory/simulation/drawn_site.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "understory/simulation/sensors/counter_noise.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using Settings = std::vector<std::string>;

// Three decimals are enough for any of them.
void set(Settings& settings, const std::string& key, double value) {
  settings.push_back(fmt::format("{}={:.3f}", key, value));
}

void set_count(Settings& settings, const std::string& key, double value) {
  settings.push_back(fmt::format("{}={}", key, static_cast<int>(value)));
}

void set_text(Settings& settings, const std::string& key, const std::string& value) {
  settings.push_back(key + "=" + value);
}

// A number whose logarithm is even between two bounds.
double spread(Random& random, double low, double high) {
  return low * std::pow(high / low, random.uniform());
}

std::size_t one_of(Random& random, std::size_t count) {
  return std::min(count - 1,
                  static_cast<std::size_t>(random.uniform() * static_cast<double>(count)));
}

void draw_ground(Random& random, Settings& settings) {
  set(settings, "terrain.slope_deg", std::pow(random.uniform(), 2.0) * 22.0);
  set(settings, "terrain.slope_azimuth_deg", random.uniform(0.0, 360.0));
  set(settings, "terrain.relief_m", spread(random, 0.3, 2.5));
  set(settings, "terrain.wavelength_m", random.uniform(25.0, 70.0));
  set(settings, "terrain.hummock_m", random.uniform(0.02, 0.16));
}

// From pole stands to old ones: the thicker the fewer.
void draw_stand(Random& random, Settings& settings) {
  const double dbh = spread(random, 0.09, 0.30);
  const double dense = random.uniform(0.6, 1.5);
  const double per_ha = std::clamp(dense * 22.0 / std::pow(dbh, 2.0), 200.0, 2500.0);
  set(settings, "stand.dbh_mean_m", dbh);
  set(settings, "stand.dbh_sd_m", dbh * random.uniform(0.2, 0.45));
  set(settings, "stand.dbh_min_m", 0.02);
  set(settings, "stand.dbh_max_m", 2.5 * dbh);
  set(settings, "stand.height_mean_m", std::clamp(dbh * random.uniform(70.0, 105.0), 6.0, 28.0));
  set(settings, "stand.height_min_m", 2.5);
  set(settings, "stand.trees_per_ha", per_ha);
  set(settings, "stand.spacing_m", std::clamp(0.35 * 100.0 / std::sqrt(per_ha), 0.6, 2.0));
  const double pine = random.uniform();
  set(settings, "stand.pine_share", pine);
  set(settings, "stand.spruce_share", (1.0 - pine) * random.uniform());
  set(settings, "stand.lean_sd_deg", random.uniform(0.8, 3.0));
  set(settings, "stand.fork_share", random.uniform(0.0, 0.05));
  set(settings, "stand.broken_share", random.uniform(0.0, 0.06));
  set(settings, "stand.dead_branches", random.uniform(0.3, 1.6));
  set(settings, "stand.foliage", random.uniform(0.7, 1.2));
  set(settings, "stand.seedlings_per_ha", spread(random, 60.0, 1500.0));
  set(settings, "stand.shrubs_per_ha", spread(random, 60.0, 1200.0));
  set(settings, "stand.ground_plants_per_ha", spread(random, 300.0, 4000.0));
  set(settings, "stand.stumps_per_ha", random.uniform(0.0, 200.0));
  set(settings, "stand.logs_per_ha", random.uniform(0.0, 120.0));
  set(settings, "stand.boulders_per_ha", random.uniform(0.0, 80.0));
  set(settings, "stand.wind_sway_m", random.uniform(0.0, 0.15));
}

void draw_objects(Random& random, Settings& settings) {
  set_count(settings, "objects.houses", random.uniform(1.0, 3.0));
  set_count(settings, "objects.posts", random.uniform(5.0, 12.0));
  set_count(settings, "objects.fences", random.uniform(1.0, 3.0));
  set_count(settings, "objects.vehicles", random.uniform(1.0, 4.0));
  set_count(settings, "objects.people", random.uniform(2.0, 5.0));
  set_count(settings, "objects.walkers", random.uniform(1.0, 4.0));
}

// What the carrier means for the rest: where its lidar is, and whether it flies or drives.
void draw_carrier(Random& random, Settings& settings) {
  enum { kHandheld, kBackpack, kHarvester, kUavBelow, kUavAbove };
  // Walkers twice as often.
  constexpr std::array kCarriers = {kHandheld,  kHandheld, kBackpack, kBackpack,
                                    kHarvester, kUavBelow, kUavAbove};
  set(settings, "stand.size_x_m", 90.0);
  set(settings, "stand.size_y_m", 90.0);
  set_text(settings, "carrier.body", "base_link");
  set(settings, "carrier.length_m", 60.0);
  switch (kCarriers.at(one_of(random, kCarriers.size()))) {
    case kHandheld:
      set(settings, "carrier.height_m", random.uniform(1.2, 3.2));
      set(settings, "carrier.speed_m_s", random.uniform(0.7, 1.4));
      break;
    case kBackpack:
      set(settings, "carrier.height_m", random.uniform(1.8, 2.2));
      set(settings, "carrier.speed_m_s", random.uniform(0.8, 1.4));
      set(settings, "carrier.tilt_sd_deg", 5.0);
      set(settings, "carrier.turn_deg", 40.0);
      break;
    case kHarvester:
      set_text(settings, "carrier.kind", "harvester");
      set(settings, "carrier.height_m", 0.0);
      set(settings, "carrier.speed_m_s", random.uniform(0.5, 1.0));
      set(settings, "carrier.gait_deg", 0.8);
      set(settings, "carrier.turn_deg", 75.0);
      set(settings, "carrier.turn_rate_deg_s", 35.0);
      set(settings, "stand.path_clearance_m", 2.0);
      set(settings, "objects.clearance_m", 2.5);
      set_text(settings, "lidar.mount_m",
               fmt::format("[1.1, 0.0, {:.2f}]", random.uniform(1.5, 2.6)));
      set(settings, "lidar.fov_deg", 210.0);
      break;
    case kUavBelow:
      set_text(settings, "carrier.kind", "uav");
      set(settings, "carrier.height_m", random.uniform(1.8, 3.0));
      set(settings, "carrier.speed_m_s", random.uniform(0.8, 1.5));
      set(settings, "carrier.tilt_sd_deg", 0.8);
      break;
    case kUavAbove:
      set_text(settings, "carrier.kind", "uav");
      set(settings, "carrier.height_m", random.uniform(30.0, 40.0));
      set(settings, "carrier.speed_m_s", random.uniform(2.0, 4.0));
      set(settings, "carrier.tilt_sd_deg", 0.8);
      set_text(settings, "lidar.mount_rpy_deg", "[0.0, 90.0, 0.0]");  // scans across its way
      break;
  }
}

// Ranges, beams and noise by the data sheets, as on the other sites.
void draw_scanner(Random& random, Settings& settings) {
  constexpr std::array<const char*, 4> kModels = {"OS0-128", "OS1-64", "VLP-16", "VLP-32C"};
  const std::size_t model = one_of(random, kModels.size());
  set_text(settings, "lidar.model", kModels.at(model));
  set_count(settings, "lidar.rays_per_beam", 8.0);
  set(settings, "lidar.range_sd_m", random.uniform(0.006, 0.02));
  if (model == 0) return;
  set(settings, "lidar.divergence_mrad", 3.0);
  set(settings, "lidar.beam_exit_m", model == 1 ? 0.0095 : 0.0127);
  set(settings, "lidar.range_sd_per_m", 0.0002);
  set(settings, "lidar.range_step_m", model == 1 ? 0.001 : 0.002);
  set(settings, "lidar.max_range_m", 100.0);
  set(settings, "lidar.range_10_percent_m", model == 1 ? 45.0 : 60.0);
}

}  // namespace

std::vector<std::string> drawn_settings(std::uint64_t seed) {
  Random random(hash_numbers(seed, stream_of(NoiseStream::kDrawnSite)));
  Settings settings;
  draw_ground(random, settings);
  draw_stand(random, settings);
  draw_objects(random, settings);
  draw_carrier(random, settings);
  draw_scanner(random, settings);
  return settings;
}

}  // namespace understory
