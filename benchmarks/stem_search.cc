// Where ICP of stems converges (P0 figure 6) and what Go-ICP's search costs (P0 table 3), on
// made-up stands as dense as the paper's: 130 stems within 35 m, seen twice with 10 cm of noise, a
// fifth of them missed each time. One thread. Prints one JSON object.
//   stem_search convergence STANDS
//   stem_search boxes STANDS
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <numbers>
#include <string>
#include <vector>

#include "understory/registration/go_icp.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kRadius = 35.0;
constexpr int kSteps = 15;  // of shift and of yaw, up to 1.4 times the region's

struct Pair {
  SparsePoints target;
  SparsePoints source;
  Pose target_from_source;
};

Pose in_plane(double yaw, double x, double y) {
  return Pose(Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())),
              Eigen::Vector3d(x, y, 0.0));
}

Pair make_pair(std::uint64_t seed) {
  Random random(seed);
  Pair pair;
  pair.target_from_source =
      in_plane(random.uniform(-0.3, 0.3), random.uniform(-1.5, 1.5), random.uniform(-1.5, 1.5));
  const Pose source_from_target = pair.target_from_source.inverse();
  SparsePoints stems;
  while (stems.size() < 160) {
    const Eigen::Vector3d at(random.uniform(-kRadius, kRadius), random.uniform(-kRadius, kRadius),
                             0.0);
    bool free = at.norm() < kRadius;
    for (const Eigen::Vector3d& other : stems)
      free = free && (other - at).norm() > 1.5;
    if (!free) continue;
    stems.push_back(at);
    const auto noise = [&] {
      return Eigen::Vector3d(0.1 * random.normal(), 0.1 * random.normal(), 0.1 * random.normal());
    };
    if (!random.chance(0.2)) pair.target.push_back(at + noise());
    if (!random.chance(0.2)) pair.source.push_back(source_from_target * (at + noise()));
  }
  return pair;
}

double cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

bool is_right(const Pose& found, const Pair& pair) {
  const Pose error = pair.target_from_source.inverse() * found;
  return error.translation().head<2>().norm() < 0.2 && error.angle() < 1.0 * kDegree;
}

// Share of starts that come home, by shift and yaw in units of delta0 and theta0.
void convergence(int stands) {
  std::vector<int> home(kSteps * kSteps, 0);
  SparseIcpConfig config;
  config.metric = SparseIcpConfig::Metric::kPlane;
  double delta0 = 0.0;
  double theta0 = 0.0;
  for (int k = 0; k < stands; ++k) {
    const Pair pair = make_pair(static_cast<std::uint64_t>(k) + 1);
    const SparseTarget target(pair.target);
    const ConvergenceRegion region = convergence_region(target.l0_m, kRadius, config.outlier_ratio);
    delta0 += region.delta0_m / stands;
    theta0 += region.theta0_rad / stands;
    Random random(static_cast<std::uint64_t>(k) + 1, 1);
    for (int a = 0; a < kSteps; ++a) {
      for (int b = 0; b < kSteps; ++b) {
        const double direction = random.uniform(0.0, 2.0 * std::numbers::pi);
        const double shift = 0.1 * a * region.delta0_m;
        const double yaw = (random.chance(0.5) ? 0.1 : -0.1) * b * region.theta0_rad;
        const Pose start = pair.target_from_source *
                           in_plane(yaw, shift * std::cos(direction), shift * std::sin(direction));
        const SparseIcpResult found = register_sparse_icp(target, pair.source, start, config);
        if (is_right(found.target_from_source, pair))
          ++home[static_cast<std::size_t>(a * kSteps + b)];
      }
    }
  }
  fmt::print("{{\"stands\": {}, \"delta0_m\": {:.3f}, \"theta0_deg\": {:.3f}, \"share\": [", stands,
             delta0, theta0 / kDegree);
  for (int a = 0; a < kSteps; ++a) {
    fmt::print("{}[", a == 0 ? "" : ", ");
    for (int b = 0; b < kSteps; ++b)
      fmt::print("{}{:.3f}", b == 0 ? "" : ", ",
                 static_cast<double>(home[static_cast<std::size_t>(a * kSteps + b)]) / stands);
    fmt::print("]");
  }
  fmt::print("]}}\n");
}

void search(const char* name, const GoIcpConfig& config, int stands, bool last) {
  double cells = 0.0;
  double nodes = 0.0;
  double ms = 0.0;
  int right = 0;
  for (int k = 0; k < stands; ++k) {
    const Pair pair = make_pair(static_cast<std::uint64_t>(k) + 1);
    const double begin = cpu_ms();
    const SparseTarget target(pair.target);
    const GoIcpResult found = register_go_icp(target, pair.source, Pose(), config);
    ms += (cpu_ms() - begin) / stands;
    cells += found.cells / stands;
    nodes += static_cast<double>(found.nodes) / stands;
    right += is_right(found.target_from_source, pair) ? 1 : 0;
  }
  fmt::print("\"{}\": {{\"cells\": {:.0f}, \"nodes\": {:.0f}, \"ms\": {:.3f}, \"right\": {}}}{}",
             name, cells, nodes, ms, right, last ? "}\n" : ", ");
}

// The paper's two rows, the first with cubes as in the original Go-ICP, and ours.
void boxes(int stands) {
  GoIcpConfig config;
  config.mode = GoIcpConfig::Mode::kPaper;
  config.boxes = GoIcpConfig::Boxes::kCubes;
  config.finest_yaw_deg = 1.0;
  config.finest_shift_m = 1.2;
  fmt::print("{{\"stands\": {}, ", stands);
  search("general", config, stands, false);
  config.yaw_range_deg = 60.0;
  config.finest_yaw_deg = config.finest_shift_m = 0.0;
  search("uniform", config, stands, false);
  config.boxes = GoIcpConfig::Boxes::kElongated;
  search("elongated", config, stands, false);
  config.mode = GoIcpConfig::Mode::kCertified;
  config.boxes = GoIcpConfig::Boxes::kCubes;
  search("certified_cubes", config, stands, false);
  config.boxes = GoIcpConfig::Boxes::kElongated;
  search("certified", config, stands, true);
}

}  // namespace
}  // namespace understory

int main(int count, char** argument) {
  const std::string what = count == 3 ? argument[1] : "";
  if (what != "convergence" && what != "boxes") {
    std::fputs("stem_search convergence|boxes STANDS\n", stderr);
    return 2;
  }
  understory::with_threads(1, [&] {
    what == "boxes" ? understory::boxes(std::atoi(argument[2]))
                    : understory::convergence(std::atoi(argument[2]));
  });
  return 0;
}
