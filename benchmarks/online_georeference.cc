// Many receivers on one path: whether the online georeference states its errors honestly at every
// scan (docs/method/georeference.md; online_georeference.py).
//   online_georeference SITE PATH FROM TO [key=value ...]
// PATH is a run folder that was mapped on the site with the same settings. drift:N is the true path
// with the drift of seed N. The receivers have the seeds FROM to TO. Prints one row of CSV a
// receiver.
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <string>
#include <vector>

#include "drifted_path.h"
#include "understory/evaluation/trajectory.h"
#include "understory/georeference/satellites/online_georeference.h"
#include "understory/georeference/satellites/split_fit.h"
#include "understory/simulation/sensors/satellite.h"
#include "understory/simulation/world.h"

namespace understory {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = M_PI / 180.0;
constexpr int kFreedoms = 6;
const char* const kNames[kFreedoms] = {"east", "north", "up", "turn_east", "turn_north", "turn_up"};

std::vector<GnssFix> fixes_of(const SimulatedWorld& world, int seed, TimeNs start, TimeNs end) {
  SiteConfig site = world.site;
  site.seed = seed;
  SatelliteReceiver receiver(site, world.plan.path, world.scene, start);
  std::vector<GnssFix> fixes;
  while (receiver.next_stamp() <= end) {
    if (const auto fix = receiver.next()) fixes.push_back(*fix);
  }
  return fixes;
}

// What is counted over the scans of one receiver.
struct Counts {
  std::array<double, kFreedoms> known{};
  std::array<double, kFreedoms> within{};  // three standard deviations
  std::array<double, kFreedoms> squares{};
  std::array<double, kFreedoms> normalised{};
  std::array<double, kFreedoms> variance{};  // as stated
  double cpu_ms = 0.0;

  // Place in metres, turns in degrees; not a number where it is not known.
  void add(const GlobalPose& pose, const Vector3d& off, const Vector3d& turn) {
    for (int i = 0; i < 3; ++i) {
      add(i, off(i), pose.place_sd_m(i));
      add(3 + i, turn(i), pose.turn_sd_deg(i));
    }
  }
  void add(int freedom, double error, double sd) {
    const auto k = static_cast<std::size_t>(freedom);
    if (!std::isfinite(sd)) return;
    known[k] += 1.0;
    within[k] += std::abs(error) <= 3.0 * sd ? 1.0 : 0.0;
    squares[k] += error * error;
    normalised[k] += error * error / (sd * sd);
    variance[k] += sd * sd;
  }
};

double cpu_ms() {
  return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

void replay(const SimulatedWorld& world, const Trajectory& run, const Trajectory& truth, int seed,
            const std::vector<GnssFix>& fixes) {
  const OriginConfig& at = world.site.origin;
  const EastNorthUp site_frame({at.latitude_deg, at.longitude_deg, at.height_m});
  const std::vector<double>& mount = world.site.gnss.mount_m;
  OnlineGeoreferenceConfig config;
  config.tilt_sd_deg = tilt_sd_deg(LevelledBy::kGravity, 1.0);  // as `map` does
  OnlineGeoreference online(config);
  Counts counts;
  std::size_t next = 0;
  for (std::size_t k = 0; k < run.size(); ++k) {
    const double before_ms = cpu_ms();
    for (; next < fixes.size() && fixes[next].stamp <= run[k].stamp; ++next)
      online.add_fix(fixes[next], {mount[0], mount[1], mount[2]});
    const GlobalPose pose = online.add_pose(run[k]);
    counts.cpu_ms += cpu_ms() - before_ms;
    if (!pose.known) continue;
    GeodeticPlace place = pose.place;
    if (!pose.height_known) place.height_m = at.height_m;
    const Vector3d off = site_frame.from_place(place) - truth[k].world_from_body.translation();
    Vector3d turn = Vector3d::Zero();
    if (pose.heading_known)
      turn =
          so3_log(pose.enu_from_body * truth[k].world_from_body.rotation().conjugate()) / kDegree;
    counts.add(pose, off, turn);
  }
  const auto scans = static_cast<double>(run.size());
  std::printf("%d,%.0f,%.4f", seed, scans, counts.cpu_ms / scans);
  for (std::size_t k = 0; k < kFreedoms; ++k)
    std::printf(",%.0f,%.0f,%.4f,%.4f,%.4f", counts.known[k], counts.within[k], counts.squares[k],
                counts.normalised[k], counts.variance[k]);
  std::printf("\n");
  std::fflush(stdout);
}

int run_table(int argc, char** argv) {
  const std::string path = argv[2];
  const std::vector<std::string> settings(argv + 5, argv + argc);
  const SiteConfig site = load_site(argv[1], settings);
  const SimulatedWorld world(site);
  const double whole_s = std::floor(site.origin.start_time_s);
  const TimeNs start = static_cast<TimeNs>(whole_s) * kNsPerSecond +
                       from_seconds(site.origin.start_time_s - whole_s);
  Trajectory run;
  std::vector<TimeNs> stamps;
  if (path.starts_with("drift:")) {
    for (TimeNs t = 0; to_seconds(t) < world.plan.path.duration_s() - 1.0; t += kNsPerSecond / 10)
      stamps.push_back(start + t);
  } else {
    run = read_trajectory(std::filesystem::path(path) / "trajectory.tum");
    for (const StampedPose& pose : run)
      stamps.push_back(pose.stamp);
  }
  const Trajectory truth = true_path(world, stamps, start);
  if (run.empty()) run = drifted_path(truth, std::strtoull(path.c_str() + 6, nullptr, 10));
  std::printf("seed,scans,cpu_ms");
  for (const char* name : kNames)
    std::printf(",%s_known,%s_within,%s_squares,%s_normalised,%s_variance", name, name, name, name,
                name);
  std::printf("\n");
  for (int seed = std::atoi(argv[3]); seed <= std::atoi(argv[4]); ++seed)
    replay(world, run, truth, seed, fixes_of(world, seed, start, stamps.back()));
  return 0;
}

}  // namespace
}  // namespace understory

int main(int argc, char** argv) {
  if (argc < 5) {
    std::fprintf(stderr, "online_georeference SITE PATH FROM TO [key=value ...]\n");
    return 2;
  }
  return understory::run_table(argc, argv);
}
