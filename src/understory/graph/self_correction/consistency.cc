#include <algorithm>
#include <cmath>
#include <numeric>

#include "understory/geometry/symmetric_solver.h"
#include "understory/graph/pose_graph.h"

namespace understory {
namespace {

// Odometry chained from the first keyframe: poses, and the sums of variances up to each, which give
// the covariance of any stretch between two.
struct Chain {
  std::vector<Pose> first_from_keyframe;
  std::vector<Matrix6d> covariance;  // of first_from_keyframe, right perturbation
  std::vector<char> reached;
};

Chain chain_odometry(const PoseGraphProblem& problem) {
  const std::size_t n = problem.world_from_keyframe.size();
  Chain chain{std::vector<Pose>(n), std::vector<Matrix6d>(n, Matrix6d::Zero()),
              std::vector<char>(n, 0)};
  if (n == 0) return chain;
  chain.reached[0] = 1;
  for (const PoseEdge& edge : problem.odometry) {
    const auto from = static_cast<std::size_t>(edge.from);
    const auto to = static_cast<std::size_t>(edge.to);
    if (chain.reached[from] == 0 || chain.reached[to] != 0) continue;
    chain.first_from_keyframe[to] = chain.first_from_keyframe[from] * edge.from_from_to;
    chain.covariance[to] =
        compose_covariance(chain.covariance[from], edge.from_from_to, edge.covariance);
    chain.reached[to] = 1;
  }
  return chain;
}

// Relative pose between two keyframes over the odometry, with the covariance of that stretch.
struct Stretch {
  Pose a_from_b;
  Matrix6d covariance;  // right perturbation
};

Stretch stretch(const Chain& chain, int a, int b, double scale) {
  const auto ia = static_cast<std::size_t>(std::min(a, b));
  const auto ib = static_cast<std::size_t>(std::max(a, b));
  Stretch s;
  s.a_from_b = chain.first_from_keyframe[ia].inverse() * chain.first_from_keyframe[ib];
  // What the chain's covariance grew by from a to b: cov(b) - (cov(a) carried over to b).
  const Matrix6d carried = compose_covariance(chain.covariance[ia], s.a_from_b, Matrix6d::Zero());
  s.covariance = scale * scale * (chain.covariance[ib] - carried);
  if (a > b) {
    s.covariance = inverse_covariance(s.a_from_b, s.covariance);
    s.a_from_b = s.a_from_b.inverse();
  }
  return s;
}

// Whether the circle loop i, odometry, loop j backwards, odometry closes.
bool agree(const Chain& chain, const PoseEdge& i, const PoseEdge& j, const PoseGraphConfig& config,
           double limit) {
  const double scale = config.odometry_sigma_scale;
  const Stretch there = stretch(chain, i.to, j.to, scale);
  const Stretch back = stretch(chain, j.from, i.from, scale);
  Pose circle = i.from_from_to;
  Matrix6d covariance = i.covariance;
  const auto append = [&](const Pose& pose, const Matrix6d& added) {
    covariance = compose_covariance(covariance, pose, added);
    circle = circle * pose;
  };
  append(there.a_from_b, there.covariance);
  append(j.from_from_to.inverse(), inverse_covariance(j.from_from_to, j.covariance));
  append(back.a_from_b, back.covariance);
  const Vector6d error = circle.log();
  covariance = 0.5 * (covariance + covariance.transpose()).eval();
  covariance.diagonal().array() += 1e-12;
  return error.dot(SymmetricSolver<6>(covariance).solve(error)) < limit;
}

using Adjacency = std::vector<std::vector<char>>;

// Largest set of loops that agree in pairs: from each loop in turn greedily, the one that agrees
// with most of those left first. Ties go to the lower number.
std::vector<std::size_t> largest_set(const Adjacency& agrees) {
  const std::size_t n = agrees.size();
  std::vector<std::size_t> best;
  for (std::size_t seed = 0; seed < n; ++seed) {
    std::vector<std::size_t> set{seed};
    std::vector<std::size_t> left;
    for (std::size_t k = 0; k < n; ++k) {
      if (k != seed && agrees[seed][k] != 0) left.push_back(k);
    }
    while (!left.empty() && set.size() + left.size() > best.size()) {
      std::size_t chosen = left.front();
      std::ptrdiff_t most = -1;
      for (const std::size_t k : left) {
        const std::ptrdiff_t count = std::count_if(
            left.begin(), left.end(), [&](std::size_t m) { return agrees[k][m] != 0; });
        if (count > most) {
          most = count;
          chosen = k;
        }
      }
      set.push_back(chosen);
      std::erase_if(left, [&](std::size_t k) { return k == chosen || agrees[chosen][k] == 0; });
    }
    if (left.empty() && set.size() > best.size()) best = set;
  }
  return best;
}

}  // namespace

std::vector<char> consistent_loops(const PoseGraphProblem& problem, const PoseGraphConfig& config) {
  const std::size_t n = problem.loops.size();
  std::vector<char> used(n, 1);
  if (n < 2) return used;
  const Chain chain = chain_odometry(problem);
  const double limit = chi_squared_6(config.consistency_probability);
  Adjacency agrees(n, std::vector<char>(n, 0));
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 1; j < n; ++j) {
      agrees[i][j] = agrees[j][i] =
          agree(chain, problem.loops[i], problem.loops[j], config, limit) ? 1 : 0;
    }
  }
  used.assign(n, 0);
  for (const std::size_t i : largest_set(agrees))
    used[i] = 1;
  return used;
}

double edge_residual(const PoseEdge& edge, const Pose& world_from_from, const Pose& world_from_to) {
  const Vector6d error =
      right_difference(world_from_from.inverse() * world_from_to, edge.from_from_to);
  return std::sqrt(std::max(0.0, error.dot(SymmetricSolver<6>(edge.covariance).solve(error))));
}

double chi_squared_6(double probability) {
  // The distribution function for 6 degrees of freedom in closed form, inverted by bisection.
  const auto cumulative = [](double x) {
    const double h = 0.5 * x;
    return 1.0 - std::exp(-h) * (1.0 + h + 0.5 * h * h);
  };
  double low = 0.0;
  double high = 200.0;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (cumulative(middle) < probability ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

void describe(ConfigTable& table, PoseGraphConfig& config) {
  table.add("robust_loops", config.robust_loops,
            "weight loops by graduated non-convexity, so that wrong ones lose their weight");
  table.add("inlier_probability", config.inlier_probability, {0.5, 0.9999999}, "",
            "probability that this weighting keeps a right loop");
  table.add("check_consistency", config.check_consistency,
            "keep only the largest set of loops that agree in pairs over the odometry");
  table.add("consistency_probability", config.consistency_probability, {0.5, 0.9999999}, "",
            "probability with which two right loops agree");
  table.add("odometry_sigma_scale", config.odometry_sigma_scale, {0.1, 100.0}, "",
            "factor on the odometry's standard deviations when loops are compared");
  table.add("max_iterations", config.max_iterations, {1, 10000}, "",
            "most Levenberg-Marquardt steps");
  table.add("relative_tolerance", config.relative_tolerance, {1e-15, 0.1}, "",
            "stop when the cost falls by less than this share");
}

}  // namespace understory
