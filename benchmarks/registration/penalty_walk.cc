// The mapper of P3 section 3.3 on a simulated site, without an IMU factor and without a graph. Each
// scan is moved by the prior's increment, matched with penalties (6-8), and enters the map point by
// point.
//   penalty_walk SEED WAY_M SCALE PRIOR_SD_DEG [key=value ...]
// runs the site skidoo until the lidar has moved WAY_M, every second scan, once for each kind of
// penalty. SCALE: s of (8). PRIOR_SD_DEG: how far the IMU's increments of attitude are off, per
// root metre. One line of CSV a scan and kind:
//   penalties,way_m,height_m,pitch_deg,true_height_m,true_pitch_deg,matched
// Positions of the penalties are the true ones with 3 cm of white noise, attitudes (gravity and
// heading) with 0.3 degrees. The motion within a scan is taken out by the true poses. Heights are
// above the start.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "understory/features/test_frames.h"
#include "understory/preprocess/voxel_filter.h"
#include "understory/registration/icp/icp_matcher.h"
#include "understory/registration/penalties.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

constexpr double kDegree = M_PI / 180.0;
constexpr double kVoxelM = 0.4;    // of a scan before it is matched
constexpr double kEpsilonM = 0.1;  // of the map: 10 cm on skidoo (P3 section 5.2)
constexpr double kPositionSdM = 0.03;
constexpr double kAttitudeSdDeg = 0.3;
constexpr double kFarthestM = 60.0;
constexpr double kRadiusM = 100.0;  // r_max
constexpr double kArmM = 10.0;      // from the antenna to the points of gravity and heading

struct Settings {
  std::uint64_t seed = 1;
  double way_m = 100.0;
  double scale = 1.0;
  double prior_sd_deg = 0.0;
};

// One scan: its points where they were at its stamp, the true pose, and what GNSS and IMU say.
struct Step {
  Points points;
  Pose truth;
  Pose believed;
  Pose increment;  // from the step before, as the prior has it
  double way_m = 0.0;
};

Points still_points(const TestFrames& site, const Scan& scan, const Pose& lidar_from_world) {
  Points points;
  for (const ScanPoint& point : scan.points) {
    const Eigen::Vector3d at(point.x, point.y, point.z);
    if (at.norm() > kFarthestM) continue;
    points.push_back(
        (lidar_from_world * (site.world_from_lidar(scan, 1e-9 * point.t_ns) * at)).cast<float>());
  }
  return points;
}

Eigen::Vector3d noise(Random& random, double sd) {
  return sd * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
}

Pose turned(const Pose& pose, const Eigen::Vector3d& turn) {
  Vector6d step = Vector6d::Zero();
  step.head<3>() = turn;
  return pose * Pose::exp(step);
}

std::vector<Step> steps_of(TestFrames& site, const Settings& settings) {
  std::vector<Step> steps;
  Random random(settings.seed);
  VoxelFilter voxels;
  for (std::int64_t k = 0; to_seconds(site.scanner.end(k)) < site.duration_s(); k += 2) {
    const SimulatedScan frame = site.scanner.cast(k);
    Step step;
    step.truth = site.world_from_lidar(*frame.scan, 0.0);
    if (!steps.empty()) {
      const Pose moved = steps.back().truth.inverse() * step.truth;
      const double way = moved.translation().norm();
      if (steps.size() == 1 && way < 0.1) steps.pop_back();  // it has not started yet
      if (!steps.empty()) step.way_m = steps.back().way_m + way;
      step.increment =
          turned(moved, noise(random, settings.prior_sd_deg * kDegree * std::sqrt(way)));
    }
    step.points = voxels.filter(still_points(site, *frame.scan, step.truth.inverse()), kVoxelM);
    step.believed =
        turned(Pose(step.truth.rotation(), step.truth.translation() + noise(random, kPositionSdM)),
               noise(random, kAttitudeSdDeg * kDegree));
    steps.push_back(std::move(step));
    if (steps.back().way_m >= settings.way_m) break;
  }
  return steps;
}

double pitch_deg(const Pose& pose) {
  return -std::asin(pose.rotation_matrix()(2, 0)) / kDegree;
}

// `match`: whether scans are matched at all; if not, the prior alone moves them.
void walk(const std::vector<Step>& steps, const char* name, bool match,
          const std::optional<PenaltyForm>& form, double scale) {
  IcpMatcherConfig config;
  config.map.epsilon_m = kEpsilonM;
  const auto builder = make_matcher(config)->make_builder({});
  Pose estimate = steps.front().truth;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const Step& step = steps[i];
    bool matched = false;
    if (i > 0) {
      estimate = estimate * step.increment;
      if (match) {
        PoseBelief belief;
        belief.target_from_source = step.believed;
        belief.position_covariance = kPositionSdM * kPositionSdM * Eigen::Matrix3d::Identity();
        belief.attitude_covariance =
            std::pow(kAttitudeSdDeg * kDegree, 2.0) * Eigen::Matrix3d::Identity();
        PoseTerms terms;
        if (form) terms.push_back(penalty_term(belief, *form, kArmM, scale));
        const RegistrationResult result =
            builder->snapshot()->match(step.points, estimate, terms, MatchStart::kNear);
        matched = result.usable();
        if (matched) estimate = result.target_from_source;
      }
    }
    if (match) builder->insert(step.points, estimate, kRadiusM);
    const double start = steps.front().truth.translation().z();
    std::printf("%s,%.2f,%.4f,%.4f,%.4f,%.4f,%d\n", name, step.way_m,
                estimate.translation().z() - start, pitch_deg(estimate),
                step.truth.translation().z() - start, pitch_deg(step.truth), matched ? 1 : 0);
  }
}

void run(const SiteConfig& config, const Settings& settings) {
  TestFrames site(config);
  const std::vector<Step> steps = steps_of(site, settings);
  std::printf("penalties,way_m,height_m,pitch_deg,true_height_m,true_pitch_deg,matched\n");
  walk(steps, "prior", false, std::nullopt, settings.scale);
  walk(steps, "none", true, std::nullopt, settings.scale);
  walk(steps, "one point", true, PenaltyForm::kOnePoint, settings.scale);
  walk(steps, "three points", true, PenaltyForm::kThreePoints, settings.scale);
}

}  // namespace
}  // namespace understory

int main(int argc, char** argv) {
  if (argc < 5) {
    std::fprintf(stderr, "usage: penalty_walk SEED WAY_M SCALE PRIOR_SD_DEG [key=value ...]\n");
    return 2;
  }
  try {
    std::vector<std::string> keys = {std::string("seed=") + argv[1]};
    keys.insert(keys.end(), argv + 5, argv + argc);
    const understory::Settings settings{std::strtoull(argv[1], nullptr, 10), std::atof(argv[2]),
                                        std::atof(argv[3]), std::atof(argv[4])};
    understory::with_threads(
        2, [&] { understory::run(understory::load_site("skidoo", keys), settings); });
  } catch (const understory::Error& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 3;
  }
  return 0;
}
