#include "understory/simulation/scanner.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>
#include <span>
#include <tuple>

#include "understory/util/parallel.h"

namespace understory {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr std::int64_t kBlockFirings = 16;
constexpr double kSnowDrop = 3.0;       // seconds that a load of snow takes to come down
constexpr double kSnowDropPerM = 0.03;  // flakes in a metre of beam then
constexpr float kFlakeEnergy = 0.06F;   // of a large flake, as reflectivity x share of the beam
constexpr float kGlaring = 130.0F;      // intensity from which an echo blooms

// A rotation about the sensor's axis.
struct Turn {
  explicit Turn(double angle) : cosine(std::cos(angle)), sine(std::sin(angle)) {}
  Eigen::Vector3d operator*(const Eigen::Vector3d& v) const {
    return {cosine * v.x() - sine * v.y(), sine * v.x() + cosine * v.y(), v.z()};
  }
  double cosine;
  double sine;
};

// Returns of stems, given one by one as tree << 16 | ring.
std::vector<StemReturns> count_stems(std::vector<std::uint64_t> returns) {
  std::sort(returns.begin(), returns.end());
  std::vector<StemReturns> stems;
  for (std::size_t i = 0; i < returns.size();) {
    std::size_t same = i;
    while (same < returns.size() && returns[same] == returns[i])
      ++same;
    const int tree = static_cast<int>(returns[i] >> 16);
    const int count = static_cast<int>(same - i);
    if (stems.empty() || stems.back().tree != tree) stems.push_back({tree, 0, 0, 0});
    stems.back().rings += 1;
    stems.back().rings_with_3 += count >= 3 ? 1 : 0;
    stems.back().returns += count;
    i = same;
  }
  return stems;
}

}  // namespace

// The rays of a few firings, in the order in which they are traced, and what came back.
struct Scanner::Block {
  // All blocks of a scan live at once: what only the casting needed goes back before its end.
  void let_go_of_rays() {
    std::vector<Ray>().swap(rays);
    std::vector<Hit>().swap(hits);
    std::vector<Eigen::Vector3f>().swap(direction_in_lidar);
    std::vector<Eigen::Vector3f>().swap(origin_in_lidar);
  }
  std::vector<Ray> rays;  // beam by beam, rays_per_beam each
  std::vector<Hit> hits;
  std::vector<Eigen::Vector3f> direction_in_lidar;  // reported, by beam
  std::vector<Eigen::Vector3f> origin_in_lidar;     // by firing
  std::vector<BeamReading> readings;                // by beam
  std::vector<BeamReading> seconds;                 // by beam, if two returns are asked for
  std::vector<std::uint64_t> stems;                 // tree << 16 | ring of each return from a stem
};

Pose mount_pose(const std::vector<double>& place_m, const std::vector<double>& rpy_deg) {
  const Eigen::Quaterniond rotation =
      Eigen::AngleAxisd(rpy_deg[2] * kDegree, Eigen::Vector3d::UnitZ()) *
      Eigen::AngleAxisd(rpy_deg[1] * kDegree, Eigen::Vector3d::UnitY()) *
      Eigen::AngleAxisd(rpy_deg[0] * kDegree, Eigen::Vector3d::UnitX());
  return {rotation, Eigen::Vector3d(place_m[0], place_m[1], place_m[2])};
}

Scanner::Scanner(const SiteConfig& config, ForestScene& scene, const CarrierPath& path,
                 const Machine& machine, TimeNs start)
    : config_(config.lidar),
      scene_(scene),
      path_(path),
      machine_(machine),
      start_(start),
      seed_(hash_numbers(static_cast<std::uint64_t>(config.seed), stream_of(NoiseStream::kLidar))),
      model_(make_lidar_model(config.lidar)),
      body_from_lidar_(mount_pose(config.lidar.mount_m, config.lidar.mount_rpy_deg)),
      neighbours_(model_.beams.size()) {
  for (const Beam& beam : model_.beams) {
    const Turn turn(beam.azimuth_offset_rad);
    beam_directions_.emplace_back(
        turn * Eigen::Vector3d(std::cos(beam.elevation_rad), 0.0, std::sin(beam.elevation_rad)));
    beam_sides_.emplace_back(turn * Eigen::Vector3d::UnitY());
  }
  std::iota(neighbours_.begin(), neighbours_.end(), std::size_t{0});
  std::sort(neighbours_.begin(), neighbours_.end(), [&](std::size_t a, std::size_t b) {
    const Beam& beam_a = model_.beams[a];
    const Beam& beam_b = model_.beams[b];
    return std::tie(beam_a.azimuth_offset_rad, beam_a.elevation_rad) <
           std::tie(beam_b.azimuth_offset_rad, beam_b.elevation_rad);
  });
}

TimeNs Scanner::stamp(std::int64_t scan) const {
  return start_ + model_.firing_time(model_.firings(scan).first);
}

TimeNs Scanner::end(std::int64_t scan) const {
  return start_ + model_.firing_time(model_.firings(scan).end - 1) +
         static_cast<TimeNs>(model_.beams.back().delay_ns);
}

SimulatedScan Scanner::cast(std::int64_t number) {
  ScanReadings readings = measure(number);
  ScanPtr scan = assemble(number, readings);
  return {std::move(scan), std::move(readings.stems)};
}

ScanReadings Scanner::measure(std::int64_t number) {
  const LidarModel::Firings firings = model_.firings(number);
  const double middle =
      0.5 * (to_seconds(stamp(number) - start_) + to_seconds(end(number) - start_));
  const auto blocks_count =
      static_cast<std::size_t>((firings.end - firings.first + kBlockFirings - 1) / kBlockFirings);
  const auto first_of = [&](std::size_t block) {
    return firings.first + static_cast<std::int64_t>(block) * kBlockFirings;
  };
  const auto time_of = [&](std::size_t block) {
    return to_seconds(model_.firing_time(first_of(block)));
  };
  std::vector<Block> blocks(blocks_count);
  // The stand changes between blocks only.
  for (std::size_t b = 0; b < blocks_count;) {
    const std::vector<double>& changes = scene_.changes();
    const auto change = std::upper_bound(changes.begin(), changes.end(), time_of(b));
    std::size_t until = b + 1;
    while (until < blocks_count && (change == changes.end() || time_of(until) < *change))
      ++until;
    scene_.arrange(middle, time_of(b));
    parallel_for(until - b, 1, [&](std::size_t i) {
      const std::int64_t first = first_of(b + i);
      cast_block(first, std::min(firings.end, first + kBlockFirings), middle, blocks[b + i]);
    });
    b = until;
  }
  ScanReadings readings;
  std::vector<std::uint64_t> stems;
  for (const Block& block : blocks) {
    readings.beams.insert(readings.beams.end(), block.readings.begin(), block.readings.end());
    readings.seconds.insert(readings.seconds.end(), block.seconds.begin(), block.seconds.end());
    stems.insert(stems.end(), block.stems.begin(), block.stems.end());
  }
  readings.stems = count_stems(std::move(stems));
  return readings;
}

ScanPtr Scanner::assemble(std::int64_t number, const ScanReadings& readings) const {
  const LidarModel::Firings firings = model_.firings(number);
  const std::size_t beams = model_.beams.size();
  auto scan = std::make_shared<Scan>();
  scan->stamp = stamp(number);
  scan->ring_count = static_cast<int>(beams);
  const auto present = [](const BeamReading& reading) { return reading.range_m > 0.0F; };
  scan->points.reserve(static_cast<std::size_t>(
      std::count_if(readings.beams.begin(), readings.beams.end(), present)));
  std::size_t i = 0;
  for (std::int64_t firing = firings.first; firing < firings.end; ++firing) {
    const TimeNs firing_time = model_.firing_time(firing);
    Turn head(0.0);
    Eigen::Vector3f origin = Eigen::Vector3f::Zero();
    for (std::size_t b = 0; b < beams; ++b, ++i) {
      const TimeNs time = firing_time + static_cast<TimeNs>(model_.beams[b].delay_ns);
      if (b == 0 || !model_.beams_at_once) {
        head = Turn(model_.azimuth(static_cast<double>(time)));
        origin =
            (model_.beam_origin_m * Eigen::Vector3d(head.cosine, head.sine, 0.0)).cast<float>();
      }
      const auto add = [&](const BeamReading& reading, std::uint8_t return_index) {
        if (!present(reading)) return;
        const Eigen::Vector3f point =
            origin + reading.range_m * (head * beam_directions_[b]).cast<float>();
        scan->points.push_back({point.x(), point.y(), point.z(), reading.intensity,
                                static_cast<std::uint32_t>(start_ + time - scan->stamp),
                                model_.beams[b].ring, return_index, 0});
      };
      add(readings.beams[i], 0);
      if (!readings.seconds.empty()) add(readings.seconds[i], 1);
    }
  }
  scan->stamp += from_seconds(config_.time_offset_s);
  return scan;
}

void Scanner::cast_block(std::int64_t first, std::int64_t end, double moment_s,
                         Block& block) const {
  make_rays(first, end, moment_s, block);
  trace(static_cast<std::size_t>(end - first), block);
  if (!machine_.empty()) meet_machine(first, block);
  const std::size_t beams = model_.beams.size();
  const auto rays_per_beam = static_cast<std::size_t>(config_.rays_per_beam);
  block.readings.resize(block.direction_in_lidar.size());
  const bool two = config_.returns == 2;
  if (two) block.seconds.resize(block.readings.size());
  for (std::size_t i = 0; i < block.readings.size(); ++i) {
    const auto firing = static_cast<std::uint64_t>(first) + i / beams;
    BeamEcho second;
    BeamEcho echo = strongest_echo(std::span(block.hits).subspan(i * rays_per_beam, rays_per_beam),
                                   config_.pulse_m, two ? &second : nullptr);
    if (config_.snow_fall_per_m > 0.0 || config_.snow_drop_interval_s > 0.0) {
      const double time = to_seconds(model_.firing_time(static_cast<std::int64_t>(firing)));
      const BeamEcho behind = echo;
      meet_snow(CounterNoise(seed_ + 6, firing, i % beams), snow_per_m(time), echo);
      if (two && echo.surface == Surface::kSnow) second = behind;
    }
    if (second.surface != Surface::kNone) {
      block.seconds[i] = read_echo(second, config_, CounterNoise(seed_ + 5, firing, i % beams));
    }
    if (echo.surface == Surface::kNone) continue;
    block.readings[i] = read_echo(echo, config_, CounterNoise(seed_, firing, i % beams));
    if (echo.tree > 0 && block.readings[i].range_m > 0.0F) {
      block.stems.push_back(static_cast<std::uint64_t>(echo.tree) << 16 |
                            model_.beams[i % beams].ring);
    }
  }
  if (config_.blooming > 0.0 || config_.crosstalk > 0.0) add_ghosts(first, block);
  block.let_go_of_rays();
}

// Flakes in a metre of beam at a time: the fall of snow, and for a few seconds what a branch lets
// go nearby.
double Scanner::snow_per_m(double time_s) const {
  if (config_.snow_drop_interval_s <= 0.0) return config_.snow_fall_per_m;
  const double share = time_s / config_.snow_drop_interval_s;
  CounterNoise noise(seed_ + 7, static_cast<std::uint64_t>(std::max(0.0, share)), 0);
  const double begin = std::floor(share) * config_.snow_drop_interval_s +
                       noise.uniform() * std::max(0.0, config_.snow_drop_interval_s - kSnowDrop);
  const bool drops = time_s >= begin && time_s < begin + kSnowDrop;
  return config_.snow_fall_per_m + (drops ? kSnowDropPerM : 0.0);
}

// A flake in front of what the beam would have met gives the first echo; whether it is strong
// enough is settled as for any other.
void Scanner::meet_snow(CounterNoise noise, double per_m, BeamEcho& echo) const {
  if (per_m <= 0.0) return;
  const double range = config_.min_range_m - std::log(1.0 - noise.uniform()) / per_m;
  const double reach = echo.surface == Surface::kNone ? config_.max_range_m : echo.range_m;
  if (range >= reach) return;
  BeamEcho flake;
  flake.range_m = static_cast<float>(range);
  flake.energy = kFlakeEnergy * noise.uniform();
  flake.surface = Surface::kSnow;
  // Too weak a flake lets the beam pass.
  const double signal = 10.0 * flake.energy * std::pow(config_.range_10_percent_m / range, 2.0);
  if (signal > 1.0) echo = flake;
}

// Readings that nothing stands for: glaring echoes repeat in the beam's neighbours of the firings
// before and after (within a block), and other sensors' pulses give any range.
void Scanner::add_ghosts(std::int64_t first, Block& block) const {
  const std::size_t beams = model_.beams.size();
  const std::vector<BeamReading> real = block.readings;
  const auto step = static_cast<float>(std::max(config_.range_step_m, 1e-4));
  for (std::size_t i = 0; i < real.size(); ++i) {
    const auto firing = static_cast<std::uint64_t>(first) + i / beams;
    CounterNoise noise(seed_ + 8, firing, i % beams);
    if (noise.uniform() < config_.crosstalk) {
      const double range = config_.min_range_m + noise.uniform() * 0.6 * config_.max_range_m;
      block.readings[i] = {std::round(static_cast<float>(range) / step) * step,
                           std::round(1.0F + 12.0F * noise.uniform())};
      continue;
    }
    const bool blooms = noise.uniform() < config_.blooming;
    if (!blooms) continue;
    for (const std::size_t other : {i - beams, i + beams}) {  // before the first wraps: too large
      if (other >= real.size() || real[other].intensity < kGlaring) continue;
      const bool behind = real[i].range_m <= 0.0F || real[i].range_m > real[other].range_m + 0.3F;
      if (behind)
        block.readings[i] = {real[other].range_m, std::round(0.3F * real[other].intensity)};
    }
  }
}

// Traces the rays in tiles of neighbours, which the scene casts together: beams of nearly the same
// azimuth and elevation, of a few firings after each other.
void Scanner::trace(std::size_t firings, Block& block) const {
  const auto rays_per_beam = static_cast<std::size_t>(config_.rays_per_beam);
  const std::size_t beams = model_.beams.size();
  const std::size_t tile_firings = rays_per_beam == 1 ? 4 : (rays_per_beam < 8 ? 2 : 1);
  const std::size_t tile_beams = rays_per_beam < 4 ? 4 : (rays_per_beam < 16 ? 2 : 1);
  constexpr std::size_t kTogether = 16;
  std::array<std::size_t, kTogether> order{};
  std::array<Ray, kTogether> rays;
  std::array<Hit, kTogether> hits;
  block.hits.resize(block.rays.size());
  std::size_t waiting = 0;
  const auto cast = [&] {
    scene_.cast(rays.data(), waiting, static_cast<float>(config_.min_range_m),
                static_cast<float>(config_.max_range_m), hits.data());
    for (std::size_t i = 0; i < waiting; ++i)
      block.hits[order[i]] = hits[i];
    waiting = 0;
  };
  for (std::size_t f = 0; f < firings; f += tile_firings) {
    for (std::size_t b = 0; b < beams; b += tile_beams) {
      for (std::size_t i = f; i < std::min(f + tile_firings, firings); ++i) {
        for (std::size_t j = b; j < std::min(b + tile_beams, beams); ++j) {
          const std::size_t first = (i * beams + neighbours_[j]) * rays_per_beam;
          for (std::size_t k = first; k < first + rays_per_beam; ++k) {
            order[waiting] = k;
            rays[waiting] = block.rays[k];
            if (++waiting == kTogether) cast();
          }
        }
      }
    }
  }
  if (waiting > 0) cast();
}

void Scanner::make_rays(std::int64_t first, std::int64_t end, double moment_s, Block& block) const {
  const std::size_t beams = model_.beams.size();
  const auto firings = static_cast<std::size_t>(end - first);
  const auto rays_per_beam = static_cast<std::size_t>(config_.rays_per_beam);
  block.rays.reserve(firings * beams * rays_per_beam);
  block.direction_in_lidar.reserve(firings * beams);
  const double spread = 0.25e-3 * config_.divergence_mrad;  // one standard deviation
  const double exit = 0.25 * config_.beam_exit_m;
  for (std::size_t f = 0; f < firings; ++f) {
    const std::int64_t firing = first + static_cast<std::int64_t>(f);
    const TimeNs firing_time = model_.firing_time(firing);
    CounterNoise jitter(seed_ + 1, static_cast<std::uint64_t>(firing), 0);
    const double shake = config_.azimuth_jitter_deg * kDegree * jitter.normal();
    const Turn turn_by_jitter(shake);
    Eigen::Matrix3d rotation;
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    Eigen::Vector3d origin = Eigen::Vector3d::Zero();
    Turn head(0.0);
    for (std::size_t b = 0; b < beams; ++b) {
      const TimeNs time = firing_time + static_cast<TimeNs>(model_.beams[b].delay_ns);
      if (b == 0 || !model_.beams_at_once) {
        const Pose world_from_lidar = path_.pose(to_seconds(time)) * body_from_lidar_;
        rotation = world_from_lidar.rotation_matrix();
        place = world_from_lidar.translation();
        head = Turn(model_.azimuth(static_cast<double>(time)));
        origin = model_.beam_origin_m * Eigen::Vector3d(head.cosine, head.sine, 0.0);
      }
      if (b == 0) block.origin_in_lidar.push_back(origin.cast<float>());
      const Eigen::Vector3d reported = head * beam_directions_[b];
      block.direction_in_lidar.push_back(reported.cast<float>());
      const Eigen::Vector3d centre = turn_by_jitter * reported;
      const Eigen::Vector3d side = head * beam_sides_[b];
      const Eigen::Vector3d rise = centre.cross(side);
      CounterNoise footprint(seed_ + 2, static_cast<std::uint64_t>(firing), b);
      for (std::size_t k = 0; k < rays_per_beam; ++k) {
        const CounterNoise::Pair uv = footprint.normal_pair();
        const Eigen::Vector3d offset = uv.first * side + uv.second * rise;
        const Eigen::Vector3d direction = (centre + spread * offset).normalized();
        block.rays.push_back({(place + rotation * (origin + exit * offset)).cast<float>(),
                              (rotation * direction).cast<float>(),
                              static_cast<float>(to_seconds(time) - moment_s)});
      }
    }
  }
}

void Scanner::meet_machine(std::int64_t first, Block& block) const {
  const std::size_t beams = model_.beams.size();
  const auto rays_per_beam = static_cast<std::size_t>(config_.rays_per_beam);
  const std::size_t per_firing = beams * rays_per_beam;
  for (std::size_t f = 0; f * per_firing < block.rays.size(); ++f) {
    const double time = to_seconds(model_.firing_time(first + static_cast<std::int64_t>(f)));
    const Machine::Parts parts = machine_.at(time);
    const std::optional<HeldTree> held = machine_.held(time);
    for (std::size_t i = f * per_firing; i < (f + 1) * per_firing; ++i) {
      const std::size_t beam = i / rays_per_beam;
      const Eigen::Vector3d direction =
          body_from_lidar_.rotation() * block.direction_in_lidar[beam].cast<double>();
      const Eigen::Vector3d origin = body_from_lidar_ * block.origin_in_lidar[f].cast<double>();
      Machine::cast(parts, origin, direction, config_.min_range_m, config_.max_range_m,
                    block.hits[i]);
      if (held) {
        scene_.cast_held(*held, block.rays[i], static_cast<float>(config_.min_range_m),
                         static_cast<float>(config_.max_range_m), block.hits[i]);
      }
    }
  }
}

}  // namespace understory
