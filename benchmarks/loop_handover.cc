// How long a loop takes that joins many: loop_handover [LOOPS] [ROUND_M]. A walk of rounds on
// one circle, a loop from each metre after the first round to the round before, made by hand (no
// lidar). Prints the CPU time in which one more loop is compared with all, and that in which the
// graph is optimised with it.
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <numbers>

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

}  // namespace

int main(int argc, char** argv) {
  const int loops = argc > 1 ? std::atoi(argv[1]) : 10'000;
  const int round = argc > 2 ? std::atoi(argv[2]) : 200;
  Random random(1);
  PoseGraphProblem problem;
  problem.world_from_keyframe.push_back(on_circle(0, round));
  const PoseGraphConfig config;
  LoopAgreement agreement(config);
  double last_ms = 0.0;
  const double start = cpu_ms();
  for (int k = 1; k <= round + loops; ++k) {
    problem.odometry.push_back(edge(k - 1, k, round, 0.005, random));
    problem.world_from_keyframe.push_back(problem.world_from_keyframe.back() *
                                          problem.odometry.back().from_from_to);
    if (k <= round) continue;
    problem.loops.push_back(edge(k - round, k, round, 0.02, random));
    if (k < round + loops && k % 100 != 0) continue;
    const double before_ms = cpu_ms();
    agreement.update(problem);
    last_ms = cpu_ms() - before_ms;
  }
  const double all_s = 1e-3 * (cpu_ms() - start);
  problem.odometry.push_back(edge(round + loops, round + loops + 1, round, 0.005, random));
  problem.world_from_keyframe.push_back(problem.world_from_keyframe.back() *
                                        problem.odometry.back().from_from_to);
  problem.loops.push_back(edge(loops + 1, round + loops + 1, round, 0.02, random));
  double before = cpu_ms();
  agreement.update(problem);
  std::printf(
      "%d loops: one more compared in %.1f ms, the last hundred in %.0f ms, all in %.1f s\n", loops,
      cpu_ms() - before, last_ms, all_s);
  before = cpu_ms();
  const PoseGraphResult result = optimise_pose_graph(problem, config, &agreement);
  std::printf("graph of %zu keyframes optimised in %.2f s%s\n", problem.world_from_keyframe.size(),
              1e-3 * (cpu_ms() - before), result.converged ? "" : " (not converged)");
  return result.converged ? EXIT_SUCCESS : EXIT_FAILURE;
}
