// How many of the returns that are weather the filters of preprocess/ drop, and how many others.
//   weather_points APART SCANS SITE KEY=VALUE ...   simulates the site and prints one line of
//   counts
// APART, SCANS: settings preprocess.weather.apart and .scans. Prints: weather, of these dropped,
// others, of these dropped, of these by drop_isolated (which is always on). Returns of the first
// second do not count: no scans before them tell. The poses are the true ones.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include "understory/preprocess/isolated_points.h"
#include "understory/preprocess/weather_filter.h"
#include "understory/simulation/simulator.h"

namespace understory {
namespace {

struct Counts {
  std::uint64_t weather = 0;
  std::uint64_t weather_dropped = 0;
  std::uint64_t other = 0;
  std::uint64_t other_dropped = 0;
  std::uint64_t other_isolated = 0;  // of these, by drop_isolated
};

// The points at their true places, so that the world is the frame of the body.
BodyCloud cloud_of(const Scan& scan, const std::vector<TruePoint>& truth,
                   const std::vector<std::uint8_t>& keep) {
  BodyCloud cloud;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (!keep.empty() && keep[i] == 0) continue;
    const ScanPoint& point = scan.points[i];
    cloud.points.push_back(truth[i].place.cast<float>());
    cloud.intensity.push_back(point.intensity);
    cloud.range.push_back(Eigen::Vector3f(point.x, point.y, point.z).norm());
    cloud.ring.push_back(point.ring);
    cloud.t_ns.push_back(static_cast<std::uint32_t>(i));
  }
  return cloud;
}

void count(const Scan& scan, const std::vector<TruePoint>& truth, WeatherFilter& filter,
           Counts* counts) {
  std::vector<std::uint8_t> keep;
  if (!filter.judges(scan)) drop_isolated(scan, {}, keep);
  BodyCloud cloud = cloud_of(scan, truth, keep);
  filter.drop(cloud, Pose());
  filter.remember(Pose());
  if (counts == nullptr) return;
  std::vector<bool> kept(truth.size(), false);
  for (const std::uint32_t i : cloud.t_ns)
    kept[i] = true;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const Surface surface = truth[i].source.surface;
    const bool weather = surface == Surface::kSnow || surface == Surface::kNone;
    (weather ? counts->weather : counts->other) += 1;
    if (!weather && !keep.empty() && keep[i] == 0) ++counts->other_isolated;
    if (!kept[i]) (weather ? counts->weather_dropped : counts->other_dropped) += 1;
  }
}

void run(const WeatherFilterConfig& config, const std::string& site,
         const std::vector<std::string>& settings) {
  Simulator simulator(load_site(site, settings));
  std::vector<TruePoint> truth;
  simulator.set_point_sink([&](const std::vector<TruePoint>& points) { truth = points; });
  WeatherFilter filter(config);
  Counts counts;
  TimeNs first = 0;
  while (const std::optional<Event> event = simulator.next()) {
    const auto* scan = std::get_if<ScanPtr>(&*event);
    if (scan == nullptr) continue;
    if (first == 0) first = (*scan)->stamp;
    const bool begun = to_seconds((*scan)->stamp - first) >= 1.0;
    count(**scan, truth, filter, begun ? &counts : nullptr);
  }
  std::printf("%llu %llu %llu %llu %llu\n", static_cast<unsigned long long>(counts.weather),
              static_cast<unsigned long long>(counts.weather_dropped),
              static_cast<unsigned long long>(counts.other),
              static_cast<unsigned long long>(counts.other_dropped),
              static_cast<unsigned long long>(counts.other_isolated));
}

}  // namespace
}  // namespace understory

int main(int argc, char** argv) {
  if (argc < 4) return 2;
  understory::WeatherFilterConfig config;
  config.enabled = true;
  config.apart = std::atof(argv[1]);
  config.scans = std::atoi(argv[2]);
  understory::run(config, argv[3], std::vector<std::string>(argv + 4, argv + argc));
  return 0;
}
