// Where ICP of stems converges (P0 figure 6) and what Go-ICP's search costs (P0 table 3), on
// made-up stands as dense as the paper's. 130 stems within 35 m are seen twice with 10 cm of noise,
// on ground that rolls by half a metre. A fifth of them is missed each time. One thread. Prints one
// JSON object.
//   stem_search convergence STANDS   shift and yaw, ICP in the plane
//   stem_search tilt STANDS          shift and tilt, ICP in space
//   stem_search boxes STANDS         search over yaw and the plane
//   stem_search space STANDS         search over all six degrees of freedom
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <numbers>
#include <string>
#include <vector>

#include "understory/registration/stems/go_icp.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kRadius = 35.0;
constexpr double kLean = 8.0 * kDegree;  // of the source, in the searches in space
constexpr double kTiltReach = 3.0;       // the pictured tilts go farther than phi0
constexpr int kSteps = 15;  // of shift and of yaw or tilt, up to 1.4 times the region's

struct Pair {
  SparsePoints target;
  SparsePoints source;
  Pose target_from_source;
};

Pose in_plane(double yaw, double x, double y) {
  return Pose(Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())),
              Eigen::Vector3d(x, y, 0.0));
}

// A turn by `angle` about a level axis in a direction of the plane.
Pose tilted(double angle, double direction) {
  const Eigen::Vector3d axis(std::cos(direction), std::sin(direction), 0.0);
  return Pose(Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis)), Eigen::Vector3d::Zero());
}

// The source leans by up to `tilt` and stands up to half a metre higher or lower, where `tilt` is
// not 0.
Pair make_pair(std::uint64_t seed, double tilt = 0.0) {
  Random random(seed);
  Pair pair;
  pair.target_from_source =
      in_plane(random.uniform(-0.3, 0.3), random.uniform(-1.5, 1.5), random.uniform(-1.5, 1.5));
  if (tilt > 0.0) {
    const Pose up(Eigen::Quaterniond::Identity(), {0.0, 0.0, random.uniform(-0.5, 0.5)});
    pair.target_from_source =
        up * pair.target_from_source *
        tilted(random.uniform(0.0, tilt), random.uniform(0.0, 2.0 * std::numbers::pi));
  }
  const Pose source_from_target = pair.target_from_source.inverse();
  SparsePoints stems;
  while (stems.size() < 160) {
    const double x = random.uniform(-kRadius, kRadius);
    const double y = random.uniform(-kRadius, kRadius);
    const Eigen::Vector3d at(x, y, 0.5 * std::sin(x / 7.0) * std::cos(y / 9.0));
    bool free = at.head<2>().norm() < kRadius;
    for (const Eigen::Vector3d& other : stems)
      free = free && (other - at).head<2>().norm() > 1.5;
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

// Share of starts that come home, by shift and yaw (or tilt) in units of delta0 and theta0 (phi0).
void convergence(int stands, bool tilt) {
  std::vector<int> home(kSteps * kSteps, 0);
  SparseIcpConfig config;
  config.metric = tilt ? SparseIcpConfig::Metric::kSpace : SparseIcpConfig::Metric::kPlane;
  config.refine = tilt;
  double delta0 = 0.0;
  double largest = 0.0;
  for (int k = 0; k < stands; ++k) {
    const Pair pair = make_pair(static_cast<std::uint64_t>(k) + 1);
    const SparseTarget target(pair.target);
    const ConvergenceRegion region = convergence_region(target.l0_m, kRadius, config.outlier_ratio);
    delta0 += region.delta0_m / stands;
    const double limit = tilt ? kTiltReach * region.phi0_rad : region.theta0_rad;
    largest += limit / stands;
    Random random(static_cast<std::uint64_t>(k) + 1, 1);
    for (int a = 0; a < kSteps; ++a) {
      for (int b = 0; b < kSteps; ++b) {
        const double direction = random.uniform(0.0, 2.0 * std::numbers::pi);
        const double shift = 0.1 * a * region.delta0_m;
        const double turn = (random.chance(0.5) ? 0.1 : -0.1) * b * limit;
        const double x = shift * std::cos(direction);
        const double y = shift * std::sin(direction);
        const Pose away =
            tilt ? in_plane(0.0, x, y) * tilted(turn, random.uniform(0.0, std::numbers::pi))
                 : in_plane(turn, x, y);
        const Pose start = pair.target_from_source * away;
        const SparseIcpResult found = register_sparse_icp(target, pair.source, start, config);
        if (is_right(found.target_from_source, pair))
          ++home[static_cast<std::size_t>(a * kSteps + b)];
      }
    }
  }
  fmt::print("{{\"stands\": {}, \"delta0_m\": {:.3f}, \"turn_deg\": {:.3f}, \"share\": [", stands,
             delta0, largest / kDegree);
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
    const bool space = config.motion == GoIcpConfig::Motion::kSpace;
    const Pair pair = make_pair(static_cast<std::uint64_t>(k) + 1, space ? kLean : 0.0);
    const double begin = cpu_ms();
    const SparseTarget target(pair.target);
    const GoIcpResult found = register_go_icp(target, pair.source, Pose(), config);
    ms += (cpu_ms() - begin) / stands;
    cells += found.cells / stands;
    nodes += static_cast<double>(found.nodes) / stands;
    right += is_right(found.target_from_source, pair) ? 1 : 0;
  }
  fmt::print(
      "\"{}\": {{\"cells\": {:.0f}, \"nodes\": {:.0f}, \"ms\": {:.3f}, \"right\": {}, "
      "\"stands\": {}}}{}",
      name, cells, nodes, ms, right, stands, last ? "}\n" : ", ");
}

// The paper's two rows, the first with cubes as in the original Go-ICP, and ours.
void boxes(int stands) {
  GoIcpConfig config;
  config.mode = GoIcpConfig::Mode::kPaper;
  config.boxes = GoIcpConfig::Boxes::kCubes;
  config.finest_yaw_deg = 1.0;
  config.finest_shift_m = 1.2;
  fmt::print("{{");
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

// The same with tilt and height, P0 table 3 as printed: 10 x 10 x 2 m. The first row, whose boxes
// nobody has the time for, is given up at once and gives its cells.
void space(int stands) {
  constexpr int kManyStands = 40;
  GoIcpConfig config;
  config.motion = GoIcpConfig::Motion::kSpace;
  config.mode = GoIcpConfig::Mode::kPaper;
  config.boxes = GoIcpConfig::Boxes::kCubes;
  config.tilt_range_deg = 90.0;
  config.finest_yaw_deg = config.finest_tilt_deg = 1.0;
  config.finest_shift_m = 1.2;
  config.max_nodes = 1;
  fmt::print("{{");
  search("general", config, stands, false);
  config.max_nodes = 20'000'000;
  config.tilt_range_deg = 30.0;
  config.finest_yaw_deg = config.finest_tilt_deg = config.finest_shift_m = 0.0;
  search("uniform", config, stands, false);
  config.boxes = GoIcpConfig::Boxes::kElongated;
  search("elongated", config, stands, false);
  config.yaw_range_deg = 15.0;
  config.shift_range_m = 2.0;
  config.tilt_range_deg = 10.0;
  search("near", config, kManyStands, false);
  config.mode = GoIcpConfig::Mode::kCertified;
  config.gap_m = 0.1;
  search("certified", config, kManyStands, true);
}

}  // namespace
}  // namespace understory

int main(int count, char** argument) {
  const std::string what = count == 3 ? argument[1] : "";
  const bool known = what == "convergence" || what == "tilt" || what == "boxes" || what == "space";
  if (!known) {
    std::fputs("stem_search convergence|tilt|boxes|space STANDS\n", stderr);
    return 2;
  }
  const int stands = std::atoi(argument[2]);
  understory::with_threads(1, [&] {
    if (what == "boxes")
      understory::boxes(stands);
    else if (what == "space")
      understory::space(stands);
    else
      understory::convergence(stands, what == "tilt");
  });
  return 0;
}
