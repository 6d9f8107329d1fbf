#include "understory/graph/loops/loop_agreement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/graph/pose_graph.h"
#include "understory/util/random.h"

namespace understory {
namespace {

// Rounds of a circle with a keyframe each metre and noise of the odometry. Loops from each round to
// the first, of which a share is wrong by metres, some of these all alike.
PoseGraphProblem rounds_with_loops(std::uint64_t seed, std::size_t loops, double wrong_share) {
  Random random(seed);
  constexpr int kRound = 100;
  const int keyframes = kRound * (2 + static_cast<int>(loops) / kRound);
  PoseGraphProblem problem;
  std::vector<Pose> truth;
  for (int k = 0; k < keyframes; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / kRound;
    truth.emplace_back(so3_exp({0.0, 0.0, angle}),
                       Eigen::Vector3d(16.0 * std::sin(angle), -16.0 * std::cos(angle), 0.0));
    problem.world_from_keyframe.push_back(truth.back());
    if (k == 0) continue;
    PoseEdge edge{k - 1, k, truth[truth.size() - 2].inverse() * truth.back(),
                  1e-4 * Matrix6d::Identity()};
    problem.odometry.push_back(edge);
  }
  for (std::size_t i = 0; i < loops; ++i) {
    const int to = kRound + static_cast<int>(i);
    const int from = to % kRound;
    Pose off;
    if (random.uniform(0.0, 1.0) < wrong_share) {
      const double x = random.uniform(0.0, 1.0) < 0.5 ? 40.0 : 60.0 + 5.0 * random.normal();
      off = Pose(Eigen::Quaterniond::Identity(), {x, 30.0, 0.0});
    }
    problem.loops.push_back({from, to,
                             truth[static_cast<std::size_t>(from)].inverse() * off *
                                 truth[static_cast<std::size_t>(to)],
                             1e-4 * Matrix6d::Identity()});
  }
  return problem;
}

// The definition, word for word, with the agreement of two loops asked of a pair alone.
std::vector<char> by_definition(const PoseGraphProblem& problem, const PoseGraphConfig& config) {
  const std::size_t n = problem.loops.size();
  std::vector<std::vector<char>> agrees(n, std::vector<char>(n, 0));
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 1; j < n; ++j) {
      PoseGraphProblem pair = problem;
      pair.loops = {problem.loops[i], problem.loops[j]};
      const std::vector<char> used = consistent_loops(pair, config);
      agrees[i][j] = agrees[j][i] = used[0] != 0 && used[1] != 0 ? 1 : 0;
    }
  }
  std::vector<std::size_t> best;
  for (std::size_t seed = 0; seed < n; ++seed) {
    std::vector<std::size_t> set{seed};
    for (;;) {
      std::vector<std::size_t> left;
      for (std::size_t k = 0; k < n; ++k) {
        if (std::all_of(set.begin(), set.end(), [&](std::size_t m) { return agrees[k][m] != 0; }))
          left.push_back(k);
      }
      if (left.empty()) break;
      const auto friends = [&](std::size_t k) {
        return std::count_if(left.begin(), left.end(),
                             [&](std::size_t m) { return agrees[k][m] != 0; });
      };
      set.push_back(*std::max_element(left.begin(), left.end(), [&](std::size_t a, std::size_t b) {
        return friends(a) < friends(b);
      }));
    }
    if (set.size() > best.size()) best = set;
  }
  std::vector<char> used(n, 0);
  for (const std::size_t i : best)
    used[i] = 1;
  return used;
}

TEST(LoopAgreement, IsTheDefinitionHoweverTheLoopsCame) {
  const PoseGraphConfig config;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const PoseGraphProblem whole = rounds_with_loops(seed, 24, 0.15 * static_cast<double>(seed));
    const std::vector<char> expected = by_definition(whole, config);
    LoopAgreement one_by_one(config);
    PoseGraphProblem growing = whole;
    for (std::size_t i = 1; i <= whole.loops.size(); ++i) {
      growing.loops.assign(whole.loops.begin(),
                           whole.loops.begin() + static_cast<std::ptrdiff_t>(i));
      one_by_one.update(growing);
    }
    EXPECT_EQ(one_by_one.used(), expected) << seed;
    EXPECT_EQ(consistent_loops(whole, config), expected) << seed;
    EXPECT_EQ(one_by_one.compared(), 24U * 23U / 2U) << "each pair once";
    EXPECT_GT(std::count(expected.begin(), expected.end(), 0), 0) << "nothing was wrong";
  }
}

// Loops that contradict each other far from others. The largest set is made part by part, with the
// same result as from each loop in turn.
TEST(LoopAgreement, PartsThatContradictNoOtherAreWorkedOutAlone) {
  const PoseGraphConfig config;
  std::size_t with_parts = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    PoseGraphProblem problem = rounds_with_loops(seed, 1, 0.0);
    for (std::size_t k = 0; k < problem.odometry.size(); ++k)
      problem.odometry[k].covariance *= 0.01 + 1e6 * (k % 40 == 39 ? 1.0 : 0.0);
    const std::vector<Pose> truth = problem.world_from_keyframe;
    Random random(seed);
    problem.loops.clear();
    for (int part = 0; part < 4; ++part) {
      for (int i = 0; i < 5; ++i) {
        const int to = 100 + 40 * (part % 2) + 3 * i + (part > 1 ? 20 : 0);
        const int from = to - 100;
        const Pose off(Eigen::Quaterniond::Identity(),
                       {random.below(2) * 0.5 + part, random.below(2) * 0.5, 0.0});
        problem.loops.push_back({from, to,
                                 truth[static_cast<std::size_t>(from)].inverse() * off *
                                     truth[static_cast<std::size_t>(to)],
                                 1e-4 * Matrix6d::Identity()});
      }
    }
    const std::vector<char> expected = by_definition(problem, config);
    EXPECT_EQ(consistent_loops(problem, config), expected) << seed;
    with_parts += std::count(expected.begin(), expected.end(), 1) > 8 ? 1 : 0;
  }
  EXPECT_GT(with_parts, 3U);
}

TEST(LoopAgreement, BeginsAnewWhereAnEdgeHasChanged) {
  const PoseGraphConfig config;
  PoseGraphProblem problem = rounds_with_loops(3, 20, 0.3);
  LoopAgreement agreement(config);
  agreement.update(problem);
  const std::vector<char> before = agreement.used();
  // With an odometry that knows nothing there, all loops agree.
  problem.odometry[100].covariance *= 1e10;
  for (std::size_t k = 0; k < problem.odometry.size(); ++k)
    problem.odometry[k].covariance *= 1e6;
  agreement.update(problem);
  EXPECT_NE(agreement.used(), before);
  EXPECT_EQ(agreement.used(), consistent_loops(problem, config));
}

TEST(LoopAgreement, OneLoopAgreesWithItself) {
  LoopAgreement agreement{PoseGraphConfig()};
  agreement.update(rounds_with_loops(1, 1, 0.0));
  EXPECT_EQ(agreement.used(), std::vector<char>{1});
  agreement.update({});
  EXPECT_TRUE(agreement.used().empty());
}

}  // namespace
}  // namespace understory
