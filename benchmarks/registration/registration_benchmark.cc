// registration_benchmark A B ROUNDS: CPU milliseconds of each step of matching cloud B to cloud A
// on one thread, best of the rounds, as JSON. Run by registration_speed.py beside a peer.
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "understory/preprocess/voxel_filter.h"
#include "understory/recording/clouds/cloud_file.h"
#include "understory/registration/matchers.h"
#include "understory/registration/ndt/ndt.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"
#include "understory/util/timing.h"

namespace understory {
namespace {

double best_ms(int rounds, const std::function<void()>& work) {
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < rounds; ++i) {
    const double start = process_cpu_seconds();
    work();
    best = std::min(best, 1e3 * (process_cpu_seconds() - start));
  }
  return best;
}

struct MapAndMatch {
  double map_ms = 0.0;
  double match_ms = 0.0;
};

// Both clouds thinned by 0.25 m, as the peer has them.
MapAndMatch by_method(const std::string& name, const Points& target, const Points& source,
                      int rounds) {
  VoxelFilter filter;
  const Points target_thin = filter.filter(target, 0.25);
  const Points source_thin = filter.filter(source, 0.25);
  const auto matcher = make_matcher(MatcherConfig(), name);
  MatchTargetPtr map;
  MapAndMatch best;
  best.map_ms = best_ms(rounds, [&] { map = matcher->make_target(target_thin); });
  RegistrationResult result;
  best.match_ms =
      best_ms(rounds, [&] { result = map->match(source_thin, Pose(), {}, MatchStart::kFar); });
  return best;
}

void run(const std::string& target_file, const std::string& source_file, int rounds) {
  Log log;
  const Points target = read_cloud(target_file, log).points;
  const Points source = read_cloud(source_file, log).points;
  VoxelFilter filter;
  Points target_thin;
  Points source_thin;
  NdtMapPtr map;
  RegistrationResult result;
  const double thin_ms = best_ms(rounds, [&] {
    target_thin = filter.filter(target, 0.1);
    source_thin = filter.filter(source, 0.25);
  });
  const double map_ms = best_ms(rounds, [&] {
    const PlacedCloud cloud{&target_thin, Pose()};
    map = build_ndt_map({&cloud, 1}, {});
  });
  const double ndt_ms =
      best_ms(rounds, [&] { result = register_ndt(*map, source_thin, Pose(), {}, {}); });
  const auto [gicp_map_ms, gicp_ms] = by_method("gicp", target, source, rounds);
  const auto [vgicp_map_ms, vgicp_ms] = by_method("vgicp", target, source, rounds);
  const Eigen::Vector3d& t = result.target_from_source.translation();
  std::printf(
      "{\"points\": [%zu, %zu], \"thinned\": [%zu, %zu], \"thin_ms\": %.3f, \"map_ms\": %.3f, "
      "\"ndt_ms\": %.3f, \"gicp_map_ms\": %.3f, \"gicp_ms\": %.3f, \"vgicp_map_ms\": %.3f, "
      "\"vgicp_ms\": %.3f, \"iterations\": %d, \"translation_m\": [%.4f, %.4f, %.4f]}\n",
      target.size(), source.size(), target_thin.size(), source_thin.size(), thin_ms, map_ms, ndt_ms,
      gicp_map_ms, gicp_ms, vgicp_map_ms, vgicp_ms, result.iterations, t.x(), t.y(), t.z());
}

}  // namespace
}  // namespace understory

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: registration_benchmark A B ROUNDS\n");
    return 2;
  }
  try {
    understory::with_threads(
        1, [&] { understory::run(argv[1], argv[2], std::max(1, std::atoi(argv[3]))); });
  } catch (const understory::Error& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 3;
  }
  return 0;
}
