// How fast the simulator casts: milliseconds a scan, wall and CPU, against the time that the sensor
// takes for it (docs/method/simulation.md).
// The sum is that of the readings' bytes: a change that keeps it keeps every cache of scans.
//   scan_casting SITE SEED [THREADS] [key=value ...]
#include <algorithm>
#include <bit>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "understory/simulation/sensors/scanner.h"
#include "understory/simulation/world.h"
#include "understory/util/parallel.h"
#include "understory/util/timing.h"

namespace understory {
namespace {

constexpr int kScans = 60;

struct Cast {
  double wall_ms = 0.0;
  double cpu_ms = 0.0;
};

void run(const SiteConfig& site, int threads) {
  SimulatedWorld world(site);
  Scanner scanner(site, world.scene, world.plan.path, world.machine, 0);
  const double revolution_s = 1.0 / site.lidar.rate_hz;
  const auto all = static_cast<std::int64_t>((world.plan.path.duration_s() - 1.0) / revolution_s);
  std::vector<Cast> casts;
  std::size_t points = 0;
  std::uint64_t sum = 0xcbf29ce484222325ULL;  // of the readings
  for (int i = 0; i < kScans; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    const double cpu_begin = process_cpu_seconds();
    const ScanReadings readings = scanner.measure(all * i / kScans);
    const std::chrono::duration<double, std::milli> wall = std::chrono::steady_clock::now() - begin;
    casts.push_back({wall.count(), 1e3 * (process_cpu_seconds() - cpu_begin)});
    for (const BeamReading& beam : readings.beams) {
      for (const float value : {beam.range_m, beam.intensity})
        sum = (sum ^ std::bit_cast<std::uint32_t>(value)) * 0x100000001b3ULL;
    }
    points += static_cast<std::size_t>(
        std::count_if(readings.beams.begin(), readings.beams.end(),
                      [](const BeamReading& beam) { return beam.range_m > 0.0F; }));
  }
  Cast mean;
  for (const Cast& cast : casts) {
    mean.wall_ms += cast.wall_ms / kScans;
    mean.cpu_ms += cast.cpu_ms / kScans;
  }
  std::printf(
      "%d threads: %.1f ms wall, %.1f ms CPU a scan of %zu points, %.2f x sensor speed, sum "
      "%016llx\n",
      threads, mean.wall_ms, mean.cpu_ms, points / kScans, 1e3 * revolution_s / mean.wall_ms,
      static_cast<unsigned long long>(sum));
}

}  // namespace
}  // namespace understory

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "scan_casting SITE SEED [THREADS] [key=value ...]\n");
    return 2;
  }
  std::vector<std::string> settings = {std::string("seed=") + argv[2]};
  int threads = understory::hardware_threads();
  for (int i = 3; i < argc; ++i) {
    if (std::string(argv[i]).find('=') == std::string::npos) {
      threads = std::max(1, std::atoi(argv[i]));
    } else {
      settings.emplace_back(argv[i]);
    }
  }
  understory::with_threads(
      threads, [&] { understory::run(understory::load_site(argv[1], settings), threads); });
  return 0;
}
