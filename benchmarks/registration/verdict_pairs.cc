// Matches pairs of scans as the command register does, and prints what its verdict says beside the
// truth, a line of JSON a match:
//   verdict_pairs FOLDER_A FOLDER_B METHOD STARTS [MOST_OFF_M [MOST_OFF_DEG [MOST_APART_M [SEED]]]]
// Folders as pair_scans writes them. Of one folder (A = B) each scan meets the later ones that are
// not farther apart. Of two, each scan meets all of the other place, and no answer is right. METHOD
// `global` begins at no guess. Any other one begins STARTS times a pair at a guess that is off at
// random. It is off by a shift in the plane up to MOST_OFF_M, and a fifth of it in height. The
// guess is turned by up to MOST_OFF_DEG.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "posed_scans.h"
#include "understory/preprocess/voxel_filter.h"
#include "understory/registration/global/global_match.h"
#include "understory/registration/global/match_verdict.h"
#include "understory/registration/two_clouds.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"
#include "understory/util/timing.h"

namespace understory {
namespace {

using benchmarks::for_each_posed_scan;
using benchmarks::overlap;

struct Options {
  std::string method;
  int starts = 1;
  double most_off_m = 1.0;
  double most_off_deg = 10.0;
  double most_apart_m = 25.0;
  std::uint64_t seed = 1;
};

struct Sample {
  SearchCloud cloud;
  MatchTargetPtr target;
  Points source;
  Pose world_from_cloud;
};

std::vector<Sample> load(const std::string& folder, const Options& options, Log& log) {
  std::vector<Sample> samples;
  VoxelFilter filter;
  for_each_posed_scan(folder, log, [&](const Points& points, const Pose& world_from_cloud) {
    Sample sample{prepare_search(points), nullptr, {}, world_from_cloud};
    if (options.method != "global") {
      const auto matcher = make_matcher(matchers_of_two_clouds(), options.method);
      sample.target = matcher->make_target(
          filter.filter(points, matcher->sums_up_points() ? kTargetVoxelM : kSourceVoxelM));
      sample.source = filter.filter(points, kSourceVoxelM);
    }
    samples.push_back(std::move(sample));
  });
  return samples;
}

Pose moved_at_random(const Pose& truth, const Options& options, Random& random) {
  const double way = options.most_off_m * std::sqrt(random.uniform());
  const double along = random.uniform(0.0, 2.0 * std::numbers::pi);
  const double turn = options.most_off_deg * std::numbers::pi / 180.0 * random.uniform(-1.0, 1.0);
  const double rise = 0.2 * options.most_off_m * random.uniform(-1.0, 1.0);
  return {
      Eigen::Quaterniond(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ())) * truth.rotation(),
      truth.translation() + Eigen::Vector3d(way * std::cos(along), way * std::sin(along), rise)};
}

double number_or_none(double value) {
  return std::isfinite(value) ? value : -1.0;
}

void print(std::size_t i, std::size_t j, double shared, double apart_m, const Pose& off,
           bool same_place, const GlobalRegistration& done, double ms) {
  const MatchVerdict& verdict = done.verdict;
  const PoseEvidence& e = verdict.evidence;
  const RegistrationResult& result = done.result;
  // In the frame of the source: degrees about x, y, z, then metres along them.
  Vector6d parts = off.log();
  parts.head<3>() *= 180.0 / std::numbers::pi;
  double sd_m = -1.0;
  double sd_deg = -1.0;
  if (result.information.trace() > 0.0 && result.degenerate_directions.cols() == 0) {
    const Matrix6d covariance = result.information.inverse();
    sd_deg = std::sqrt(covariance.topLeftCorner<3, 3>().trace()) * 180.0 / std::numbers::pi;
    sd_m = std::sqrt(covariance.bottomRightCorner<3, 3>().trace());
  }
  std::printf(
      "{\"i\": %zu, \"j\": %zu, \"overlap\": %.3f, \"apart_m\": %.2f, \"off_m\": %.4f, "
      "\"off_deg\": %.4f, \"off\": [%.4f, %.4f, %.4f, %.4f, %.4f, %.4f], \"open\": %td, "
      "\"trusted\": %d, \"chance\": %.4f, \"moved_m\": %.4f, \"moved_deg\": %.4f, \"near\": %.4f, "
      "\"through\": %.4f, \"fine\": %.4f, \"aside\": %.4f, \"matched\": %.0f, \"by_chance\": %.2f, "
      "\"score\": %.3f, \"rival\": %.3f, \"sd_m\": %.5f, \"sd_deg\": %.5f, \"inlier\": %.4f, "
      "\"surface\": %.6f, \"fitness\": %.5f, \"peak\": %.3f, \"looked\": %.1f, \"ms\": %.1f, "
      "\"reason\": \"%s\"}\n",
      i, j, shared, apart_m, same_place ? off.translation().norm() : 99.0,
      same_place ? off.angle() * 180.0 / std::numbers::pi : 180.0, parts[0], parts[1], parts[2],
      parts[3], parts[4], parts[5], result.degenerate_directions.cols(), verdict.trusted ? 1 : 0,
      verdict.chance, number_or_none(verdict.moved_m), number_or_none(verdict.moved_deg), e.near,
      e.seen_through, e.fine, e.fine_aside, e.matched, e.by_chance, verdict.score,
      verdict.rival ? verdict.rival->score : -9.0, number_or_none(sd_m), number_or_none(sd_deg),
      result.inlier_ratio, result.surface_residual_m2, result.fitness_m2, e.peak_off_m, e.looked_at,
      ms, verdict.reason.c_str());
}

void match(const Sample& a, const Sample& b, bool same_place, std::size_t i, std::size_t j,
           const Options& options) {
  const Pose truth = a.world_from_cloud.inverse() * b.world_from_cloud;
  const double shared =
      same_place ? overlap(a.cloud, b.cloud,
                           a.cloud.level_from_cloud * truth * b.cloud.level_from_cloud.inverse())
                 : 0.0;
  const double apart = same_place ? truth.translation().norm() : -1.0;
  Random random(options.seed + 1000 * i + j);
  std::vector<GlobalCandidate> found;
  const bool global = options.method == "global";
  if (!global && a.cloud.trouble.empty() && b.cloud.trouble.empty())
    found = search_poses(a.cloud, b.cloud);
  for (int start = 0; start < (global ? 1 : options.starts); ++start) {
    const double begin = process_cpu_seconds();
    GlobalRegistration done;
    if (global) {
      done = register_globally(a.cloud, b.cloud);
    } else {
      const Pose guess = moved_at_random(same_place ? truth : Pose(), options, random);
      done = match_and_judge(
          a.cloud, b.cloud, guess,
          [&](const Pose& from, const PoseTerms& terms) {
            return a.target->match(b.source, from, terms, MatchStart::kFar);
          },
          found);
    }
    const double ms = 1e3 * (process_cpu_seconds() - begin);
    print(i, j, shared, apart, truth.inverse() * done.result.target_from_source, same_place, done,
          ms);
  }
}

void run(const std::string& first, const std::string& second, const Options& options) {
  Log log;
  const std::vector<Sample> a = load(first, options, log);
  const bool same = first == second;
  const std::vector<Sample> other = same ? std::vector<Sample>() : load(second, options, log);
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = same ? i + 1 : 0; j < (same ? a.size() : other.size()); ++j) {
      const Sample& b = same ? a[j] : other[j];
      const Pose between = a[i].world_from_cloud.inverse() * b.world_from_cloud;
      if (same && between.translation().norm() > options.most_apart_m) continue;
      match(a[i], b, same, i, j, options);
    }
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace understory

int main(int argc, char** argv) {
  if (argc < 5) {
    std::fprintf(stderr,
                 "usage: verdict_pairs FOLDER_A FOLDER_B METHOD STARTS [MOST_OFF_M [MOST_OFF_DEG "
                 "[MOST_APART_M [SEED]]]]\n");
    return 2;
  }
  try {
    understory::Options options;
    options.method = argv[3];
    options.starts = std::atoi(argv[4]);
    if (argc > 5) options.most_off_m = std::atof(argv[5]);
    if (argc > 6) options.most_off_deg = std::atof(argv[6]);
    if (argc > 7) options.most_apart_m = std::atof(argv[7]);
    if (argc > 8) options.seed = std::strtoull(argv[8], nullptr, 10);
    understory::with_threads(1, [&] { understory::run(argv[1], argv[2], options); });
  } catch (const understory::Error& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 3;
  }
  return 0;
}
