#include <algorithm>
#include <cmath>

#include "understory/geometry/symmetric_solver.h"
#include "understory/graph/loops/loop_agreement.h"
#include "understory/graph/pose_graph.h"

namespace understory {

std::vector<char> consistent_loops(const PoseGraphProblem& problem, const PoseGraphConfig& config) {
  LoopAgreement agreement(config);
  agreement.update(problem);
  return agreement.used();
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
