#include "understory/simulation/sensors/scanner.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <tuple>

#include "understory/util/angles.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

constexpr std::int64_t kGroupFirings = 16;  // the stand changes between groups only
constexpr std::size_t kMostBeams = 128;
constexpr std::int64_t kBlockFirings = 64;  // at most, cast together
constexpr float kGlaring = 130.0F;          // intensity from which an echo blooms

using Turn = HeadTurn;

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

// From where and when beams look out, and how the head is turned.
struct Scanner::Look {
  Turn shaken;  // by the encoder's jitter
  Eigen::Matrix3f world_from_head;
  Eigen::Vector3f place;  // of the sensor in the world
  float time_s;           // after the moment of the scene
  const BeamDirections& beams;
};

namespace {

// Directions and origins of the rays of a firing, number by number.
// Random bits of the place of one ray of each beam within its footprint.
struct Drawn {
  std::array<std::uint32_t, kMostBeams> far;
  std::array<std::uint32_t, kMostBeams> around;
};

void draw(std::array<CounterNoise, kMostBeams>& noise, std::size_t count, Drawn& drawn) {
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint64_t bits = noise[i].next();
    drawn.far[i] = static_cast<std::uint32_t>(bits >> 40);
    drawn.around[i] = static_cast<std::uint32_t>(bits) & 0xffffffU;
  }
}

struct Made {
  std::array<float, kMostBeams> x, y, z, from_x, from_y, from_z;
};

}  // namespace

// The rays of a few firings, in the order in which they are traced, and what came back.
struct Scanner::Block {
  // All blocks of a scan live at once: what only the casting needed goes back before its end.
  void let_go_of_rays() {
    std::vector<std::uint32_t>().swap(slots);
    std::vector<Ray>().swap(rays);
    std::vector<Hit>().swap(hits);
    std::vector<Eigen::Vector3f>().swap(direction_in_lidar);
    std::vector<Eigen::Vector3f>().swap(origin_in_lidar);
  }
  std::int64_t first = 0;            // firing
  std::int64_t end = 0;              // of the firings
  std::vector<std::uint32_t> slots;  // of the beams: where their rays lie
  std::vector<Ray> rays;             // by slot, rays_per_beam each
  std::vector<Hit> hits;
  std::vector<Eigen::Vector3f> direction_in_lidar;  // reported, by beam; only beside a machine
  std::vector<Eigen::Vector3f> origin_in_lidar;     // by firing; only beside a machine
  std::vector<BeamReading> readings;                // by beam
  std::vector<BeamReading> seconds;                 // by beam, if two returns are asked for
  std::vector<EchoSource> sources;                  // by beam, if asked for
  std::vector<EchoSource> second_sources;           // by beam, if two returns are asked for too
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
      blindness_(config.blindness),
      scene_(scene),
      path_(path),
      machine_(machine),
      start_(start),
      seed_(hash_numbers(static_cast<std::uint64_t>(config.seed), stream_of(NoiseStream::kLidar))),
      model_(make_lidar_model(config.lidar)),
      weather_(config.lidar, seed_),
      body_from_lidar_(mount_pose(config.lidar.mount_m, config.lidar.mount_rpy_deg)),
      bias_rad_(config.lidar.elevation_bias_deg * kDegree),
      beams_(model_, 0.0, bias_rad_),
      told_(model_, 0.0),
      order_(trace_order()) {
  UNDERSTORY_CHECK(model_.beams.size() <= kMostBeams);
}

// Tiles of neighbours in azimuth and elevation, sixteen rays each: strips of a few firings' width,
// each from the lowest beam up. A beam that looks ahead of its firing has its neighbours in firings
// before.
std::vector<std::uint32_t> Scanner::trace_order() const {
  struct Place {
    double strip;
    double elevation_rad;
    std::uint32_t beam;
  };
  const double step = 2.0 * std::numbers::pi * model_.firing_ns / model_.revolution_ns;
  const double width = config_.rays_per_beam == 1 ? 4.0 : (config_.rays_per_beam < 8 ? 2.0 : 1.0);
  std::vector<Place> places;
  places.reserve(static_cast<std::size_t>(kBlockFirings) * model_.beams.size());
  for (std::int64_t firing = 0; firing < kBlockFirings; ++firing) {
    for (const Beam& beam : model_.beams) {
      const double across = static_cast<double>(firing) - beam.azimuth_offset_rad / step;
      places.push_back({std::floor(across / width), beam.elevation_rad,
                        static_cast<std::uint32_t>(places.size())});
    }
  }
  std::sort(places.begin(), places.end(), [](const Place& a, const Place& b) {
    return std::tie(a.strip, a.elevation_rad, a.beam) < std::tie(b.strip, b.elevation_rad, b.beam);
  });
  std::vector<std::uint32_t> order;
  order.reserve(places.size());
  for (const Place& place : places)
    order.push_back(place.beam);
  return order;
}

void Scanner::find_slots(std::size_t firings, Block& block) const {
  const std::size_t beams = firings * model_.beams.size();
  block.slots.resize(beams);
  std::uint32_t slot = 0;
  for (const std::uint32_t beam : order_) {
    if (beam < beams) block.slots[beam] = slot++;
  }
}

// Those of all firings, or of this one, for which `swung` is the room.
const BeamDirections& Scanner::directions(std::int64_t firing, BeamDirections& swung) const {
  if (!model_.swings()) return beams_;
  swung = BeamDirections(model_, static_cast<double>(model_.firing_time(firing)), bias_rad_);
  return swung;
}

// What the lidar says of them.
const BeamDirections& Scanner::reported_directions(std::int64_t firing,
                                                   BeamDirections& swung) const {
  if (!model_.swings()) return told_;
  swung = BeamDirections(model_, static_cast<double>(model_.firing_time(firing)));
  return swung;
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
  const auto time_of = [&](std::int64_t firing) { return to_seconds(model_.firing_time(firing)); };
  std::vector<Block> blocks;
  for (std::int64_t first = firings.first; first < firings.end;) {
    // As many groups as the stand stays the same for.
    const std::vector<double>& changes = scene_.changes();
    const auto change = std::upper_bound(changes.begin(), changes.end(), time_of(first));
    const std::size_t begin = blocks.size();
    scene_.arrange(middle, time_of(first));
    std::int64_t until = first;
    do {
      if (until == first || blocks.back().end - blocks.back().first == kBlockFirings) {
        blocks.emplace_back().first = until;
      }
      until = std::min(firings.end, until + kGroupFirings);
      blocks.back().end = until;
    } while (until < firings.end && (change == changes.end() || time_of(until) < *change));
    parallel_for(blocks.size() - begin, 1,
                 [&](std::size_t i) { cast_block(middle, blocks[begin + i]); });
    first = until;
  }
  ScanReadings readings;
  std::vector<std::uint64_t> stems;
  for (const Block& block : blocks) {
    readings.beams.insert(readings.beams.end(), block.readings.begin(), block.readings.end());
    readings.seconds.insert(readings.seconds.end(), block.seconds.begin(), block.seconds.end());
    readings.sources.insert(readings.sources.end(), block.sources.begin(), block.sources.end());
    readings.second_sources.insert(readings.second_sources.end(), block.second_sources.begin(),
                                   block.second_sources.end());
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
  scan->ring_count = model_.swings() ? 0 : static_cast<int>(beams);
  const auto present = [](const BeamReading& reading) { return reading.range_m > 0.0F; };
  scan->points.reserve(static_cast<std::size_t>(
      std::count_if(readings.beams.begin(), readings.beams.end(), present)));
  std::size_t i = 0;
  BeamDirections swung;
  for (std::int64_t firing = firings.first; firing < firings.end; ++firing) {
    const TimeNs firing_time = model_.firing_time(firing);
    const BeamDirections& looks = reported_directions(firing, swung);
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
            origin + reading.range_m * (head * looks.direction(b)).cast<float>();
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

void Scanner::cast_block(double moment_s, Block& block) const {
  const std::int64_t first = block.first;
  const std::size_t beams = model_.beams.size();
  const bool two = config_.returns == 2;
  block.readings.resize(static_cast<std::size_t>(block.end - first) * beams);
  if (two) block.seconds.resize(block.readings.size());
  if (keeps_sources_) block.sources.resize(block.readings.size());
  if (keeps_sources_ && two) block.second_sources.resize(block.readings.size());
  if (blindness_.covers(to_seconds(model_.firing_time(first)))) return;
  make_rays(moment_s, block);
  block.hits.resize(block.rays.size());
  scene_.cast(block.rays.data(), block.rays.size(), static_cast<float>(config_.min_range_m),
              static_cast<float>(config_.max_range_m), block.hits.data(),
              static_cast<std::size_t>(config_.rays_per_beam));
  if (!machine_.empty()) hit_machine(block);
  const auto rays_per_beam = static_cast<std::size_t>(config_.rays_per_beam);
  NoiseRow row(seed_, 0);
  for (std::size_t i = 0; i < block.readings.size(); ++i) {
    const auto firing = static_cast<std::uint64_t>(first) + i / beams;
    if (i % beams == 0) row = NoiseRow(seed_, firing);
    BeamEcho second;
    BeamEcho echo =
        strongest_echo(std::span(block.hits).subspan(block.slots[i] * rays_per_beam, rays_per_beam),
                       config_.pulse_m, two ? &second : nullptr);
    if (weather_.has_snow()) {
      const auto number = static_cast<std::int64_t>(firing);
      const BeamEcho behind = echo;
      weather_.add_flake_echo(number, i % beams, to_seconds(model_.firing_time(number)), echo);
      if (two && echo.surface == Surface::kSnow) second = behind;
    }
    if (keeps_sources_) {
      block.sources[i] = {echo.tree, echo.surface};
      if (two) block.second_sources[i] = {second.tree, second.surface};
    }
    if (second.surface != Surface::kNone) {
      block.seconds[i] = read_echo(second, config_, CounterNoise(seed_ + 5, firing, i % beams));
    }
    if (echo.surface == Surface::kNone) continue;
    block.readings[i] = read_echo(echo, config_, row.at(i % beams));
    if (echo.surface == Surface::kStem && echo.tree > 0 && block.readings[i].range_m > 0.0F) {
      block.stems.push_back(static_cast<std::uint64_t>(echo.tree) << 16 |
                            model_.beams[i % beams].ring);
    }
  }
  if (config_.blooming > 0.0 || config_.crosstalk > 0.0) add_ghosts(block);
  if (weather_.has_spurious()) add_spurious(block);
  block.let_go_of_rays();
}

// Readings that nothing stands for. Glaring echoes repeat in the beam's neighbours of the firings
// before and after (within a group), and other sensors' pulses give any range.
void Scanner::add_ghosts(Block& block) const {
  const std::size_t beams = model_.beams.size();
  const std::size_t group = static_cast<std::size_t>(kGroupFirings) * beams;
  const std::vector<BeamReading> real = block.readings;
  const auto step = static_cast<float>(std::max(config_.range_step_m, 1e-4));
  for (std::size_t i = 0; i < real.size(); ++i) {
    const auto firing = static_cast<std::uint64_t>(block.first) + i / beams;
    CounterNoise noise(seed_ + 8, firing, i % beams);
    if (noise.uniform() < config_.crosstalk) {
      const double range = config_.min_range_m + noise.uniform() * 0.6 * config_.max_range_m;
      block.readings[i] = {std::round(static_cast<float>(range) / step) * step,
                           std::round(1.0F + 12.0F * noise.uniform())};
      if (keeps_sources_) block.sources[i] = {};
      continue;
    }
    const bool blooms = noise.uniform() < config_.blooming;
    if (!blooms) continue;
    for (const std::size_t other : {i - beams, i + beams}) {  // before the first wraps: too large
      if (other >= real.size() || other / group != i / group) continue;
      if (real[other].intensity < kGlaring) continue;
      const bool behind = real[i].range_m <= 0.0F || real[i].range_m > real[other].range_m + 0.3F;
      if (!behind) continue;
      block.readings[i] = {real[other].range_m, std::round(0.3F * real[other].intensity)};
      if (keeps_sources_) block.sources[i] = {};
    }
  }
}

// Of a cold lidar and of the sun. A beam that has one tells nothing else, so its weaker echo goes.
void Scanner::add_spurious(Block& block) const {
  const std::size_t beams = model_.beams.size();
  const auto rays_per_beam = static_cast<std::size_t>(config_.rays_per_beam);
  for (std::size_t i = 0; i < block.readings.size(); ++i) {
    const std::int64_t firing = block.first + static_cast<std::int64_t>(i / beams);
    const LookingBeam look{firing, i % beams, to_seconds(model_.firing_time(firing)),
                           block.rays[block.slots[i] * rays_per_beam].direction};
    const std::optional<BeamReading> reading = weather_.spurious(look);
    if (!reading) continue;
    block.readings[i] = *reading;
    if (!block.seconds.empty()) block.seconds[i] = {};
    if (keeps_sources_) block.sources[i] = {};
  }
}

void Scanner::make_rays(double moment_s, Block& block) const {
  const std::size_t beams = model_.beams.size();
  const auto firings = static_cast<std::size_t>(block.end - block.first);
  find_slots(firings, block);
  block.rays.resize(firings * beams * static_cast<std::size_t>(config_.rays_per_beam));
  // Beams that look out at the same time share a pose.
  const std::size_t together = model_.beams_at_once ? beams : 1;
  BeamDirections swung;
  for (std::size_t f = 0; f < firings; ++f) {
    const std::int64_t firing = block.first + static_cast<std::int64_t>(f);
    const TimeNs firing_time = model_.firing_time(firing);
    const BeamDirections& looks = directions(firing, swung);
    CounterNoise jitter(seed_ + 1, static_cast<std::uint64_t>(firing), 0);
    const Turn shaken(config_.azimuth_jitter_deg * kDegree * jitter.normal());
    for (std::size_t b = 0; b < beams; b += together) {
      const TimeNs time = firing_time + static_cast<TimeNs>(model_.beams[b].delay_ns);
      const Turn head(model_.azimuth(static_cast<double>(time)));
      const Eigen::Vector3d origin =
          model_.beam_origin_m * Eigen::Vector3d(head.cosine, head.sine, 0.0);
      const Pose world_from_lidar = path_.pose(to_seconds(time)) * body_from_lidar_;
      const Look look{shaken, (world_from_lidar.rotation_matrix() * head.matrix()).cast<float>(),
                      world_from_lidar.translation().cast<float>(),
                      static_cast<float>(to_seconds(time) - moment_s), looks};
      look_out(look, firing, {b, b + together}, &block.slots[f * beams], block.rays);
      if (machine_.empty()) continue;
      if (b == 0) block.origin_in_lidar.push_back(origin.cast<float>());
      for (std::size_t i = b; i < b + together; ++i)
        block.direction_in_lidar.push_back((head * looks.direction(i)).cast<float>());
    }
  }
}

// Rays of the beams [first, end) of a firing, each in a random direction within its footprint, to
// their slots. Arrays of numbers instead of vectors, as the compiler works through several at once;
// in the frame that turns with the head.
void Scanner::look_out(const Look& look, std::int64_t firing,
                       std::pair<std::size_t, std::size_t> range, const std::uint32_t* slots,
                       std::vector<Ray>& rays) const {
  const auto spread = static_cast<float>(0.25e-3 * config_.divergence_mrad);  // one sd
  const auto exit = static_cast<float>(0.25 * config_.beam_exit_m);
  const auto sine = static_cast<float>(look.shaken.sine);
  const auto cosine = static_cast<float>(look.shaken.cosine);
  const auto off_axis = static_cast<float>(model_.beam_origin_m);
  const Eigen::Matrix3f r = look.world_from_head;
  const auto rays_per_beam = static_cast<std::size_t>(config_.rays_per_beam);
  const std::size_t begin = range.first;
  const std::size_t count = range.second - begin;
  const NoiseRow row(seed_ + 2, static_cast<std::uint64_t>(firing));
  std::array<CounterNoise, kMostBeams> noise;
  for (std::size_t i = 0; i < count; ++i)
    noise[i] = row.at(begin + i);
  Drawn drawn;
  Made made;
  const float* bx = &look.beams.near_x[begin];
  const float* by = &look.beams.near_y[begin];
  const float* bz = &look.beams.near_z[begin];
  const float* side_x = &look.beams.near_side_x[begin];
  const float* side_y = &look.beams.near_side_y[begin];
  for (std::size_t k = 0; k < rays_per_beam; ++k) {
    draw(noise, count, drawn);
    for (std::size_t i = 0; i < count; ++i) {
      const auto [u, v] = CounterNoise::normal_pair_of(drawn.far[i], drawn.around[i]);
      const float cx = cosine * bx[i] - sine * by[i];
      const float cy = sine * bx[i] + cosine * by[i];
      const float cz = bz[i];
      // To the left of the beam, level, and up from it.
      const float ox = u * side_x[i] - v * (cz * side_y[i]);
      const float oy = u * side_y[i] + v * (cz * side_x[i]);
      const float oz = v * (cx * side_y[i] - cy * side_x[i]);
      const float ex = cx + spread * ox;
      const float ey = cy + spread * oy;
      const float ez = cz + spread * oz;
      const float scale = 1.0F / std::sqrt(ex * ex + ey * ey + ez * ez);
      const float fx = off_axis + exit * ox;
      const float fy = exit * oy;
      const float fz = exit * oz;
      made.x[i] = scale * (r(0, 0) * ex + r(0, 1) * ey + r(0, 2) * ez);
      made.y[i] = scale * (r(1, 0) * ex + r(1, 1) * ey + r(1, 2) * ez);
      made.z[i] = scale * (r(2, 0) * ex + r(2, 1) * ey + r(2, 2) * ez);
      made.from_x[i] = look.place.x() + (r(0, 0) * fx + r(0, 1) * fy + r(0, 2) * fz);
      made.from_y[i] = look.place.y() + (r(1, 0) * fx + r(1, 1) * fy + r(1, 2) * fz);
      made.from_z[i] = look.place.z() + (r(2, 0) * fx + r(2, 1) * fy + r(2, 2) * fz);
    }
    for (std::size_t i = 0; i < count; ++i) {
      rays[slots[begin + i] * rays_per_beam + k] = {
          {made.from_x[i], made.from_y[i], made.from_z[i]},
          {made.x[i], made.y[i], made.z[i]},
          look.time_s};
    }
  }
}

void Scanner::hit_machine(Block& block) const {
  const std::size_t beams = model_.beams.size();
  const auto rays_per_beam = static_cast<std::size_t>(config_.rays_per_beam);
  for (std::size_t f = 0; f * beams < block.slots.size(); ++f) {
    const double time = to_seconds(model_.firing_time(block.first + static_cast<std::int64_t>(f)));
    const Machine::Parts parts = machine_.at(time);
    const std::optional<HeldTree> held = machine_.held(time);
    const Eigen::Vector3d origin = body_from_lidar_ * block.origin_in_lidar[f].cast<double>();
    for (std::size_t beam = f * beams; beam < (f + 1) * beams; ++beam) {
      const Eigen::Vector3d direction =
          body_from_lidar_.rotation() * block.direction_in_lidar[beam].cast<double>();
      const std::size_t slot = block.slots[beam] * rays_per_beam;
      for (std::size_t i = slot; i < slot + rays_per_beam; ++i) {
        Machine::cast(parts, origin, direction, config_.min_range_m, config_.max_range_m,
                      block.hits[i]);
        if (!held) continue;
        scene_.cast_held(*held, block.rays[i], static_cast<float>(config_.min_range_m),
                         static_cast<float>(config_.max_range_m), block.hits[i]);
      }
    }
  }
}

}  // namespace understory
