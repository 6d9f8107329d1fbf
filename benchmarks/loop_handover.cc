// How long a loop takes that joins many: loop_handover [LOOPS] [ROUND_M] [full]. A walk of rounds
// on one circle, a loop from each metre after the first round to the round before, made by hand (no
// lidar). Prints the CPU time in which one more loop is compared with all, and that in which the
// graph is optimised with it. `full`: also how the result differs from graduated non-convexity that
// begins anew.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "understory/geometry/pose.h"
#include "understory/graph/loops/loop_agreement.h"
#include "understory/graph/pose_graph.h"
#include "understory/util/random.h"
#include "understory/util/timing.h"

namespace {

using namespace understory;

// Of the process: other work on the machine does not count.
double cpu_ms() {
  return 1e3 * process_cpu_seconds();
}

Pose on_circle(int k, int round) {
  const double angle = 2.0 * std::numbers::pi * k / round;
  const double radius = round / (2.0 * std::numbers::pi);
  return {so3_exp({0.0, 0.0, angle}),
          Eigen::Vector3d(radius * std::sin(angle), -radius * std::cos(angle), 0.0)};
}

PoseEdge edge(int from, int to, int round, double sd, Random& random) {
  Vector6d noise;
  for (Eigen::Index i = 0; i < 6; ++i)
    noise[i] = (i < 3 ? 0.1 : 1.0) * sd * random.normal();
  Vector6d variances;
  variances << Eigen::Vector3d::Constant(0.01 * sd * sd), Eigen::Vector3d::Constant(sd * sd);
  return {from, to, on_circle(from, round).inverse() * on_circle(to, round) * Pose::exp(noise),
          variances.asDiagonal()};
}

// Each loop that is not used costs what one at the edge of the truncation does.
double truncated_cost(const PoseGraphResult& result) {
  const auto left_out = std::count(result.loop_used.begin(), result.loop_used.end(), 0);
  return result.final_cost +
         0.5 * chi_squared_6(PoseGraphConfig().inlier_probability) * static_cast<double>(left_out);
}

// A walk of rounds whose graph grows loop by loop.
class Walk {
 public:
  explicit Walk(int round) : round_(round) {
    problem_.world_from_keyframe.push_back(on_circle(0, round));
  }

  // One keyframe more, with its loop after the first round.
  void step() {
    const int k = static_cast<int>(problem_.world_from_keyframe.size());
    problem_.odometry.push_back(edge(k - 1, k, round_, 0.005, random_));
    problem_.world_from_keyframe.push_back(problem_.world_from_keyframe.back() *
                                           problem_.odometry.back().from_from_to);
    if (k > round_) problem_.loops.push_back(edge(k - round_, k, round_, 0.02, random_));
  }

  // As a search does with its loops. False where the solution does not converge.
  bool hand_over() {
    PoseGraphResult result = optimise_pose_graph(problem_, config_, &agreement_, decided_);
    if (!result.converged) return false;
    problem_.world_from_keyframe = std::move(result.world_from_keyframe);
    decided_ = std::move(result.loop_used);
    return true;
  }

  void compare() { agreement_.update(problem_); }

  // Beside graduated non-convexity in full: loops that are used by only one of both, and the
  // largest distance between the poses, metres.
  void tell_of_full() const {
    const double begin = cpu_ms();
    const PoseGraphResult full = optimise_pose_graph(problem_, config_);
    std::size_t differ = 0;
    for (std::size_t i = 0; i < decided_.size(); ++i)
      differ += full.loop_used[i] != decided_[i] ? 1 : 0;
    double apart = 0.0;
    for (std::size_t k = 0; k < problem_.world_from_keyframe.size(); ++k) {
      apart = std::max(apart, (full.world_from_keyframe[k].translation() -
                               problem_.world_from_keyframe[k].translation())
                                  .norm());
    }
    std::printf("in full: %.1f s; %td loops used, %zu decided otherwise, poses %.2g m apart\n",
                1e-3 * (cpu_ms() - begin),
                std::count(full.loop_used.begin(), full.loop_used.end(), 1), differ, apart);
    const PoseGraphResult kept = optimise_pose_graph(problem_, config_, nullptr, decided_);
    std::printf("truncated cost: %.3f, in full %.3f\n", truncated_cost(kept), truncated_cost(full));
  }

  [[nodiscard]] std::size_t keyframes() const { return problem_.world_from_keyframe.size(); }
  [[nodiscard]] std::size_t loops() const { return problem_.loops.size(); }

 private:
  int round_;
  Random random_{1};
  PoseGraphConfig config_;
  PoseGraphProblem problem_;
  LoopAgreement agreement_{config_};
  std::vector<char> decided_;
};

}  // namespace

int main(int argc, char** argv) {
  const auto loops = static_cast<std::size_t>(argc > 1 ? std::atoi(argv[1]) : 10'000);
  const int round = argc > 2 ? std::atoi(argv[2]) : 200;
  const bool in_full = argc > 3;
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  Walk walk(round);
  const double begin = cpu_ms();
  bool good = true;
  while (walk.loops() < loops) {
    walk.step();
    const std::size_t together = walk.loops() < 1'000 ? 100 : 500;
    if (walk.loops() > 0 && walk.loops() % together == 0) good = walk.hand_over() && good;
  }
  std::printf("%zu loops, %zu keyframes, handed over by 100 and 500: %.1f s\n", walk.loops(),
              walk.keyframes(), 1e-3 * (cpu_ms() - begin));
  for (int more = 0; more < 5; ++more) {
    walk.step();
    const double compare = cpu_ms();
    walk.compare();
    const double optimise = cpu_ms();
    good = walk.hand_over() && good;
    std::printf("one more: compared in %.0f ms, optimised in %.0f ms%s\n", optimise - compare,
                cpu_ms() - optimise, good ? "" : " (not converged)");
  }
  if (in_full) walk.tell_of_full();
  return good ? EXIT_SUCCESS : EXIT_FAILURE;
}
