// Go-ICP and ICP on neighbouring views of a recording of stems: times, and how many pairs come out
// right.
//   stem_pairs STEMS.csv.gz TRAJECTORY.tum MODE YAW_DEG SHIFT_M STRIDE
// MODE is certified, paper, or icp: trimmed ICP from the same wrong guess. The 130 stems of best
// score of each view; every STRIDE-th pair. The middle of the search is wrong by up to half its
// reach where that is less than a full turn. Else it is no turn and no shift. One thread. Prints
// one JSON object; `target_ms` is the part of the mean that prepares the target, which odometry
// does once for several views.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <map>
#include <string>
#include <vector>

#include "understory/evaluation/trajectory.h"
#include "understory/odometry/stems/stem_levelling.h"
#include "understory/recording/clouds/stems_file.h"
#include "understory/registration/stems/go_icp.h"
#include "understory/util/log.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

constexpr std::size_t kStems = 130;

StemView best_of(StemView view) {
  sort_stably(view.stems, [](const Stem& a, const Stem& b) { return a.score > b.score; });
  view.stems.resize(std::min(view.stems.size(), kStems));
  return view;
}

// Processor time of this thread: what else the machine does does not count.
double cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

struct Options {
  GoIcpConfig go_icp;
  bool icp = false;
  std::size_t stride = 8;
};

struct Outcome {
  std::vector<double> ms;
  double target_ms = 0.0;
  int right = 0;
};

Outcome measure(const std::vector<StemView>& views, const std::map<TimeNs, Pose>& truth,
                const Options& options) {
  Outcome outcome;
  Random random(1);
  const bool around_guess = options.go_icp.yaw_range_deg < 180.0;
  for (std::size_t i = 1; i < views.size(); i += options.stride) {
    const StemView a = best_of(views[i - 1]);
    const StemView b = best_of(views[i]);
    const Pose level_a(level_from_body(stem_up(a, Eigen::Vector3d::UnitZ())),
                       Eigen::Vector3d::Zero());
    const Pose level_b(level_from_body(stem_up(b, Eigen::Vector3d::UnitZ())),
                       Eigen::Vector3d::Zero());
    const Pose right =
        level_a * truth.at(a.stamp).inverse() * truth.at(b.stamp) * level_b.inverse();
    Pose guess;
    if (around_guess) {
      const Eigen::Vector3d x = right.rotation() * Eigen::Vector3d::UnitX();
      const double yaw = std::atan2(x.y(), x.x()) +
                         options.go_icp.yaw_range_deg * M_PI / 180.0 * random.uniform(-0.5, 0.5);
      const double reach = options.go_icp.shift_range_m;
      guess = Pose(Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())),
                   right.translation() + reach * Eigen::Vector3d(random.uniform(-0.5, 0.5),
                                                                 random.uniform(-0.5, 0.5), 0.0));
    }
    const SparsePoints source = stem_points(b, level_b.rotation());
    const double begin = cpu_ms();
    const SparseTarget target(stem_points(a, level_a.rotation()));
    outcome.target_ms += cpu_ms() - begin;
    const Pose found =
        options.icp ? register_sparse_icp(target, source, guess, {}).target_from_source
                    : register_go_icp(target, source, guess, options.go_icp).target_from_source;
    outcome.ms.push_back(cpu_ms() - begin);
    const Pose error = right.inverse() * found;
    const Eigen::Vector3d turned = error.rotation() * Eigen::Vector3d::UnitX();
    const double yaw_deg = std::abs(std::atan2(turned.y(), turned.x())) * 180.0 / M_PI;
    outcome.right += error.translation().head<2>().norm() < 0.5 && yaw_deg < 1.0 ? 1 : 0;
  }
  return outcome;
}

int run(char** argument) {
  Options options;
  const bool paper = std::string(argument[3]) == "paper";
  options.go_icp.mode = paper ? GoIcpConfig::Mode::kPaper : GoIcpConfig::Mode::kCertified;
  options.go_icp.yaw_range_deg = std::atof(argument[4]);
  options.go_icp.shift_range_m = std::atof(argument[5]);
  options.icp = std::string(argument[3]) == "icp";
  options.stride = static_cast<std::size_t>(std::atoi(argument[6]));
  Log log;
  const std::vector<StemView> views = read_stem_views(argument[1], log);
  std::map<TimeNs, Pose> truth;
  for (const StampedPose& pose : read_trajectory(argument[2]))
    truth[pose.stamp] = pose.world_from_body;
  Outcome outcome;
  with_threads(1, [&] { outcome = measure(views, truth, options); });
  std::sort(outcome.ms.begin(), outcome.ms.end());
  double sum = 0.0;
  for (const double ms : outcome.ms)
    sum += ms;
  const std::size_t n = outcome.ms.size();
  fmt::print(
      "{{\"pairs\": {}, \"right\": {}, \"mean_ms\": {:.3f}, \"p50_ms\": {:.3f}, "
      "\"p99_ms\": {:.3f}, \"target_ms\": {:.3f}}}\n",
      n, outcome.right, sum / static_cast<double>(n), outcome.ms[n / 2], outcome.ms[n * 99 / 100],
      outcome.target_ms / static_cast<double>(n));
  return 0;
}

}  // namespace
}  // namespace understory

int main(int count, char** argument) {
  if (count != 7) {
    std::fputs(
        "stem_pairs STEMS.csv.gz TRAJECTORY.tum certified|paper|icp YAW_DEG SHIFT_M STRIDE\n",
        stderr);
    return 2;
  }
  return understory::run(argument);
}
