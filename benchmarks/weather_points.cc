// How many of the returns that are weather the filters of preprocess/ drop, and how many others.
//   weather_points APART SCANS SITE KEY=VALUE ...   simulates the site and prints one line of
//   counts
// APART, SCANS: settings preprocess.weather.apart and .scans. Prints: weather, of these dropped,
// others, of these dropped, of these by drop_isolated (which is always on). Returns of the first
// second do not count: no scans before them tell. The poses are the true ones. Returns that go
// along with the lidar are marked as the odometry marks them.
#include <Eigen/Geometry>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include "understory/preprocess/carried_returns.h"
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

// The lidar as it stood over the scan: the pose that fits best between the points and their true
// places.
Eigen::Isometry3d world_from_lidar(const Scan& scan, const std::vector<TruePoint>& truth) {
  constexpr std::size_t kEach = 16;  // of the points
  const auto n = static_cast<Eigen::Index>(truth.size() / kEach);
  if (n < 3) return Eigen::Isometry3d::Identity();
  Eigen::Matrix3Xd measured(3, n);
  Eigen::Matrix3Xd true_places(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const std::size_t at = static_cast<std::size_t>(i) * kEach;
    measured.col(i) =
        Eigen::Vector3f(scan.points[at].x, scan.points[at].y, scan.points[at].z).cast<double>();
    true_places.col(i) = truth[at].place;
  }
  return Eigen::Isometry3d(Eigen::umeyama(measured, true_places, false));
}

// The points at their true places, in the frame of the lidar. `from`: their numbers in the scan.
BodyCloud cloud_of(const Scan& scan, const std::vector<TruePoint>& truth,
                   const std::vector<std::size_t>& from,
                   const Eigen::Isometry3d& world_from_lidar) {
  const Eigen::Isometry3d lidar_from_world = world_from_lidar.inverse();
  BodyCloud cloud;
  for (const std::size_t i : from) {
    const ScanPoint& point = scan.points[i];
    cloud.points.push_back((lidar_from_world * truth[i].place).cast<float>());
    cloud.intensity.push_back(point.intensity);
    cloud.range.push_back(Eigen::Vector3f(point.x, point.y, point.z).norm());
    cloud.ring.push_back(point.ring);
    cloud.t_ns.push_back(point.t_ns);
  }
  return cloud;
}

// Which returns of the scan the cloud still has: some of those that it was made of, in their order.
std::vector<bool> kept_of(const Points& points, const std::vector<std::size_t>& from,
                          const BodyCloud& cloud, std::size_t returns) {
  std::vector<bool> kept(returns, false);
  std::size_t next = 0;
  for (std::size_t i = 0; i < from.size() && next < cloud.size(); ++i) {
    if (points[i] != cloud.points[next]) continue;
    kept[from[i]] = true;
    ++next;
  }
  return kept;
}

void count(const Scan& scan, const std::vector<TruePoint>& truth, CarriedReturns& carried,
           WeatherFilter& filter, Counts* counts) {
  std::vector<std::uint8_t> keep;
  if (!filter.judges(scan)) drop_isolated(scan, {}, keep);
  const Eigen::Isometry3d placed = world_from_lidar(scan, truth);
  carried.learn(scan, placed.rotation().row(2).transpose());
  std::vector<std::size_t> from;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (keep.empty() || keep[i] != 0) from.push_back(i);
  }
  BodyCloud cloud = cloud_of(scan, truth, from, placed);
  const std::vector<std::uint8_t> marks = carried.mark(scan);
  if (!marks.empty()) {
    for (const std::size_t i : from)
      cloud.carried.push_back(marks[i]);
  }
  const Points points = cloud.points;
  const Pose pose(Eigen::Quaterniond(placed.rotation()), placed.translation());
  filter.drop(cloud, pose);
  filter.remember(pose);
  if (counts == nullptr) return;
  const std::vector<bool> kept = kept_of(points, from, cloud, truth.size());
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
  CarriedReturns carried({});
  WeatherFilter filter(config);
  Counts counts;
  TimeNs first = 0;
  while (const std::optional<Event> event = simulator.next()) {
    const auto* scan = std::get_if<ScanPtr>(&*event);
    if (scan == nullptr) continue;
    if (first == 0) first = (*scan)->stamp;
    const bool begun = to_seconds((*scan)->stamp - first) >= 1.0;
    count(**scan, truth, carried, filter, begun ? &counts : nullptr);
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
