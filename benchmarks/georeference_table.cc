// Many receivers on one path: how far each fit to satellite positions lays a run off its place, and
// whether the stated covariance holds. See docs/method/georeference.md; georeference_table.py.
//   georeference_table SITE PATH FROM TO [--fits-only] [key=value ...]
// PATH is a run folder that was mapped on the site with the same settings. drift:N is the true path
// with the drift of seed N. The receivers have the seeds FROM to TO. --fits-only leaves the slow
// methods out: fuse, fit6 and gnss-path. Prints one row of CSV a receiver and method.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "drifted_path.h"
#include "understory/evaluation/trajectory.h"
#include "understory/georeference/satellites/fused_path.h"
#include "understory/georeference/satellites/gnss_fit.h"
#include "understory/georeference/satellites/satellite_fit.h"
#include "understory/georeference/satellites/satellite_smoothing.h"
#include "understory/georeference/satellites/split_fit.h"
#include "understory/map/keyframes/keyframe_map.h"
#include "understory/simulation/sensors/inertial.h"
#include "understory/simulation/sensors/satellite.h"
#include "understory/simulation/world.h"

namespace understory {
namespace {

using Eigen::Vector3d;

// The motion that lays the run on the truth, from all its poses.
Pose reference_motion(const Trajectory& run, const Trajectory& truth) {
  std::vector<FullPair> pairs;
  std::vector<PlacePair> places;
  Matrix6d covariance = Matrix6d::Identity();
  covariance.topLeftCorner<3, 3>() *= std::pow(0.1 * M_PI / 180.0, 2.0);
  covariance.bottomRightCorner<3, 3>() *= 0.05 * 0.05;
  for (std::size_t k = 0; k < run.size(); ++k) {
    FullPair pair;
    pair.source_from_body = run[k].world_from_body;
    pair.target_from_body = truth[k].world_from_body;
    pair.target_covariance = covariance;
    pairs.push_back(pair);
    PlacePair place;
    place.source = pair.source_from_body.translation();
    place.target = pair.target_from_body.translation();
    places.push_back(place);
  }
  return fit_poses(pairs, fit_closed(places).target_from_source, {}).target_from_source;
}

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

std::vector<ImuSample> samples_of(const SimulatedWorld& world, TimeNs start, TimeNs end) {
  InertialSensor sensor(world.site, world.plan.path, start, world.plan.shocks_s);
  std::vector<ImuSample> samples;
  while (sensor.next_stamp() <= end)
    samples.push_back(sensor.next());
  return samples;
}

// The run as `map` has it before positions enter its graph: a keyframe each metre, with the
// odometry's default covariances. Without its loops, whose work is done.
SolvedRun solved_run(const Trajectory& run) {
  const KeyframeMap::Config edges;
  SolvedRun solved;
  solved.trajectory = run;
  Pose last;
  for (const StampedPose& pose : run) {
    const Pose& at = pose.world_from_body;
    const Pose step = last.inverse() * at;
    const double length_m = step.translation().norm();
    const int index = static_cast<int>(solved.stamps.size());
    if (index > 0 && length_m < 1.0) continue;
    if (index > 0) {
      Vector6d sd;
      sd << Vector3d::Constant(edges.edge_rotation_deg_per_sqrt_m * M_PI / 180.0),
          Vector3d::Constant(edges.edge_translation_m_per_sqrt_m);
      solved.graph.odometry.push_back(
          {index - 1, index, step, (length_m * sd.cwiseAbs2()).asDiagonal()});
    }
    solved.graph.world_from_keyframe.push_back(at);
    solved.stamps.push_back(pose.stamp);
    last = at;
  }
  return solved;
}

struct Judged {
  const SimulatedWorld& world;
  const Trajectory& run;
  const Trajectory& truth;
  SolvedRun solved;
  Pose reference;  // site from run
  std::vector<ImuSample> samples;
  Pose body_from_imu;

  // A path whose shape may differ from that of the run.
  void print(int seed, const char* method, const FusedPath& path,
             const GeodeticPlace& origin) const {
    const OriginConfig& at = world.site.origin;
    const Vector3d shift =
        EastNorthUp({at.latitude_deg, at.longitude_deg, at.height_m}).from_place(origin);
    double squares = 0.0;
    Vector3d first = Vector3d::Zero();
    Vector3d turn = Vector3d::Zero();
    std::size_t row = 0;
    for (std::size_t k = 0; k < path.enu_from_keyframe.size(); ++k) {
      while (truth[row].stamp < solved.stamps[k])
        ++row;
      const Pose& there = truth[row].world_from_body;
      const Pose& found = path.enu_from_keyframe[k];
      const Vector3d off = found.translation() + shift - there.translation();
      squares += off.squaredNorm() / static_cast<double>(path.enu_from_keyframe.size());
      if (k > 0) continue;
      first = off;
      turn = so3_log(found.rotation() * there.rotation().conjugate()) * 180.0 / M_PI;
    }
    std::printf("%d,%s,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,nan,nan,nan,nan,nan,nan\n", seed,
                method, first.x(), first.y(), first.z(), turn.x(), turn.y(), turn.z(),
                std::sqrt(squares), path.expected_error_m);
  }

  void print(int seed, const char* method, const Pose& enu_from_world, const GeodeticPlace& origin,
             const Matrix6d& spread, double expected_m) const {
    const OriginConfig& at = world.site.origin;
    const Vector3d shift =
        EastNorthUp({at.latitude_deg, at.longitude_deg, at.height_m}).from_place(origin);
    const Pose placed(enu_from_world.rotation(), enu_from_world.translation() + shift);
    const Vector3d turn =
        so3_log(placed.rotation() * reference.rotation().conjugate()) * 180.0 / M_PI;
    const Vector3d first = run.front().world_from_body.translation();
    const Vector3d off = placed * first - reference * first;
    Vector3d middle = Vector3d::Zero();
    double squares = 0.0;
    for (const StampedPose& pose : run) {
      const Vector3d p = pose.world_from_body.translation();
      squares += (placed * p - reference * p).squaredNorm() / static_cast<double>(run.size());
      middle += p / static_cast<double>(run.size());
    }
    const Vector3d middle_off = placed * middle - reference * middle;
    std::printf("%d,%s,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f", seed, method, off.x(), off.y(),
                off.z(), turn.x(), turn.y(), turn.z(), std::sqrt(squares), expected_m);
    for (int k = 0; k < 6; ++k) {
      const double error = k < 3 ? turn(k) * M_PI / 180.0 : middle_off(k - 3);
      std::printf(",%.5f", error * error / spread(k, k));
    }
    std::printf("\n");
  }
};

void lay(const Judged& judged, const std::vector<GnssFix>& fixes, int seed, bool fits_only) {
  SatelliteFitConfig config;
  const std::vector<double>& mount = judged.world.site.gnss.mount_m;
  config.pairing.antenna_in_body = {mount[0], mount[1], mount[2]};
  config.split.tilt_sd_deg = tilt_sd_deg(LevelledBy::kGravity, straightness(judged.run));
  const std::vector<SatelliteFit> fits = fits_to_satellites(
      judged.run, fixes,
      {SatelliteMethod::kClosed, SatelliteMethod::kFit3, SatelliteMethod::kSplit}, config);
  const char* names[] = {"closed", "fit3", "split"};
  const SatelliteFit* best = nullptr;
  for (std::size_t k = 0; k < fits.size(); ++k) {
    const SatelliteFit& fit = fits[k];
    if (!fit.found) continue;
    judged.print(seed, names[k], fit.enu_from_world, *fit.origin, fit.spread, fit.expected_error_m);
    if (best == nullptr || fit.expected_error_m < best->expected_error_m) best = &fit;
  }
  if (best != nullptr)
    judged.print(seed, "auto", best->enu_from_world, *best->origin, best->spread,
                 best->expected_error_m);
  if (fits_only) return;
  if (fits[2].found) {
    const Pose& guess = fits[2].enu_from_world;
    const FusedPath fused =
        fuse_path(judged.solved, fixes, guess, config.pairing, config.split, {});
    if (fused.found) judged.print(seed, "fuse", fused, *fits[2].origin);
  }
  SatelliteSmoothingConfig smoothing;
  smoothing.pairing = config.pairing;
  smoothing.body_from_imu = judged.body_from_imu;
  const SatelliteFit six = fit_to_satellites(
      judged.run, fixes, SatelliteMethod::kFit6, config,
      smooth_satellites(judged.run, fixes, judged.samples, fits[2].enu_from_world, smoothing));
  if (six.found)
    judged.print(seed, "fit6", six.enu_from_world, *six.origin, six.spread, six.expected_error_m);
  const GnssFit path = fit_to_gnss(judged.run, config.pairing.antenna_in_body, fixes, {});
  if (path.path.found)
    judged.print(seed, "gnss-path", path.enu_from_world, *path.origin,
                 Matrix6d::Constant(std::nan("")), std::nan(""));
}

int run_table(int argc, char** argv) {
  const std::string path = argv[2];
  const int from = std::atoi(argv[3]);
  const int to = std::atoi(argv[4]);
  const bool fits_only = argc > 5 && std::string(argv[5]) == "--fits-only";
  const std::vector<std::string> settings(argv + (fits_only ? 6 : 5), argv + argc);
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
  const Judged judged{world,
                      run,
                      truth,
                      solved_run(run),
                      reference_motion(run, truth),
                      samples_of(world, start, stamps.back()),
                      InertialSensor(site, world.plan.path, start).body_from_imu()};
  std::printf(
      "seed,method,east_m,north_m,up_m,turn_east_deg,turn_north_deg,turn_up_deg,rms_m,expected_m,"
      "n_turn_east,n_turn_north,n_turn_up,n_east,n_north,n_up\n");
  for (int seed = from; seed <= to; ++seed)
    lay(judged, fixes_of(world, seed, start, stamps.back()), seed, fits_only);
  return 0;
}

}  // namespace
}  // namespace understory

int main(int argc, char** argv) {
  if (argc < 5) {
    std::fprintf(stderr, "georeference_table SITE PATH FROM TO [--fits-only] [key=value ...]\n");
    return 2;
  }
  return understory::run_table(argc, argv);
}
