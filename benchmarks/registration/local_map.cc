// What a local map of points takes that are all farther than epsilon from each other (P3, section
// 3.3). Whether the time of a scan grows with it: local_map [MILLIONS] [EPSILON_M]. The map is a
// stand made by hand (ground, stems, crowns; no lidar) and grows from its middle outwards. Prints,
// as it grows, the resident memory, the time in which a keyframe in the middle enters, and that of
// a search there.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <vector>

#include <Eigen/Core>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/registration/icp/icp_map.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"
#include "understory/util/stable_sort.h"
#include "understory/util/timing.h"

namespace {

using namespace understory;

constexpr double kTileM = 4.0;            // a tree each
constexpr double kRadiusM = 100.0;        // of the local map, P3 section 5.2
constexpr std::size_t kReturns = 16'384;  // of a keyframe
constexpr double kReachM = 30.0;          // of a keyframe
constexpr std::size_t kSearches = 20'000;
constexpr int kKeyframes = 5;

// A point of a tile: of the ground, a stem or a crown.
Eigen::Vector3d some_point(const Eigen::Vector2d& tile, Random& random) {
  const double what = random.uniform(0.0, 1.0);
  if (what < 0.4) {
    const double x = tile.x() + random.uniform(-0.5, 0.5) * kTileM;
    const double y = tile.y() + random.uniform(-0.5, 0.5) * kTileM;
    return {x, y, 0.3 * std::sin(0.3 * x) * std::cos(0.2 * y) + random.normal(0.0, 0.01)};
  }
  const double turn = random.uniform(0.0, 2.0 * std::numbers::pi);
  const bool stem = what < 0.6;
  const double radius = stem ? 0.15 : 1.5 * std::sqrt(random.uniform(0.0, 1.0));
  return {tile.x() + radius * std::cos(turn), tile.y() + radius * std::sin(turn),
          stem ? random.uniform(0.0, 9.0) : random.uniform(7.0, 14.0)};
}

// The tiles of a disc, from its middle outwards.
std::vector<Eigen::Vector2d> tiles_of_disc() {
  std::vector<Eigen::Vector2d> tiles;
  const int steps = static_cast<int>(kRadiusM / kTileM);
  for (int x = -steps; x <= steps; ++x) {
    for (int y = -steps; y <= steps; ++y) {
      const Eigen::Vector2d tile(kTileM * x, kTileM * y);
      if (tile.norm() <= kRadiusM) tiles.push_back(tile);
    }
  }
  sort_stably(tiles, [](const auto& a, const auto& b) { return a.norm() < b.norm(); });
  return tiles;
}

Points around_the_middle(std::size_t count, Random& random) {
  Points points;
  while (points.size() < count) {
    const double range = kReachM * std::pow(random.uniform(0.0, 1.0), 0.7);
    const double angle = random.uniform(0.0, 2.0 * std::numbers::pi);
    const Eigen::Vector2d at(kTileM * std::round(range * std::cos(angle) / kTileM),
                             kTileM * std::round(range * std::sin(angle) / kTileM));
    points.push_back(some_point(at, random).cast<float>());
  }
  return points;
}

// CPU time of a search, microseconds.
double search_us(const IcpMap& map, Random& random) {
  const Points places = around_the_middle(kSearches, random);
  std::size_t found = 0;
  const double before_s = process_cpu_seconds();
  for (const Eigen::Vector3f& place : places) {
    IcpPair pair;
    IcpMap::Known known;
    if (map.nearest(place.cast<double>() + Eigen::Vector3d(0.02, -0.01, 0.01), 0.5, pair, known))
      ++found;
  }
  const double after_s = process_cpu_seconds();
  if (2 * found < places.size()) std::printf("only %zu of %zu found\n", found, places.size());
  return 1e6 * (after_s - before_s) / static_cast<double>(places.size());
}

// CPU time in which a keyframe enters, milliseconds.
double keyframe_ms(IcpMapBuilder& builder, IcpMapPtr& map, Random& random) {
  double seconds = 0.0;
  for (int i = 0; i < kKeyframes; ++i) {
    const Points points = around_the_middle(kReturns, random);
    map.reset();
    const double before_s = process_cpu_seconds();
    builder.insert(points, Pose());
    map = builder.snapshot();
    seconds += process_cpu_seconds() - before_s;
  }
  return 1e3 * seconds / kKeyframes;
}

void grow(double most, double epsilon_m) {
  Random random(3);
  const double empty_mb = resident_memory_mb();
  IcpMapBuilder builder({.epsilon_m = epsilon_m});
  IcpMapPtr map = builder.snapshot();
  const std::vector<Eigen::Vector2d> tiles = tiles_of_disc();
  const std::size_t part = tiles.size() / 8;
  double of_a_tile = 2.0 * most / static_cast<double>(tiles.size());
  std::printf(
      "| million points | resident MB | bytes a point | told MB | keyframe ms | search us |\n"
      "|---|---|---|---|---|---|\n");
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    map.reset();
    Points points(static_cast<std::size_t>(of_a_tile));
    for (Eigen::Vector3f& point : points)
      point = some_point(tiles[i], random).cast<float>();
    builder.insert(points, Pose());
    if ((i + 1) % part != 0) continue;
    map = builder.snapshot();
    const double entered_ms = keyframe_ms(builder, map, random);
    const auto size = static_cast<double>(map->size());
    const double mb = resident_memory_mb() - empty_mb;
    std::printf("| %.1f | %.0f | %.1f | %.0f | %.1f | %.2f |\n", 1e-6 * size, mb, 1e6 * mb / size,
                1e-6 * builder.bytes(), entered_ms, search_us(*map, random));
    std::fflush(stdout);
    // So many of the points are too near to others that the next part gets more.
    const double left = static_cast<double>(tiles.size() - std::min(tiles.size() - 1, i + 1));
    of_a_tile *= std::max(0.0, most - size) / left * static_cast<double>(i + 1) / size;
  }
  std::printf("peak %.0f MB\n", peak_memory_mb());
}

}  // namespace

int main(int argc, char** argv) {
  const double most = 1e6 * (argc > 1 ? std::atof(argv[1]) : 24.0);
  const double epsilon_m = argc > 2 ? std::atof(argv[2]) : 0.05;
  if (!(most > 0.0 && epsilon_m > 0.0 && epsilon_m <= IcpMapConfig().cube_m)) {
    std::fputs("usage: local_map [MILLIONS] [EPSILON_M], epsilon at most 0.25\n", stderr);
    return 2;
  }
  with_threads(1, [&] { grow(most, epsilon_m); });
  return 0;
}
