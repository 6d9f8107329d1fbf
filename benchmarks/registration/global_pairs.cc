// Matches scans without a guess and prints what came of it, a line of JSON a pair:
//   global_pairs FOLDER_A FOLDER_B [MOST_M [MOST_PAIRS]]
// Folders as pair_scans writes them. Of one folder (A = B) all pairs not farther apart than MOST_M
// are matched. Of two, every scan of A with one of B: they show different places.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "posed_scans.h"
#include "understory/registration/global/global_match.h"
#include "understory/registration/global/match_verdict.h"
#include "understory/registration/global/pose_evidence.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"
#include "understory/util/timing.h"

namespace understory {
namespace {

using benchmarks::for_each_posed_scan;
using benchmarks::overlap;

struct Sample {
  SearchCloud cloud;
  Pose world_from_cloud;
  double prepare_ms = 0.0;
};

std::vector<Sample> load(const std::string& folder, Log& log) {
  std::vector<Sample> samples;
  for_each_posed_scan(folder, log, [&](const Points& points, const Pose& world_from_cloud) {
    const double start = process_cpu_seconds();
    Sample sample{prepare_search(points), world_from_cloud};
    sample.prepare_ms = 1e3 * (process_cpu_seconds() - start);
    samples.push_back(std::move(sample));
  });
  return samples;
}

void match(const Sample& a, const Sample& b, bool same_place, std::size_t i, std::size_t j) {
  const Pose truth = a.cloud.level_from_cloud * a.world_from_cloud.inverse() * b.world_from_cloud *
                     b.cloud.level_from_cloud.inverse();
  double start = process_cpu_seconds();
  std::vector<GlobalCandidate> found = search_poses(a.cloud, b.cloud);
  if (!found.empty()) {
    const RegistrationResult last = last_steps(a.cloud, b.cloud, found.front());
    if (last.usable()) found.front().target_from_source = last.target_from_source;
  }
  const double ms = 1e3 * (process_cpu_seconds() - start);
  std::printf(
      "{\"i\": %zu, \"j\": %zu, \"overlap\": %.3f, \"distance_m\": %.2f, \"uprights\": [%zu, %zu], "
      "\"prepare_ms\": %.1f, \"search_ms\": %.1f, \"poses\": [",
      i, j, same_place ? overlap(a.cloud, b.cloud, truth) : 0.0,
      same_place ? truth.translation().norm() : -1.0, a.cloud.uprights.size(),
      b.cloud.uprights.size(), a.prepare_ms + b.prepare_ms, ms);
  start = process_cpu_seconds();
  const auto print = [&](const Pose& pose, const char* how, double score, double rival) {
    const Pose off = truth.inverse() * pose;
    const PoseEvidence e = weigh_pose(a.cloud, b.cloud, pose);
    std::printf(
        "{\"how\": \"%s\", \"off_m\": %.3f, \"off_deg\": %.3f, \"score\": %.4f, "
        "\"rival\": %.4f, \"near\": %.4f, \"through\": %.4f, \"looked\": %.1f, "
        "\"fine\": %.4f, \"aside\": %.4f, \"peak\": %.3f, \"matched\": %.0f, "
        "\"chance\": %.2f, \"right\": %.4f}",
        how, same_place ? off.translation().norm() : 99.0, off.angle() * 180.0 / std::numbers::pi,
        score, rival, e.near, e.seen_through, e.looked_at, e.fine, e.fine_aside, e.peak_off_m,
        e.matched, e.by_chance,
        chance_of_right(e, score, rival != score ? std::optional(rival) : std::nullopt,
                        sparse_views(a.cloud, b.cloud)));
  };
  for (std::size_t k = 0; k < found.size(); ++k) {
    if (k > 0) std::printf(", ");
    print(found[k].target_from_source, k == 0 ? "best" : "rival", found[k].score,
          found[k == 0 && found.size() > 1 ? 1 : 0].score);
  }
  std::printf("], \"weigh_ms\": %.1f", 1e3 * (process_cpu_seconds() - start));
  std::printf("}\n");
}

void run(const std::string& first, const std::string& second, double same_place_m) {
  Log log;
  const std::vector<Sample> a = load(first, log);
  const bool same = first == second;
  const std::vector<Sample> other = same ? std::vector<Sample>() : load(second, log);
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = same ? i + 1 : 0; j < (same ? a.size() : other.size()); ++j) {
      const Sample& b = same ? a[j] : other[j];
      const Pose between = a[i].world_from_cloud.inverse() * b.world_from_cloud;
      if (same ? between.translation().norm() > same_place_m : i != j) continue;
      match(a[i], b, same, i, j);
    }
  }
}

}  // namespace
}  // namespace understory

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: global_pairs FOLDER_A FOLDER_B [MOST_M]\n");
    return 2;
  }
  try {
    understory::with_threads(
        1, [&] { understory::run(argv[1], argv[2], argc > 3 ? std::atof(argv[3]) : 25.0); });
  } catch (const understory::Error& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 3;
  }
  return 0;
}
