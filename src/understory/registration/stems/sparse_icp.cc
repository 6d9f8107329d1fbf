#include "understory/registration/stems/sparse_icp.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "understory/geometry/best_rotation.h"
#include "understory/geometry/plane/delaunay.h"
#include "understory/geometry/symmetric_solver.h"
#include "understory/registration/icp/nearest_pairs.h"
#include "understory/registration/registration_constants.h"
#include "understory/util/error.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace registration_constants::sparse_icp;

constexpr double kNoLimit = 1e9;

struct Pair {
  int source;
  int target;
  double squared_m2;
};

// What is known of the heights of both sides.
struct Heights {
  Heights(const std::vector<double>& of_target, const std::vector<double>& of_source)
      : target(of_target), source(of_source), known(!of_target.empty() && !of_source.empty()) {}

  const std::vector<double>& target;
  const std::vector<double>& source;
  bool known;

  // Of the difference, up to a factor that the fit finds.
  [[nodiscard]] double variance(const Pair& pair) const {
    if (!known) return 1.0;
    const double a = target[static_cast<std::size_t>(pair.target)];
    const double b = source[static_cast<std::size_t>(pair.source)];
    return a * a + b * b;
  }
};

double height_weight(const SparseIcpConfig& config, const Heights& heights) {
  if (config.metric == SparseIcpConfig::Metric::kPlane) return 0.0;
  return heights.known ? kUnsure : 1.0;
}

// Each source point with its nearest target point, where that is nearer than the limit.
std::vector<Pair> match(NearestPairs& nearest, const SparsePoints& source, const Pose& pose,
                        double limit_m) {
  std::vector<Pair> pairs;
  pairs.reserve(source.size());
  const Eigen::Matrix3d rotation = pose.rotation_matrix();
  for (std::size_t i = 0; i < source.size(); ++i) {
    const auto found = nearest.of(i, rotation * source[i] + pose.translation());
    if (found.index >= 0 && found.squared_m2 < limit_m * limit_m)
      pairs.push_back({static_cast<int>(i), found.index, found.squared_m2});
  }
  return pairs;
}

// Keeps the nearest pairs, in the order of the source.
void trim(std::vector<Pair>& pairs, std::size_t keep) {
  if (pairs.size() <= keep) return;
  std::vector<double> squared;
  squared.reserve(pairs.size());
  for (const Pair& pair : pairs)
    squared.push_back(pair.squared_m2);
  const auto nth = squared.begin() + static_cast<std::ptrdiff_t>(keep) - 1;
  std::nth_element(squared.begin(), nth, squared.end());
  const double limit = *nth;
  std::erase_if(pairs, [&](const Pair& pair) { return pair.squared_m2 > limit; });
}

// The rigid motion that brings the pairs together best; in the plane a turn about z and a shift.
Pose fit(const SparsePoints& target, const SparsePoints& source, const std::vector<Pair>& pairs,
         const Pose& now, bool plane) {
  Eigen::Vector3d mean_p = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_q = Eigen::Vector3d::Zero();
  for (const Pair& pair : pairs) {
    mean_p += source[static_cast<std::size_t>(pair.source)];
    mean_q += target[static_cast<std::size_t>(pair.target)];
  }
  mean_p = now * (mean_p / static_cast<double>(pairs.size())).eval();
  mean_q /= static_cast<double>(pairs.size());
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  for (const Pair& pair : pairs) {
    const Eigen::Vector3d p = now * source[static_cast<std::size_t>(pair.source)] - mean_p;
    moment += p * (target[static_cast<std::size_t>(pair.target)] - mean_q).transpose();
  }
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  Eigen::Vector3d shift;
  if (plane) {
    const double yaw = std::atan2(moment(0, 1) - moment(1, 0), moment(0, 0) + moment(1, 1));
    turn = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    shift = mean_q - turn * mean_p;
    shift.z() = 0.0;
  } else {
    turn = best_rotation(moment).rotation.transpose();
    shift = mean_q - turn * mean_p;
  }
  return Pose(turn, shift) * now;
}

// The refinement's state: pairs, their weights and the noise that they show.
struct Refinement {
  std::vector<Pair> pairs;
  std::vector<double> weights;
  double variance_plane = 0.0;
  double variance_height = 0.0;  // times that of Heights
};

void weigh(const SparsePoints& target, const SparsePoints& source, const Heights& heights,
           const Pose& pose, bool plane, Refinement& state) {
  constexpr double kFloor = 1e-8;  // (0.1 mm)^2
  const double dimensions = plane ? 2.0 : 3.0;
  double sum_plane = 0.0;
  double sum_height = 0.0;
  state.weights.resize(state.pairs.size());
  for (std::size_t k = 0; k < state.pairs.size(); ++k) {
    const Pair& pair = state.pairs[k];
    const Eigen::Vector3d d = pose * source[static_cast<std::size_t>(pair.source)] -
                              target[static_cast<std::size_t>(pair.target)];
    const double high = d.z() * d.z() / heights.variance(pair);
    const double flat = d.head<2>().squaredNorm();
    const double squares =
        flat / state.variance_plane + (plane ? 0.0 : high / state.variance_height);
    const double w = (kFreedom + dimensions) / (kFreedom + squares);
    state.weights[k] = w;
    sum_plane += w * flat;
    sum_height += w * high;
  }
  const double n = static_cast<double>(state.pairs.size());
  state.variance_plane = std::max(sum_plane / (2.0 * n), kFloor);
  state.variance_height = std::max(sum_height / n, kFloor);
}

// One Gauss-Newton step over the weighted pairs; returns the step, fills the information.
Vector6d newton_step(const SparsePoints& target, const SparsePoints& source, const Heights& heights,
                     const Pose& pose, bool plane, const Refinement& state, Matrix6d& information) {
  information.setZero();
  Vector6d gradient = Vector6d::Zero();
  const Eigen::Matrix3d rotation = pose.rotation_matrix();
  Eigen::Vector3d inverse = Eigen::Vector3d::Constant(1.0 / state.variance_plane);
  for (std::size_t k = 0; k < state.pairs.size(); ++k) {
    const Pair& pair = state.pairs[k];
    inverse.z() = plane ? 0.0 : 1.0 / (state.variance_height * heights.variance(pair));
    const Eigen::Vector3d& p = source[static_cast<std::size_t>(pair.source)];
    const Eigen::Vector3d d =
        rotation * p + pose.translation() - target[static_cast<std::size_t>(pair.target)];
    Eigen::Matrix<double, 3, 6> jacobian;
    jacobian.leftCols<3>() = -rotation * skew(p);
    jacobian.rightCols<3>() = rotation;
    const Eigen::Matrix<double, 3, 6> weighted =
        (state.weights[k] * inverse).asDiagonal() * jacobian;
    information += jacobian.transpose() * weighted;
    gradient += weighted.transpose() * d;
  }
  Matrix6d system = information;
  if (plane) {
    // Tilt and height are not asked for: held in the target's frame by a stiff prior.
    Eigen::Matrix<double, 3, 6> held = Eigen::Matrix<double, 3, 6>::Zero();
    held.block<2, 3>(0, 0) = rotation.topRows<2>();
    held.block<1, 3>(2, 3) = rotation.row(2);
    system += 1e6 * information.diagonal().maxCoeff() * held.transpose() * held;
  }
  system.diagonal().array() += 1e-9 * system.diagonal().maxCoeff() + 1e-12;
  return -SymmetricSolver<6>(system).solve(gradient);
}

bool small(const Vector6d& step, const SparseIcpConfig& config) {
  return step.head<3>().norm() < config.step_rotation_rad &&
         step.tail<3>().norm() < config.step_translation_m;
}

// Of the heights of all pairs, as they are known.
double median_variance(const std::vector<Pair>& pairs, const Heights& heights) {
  std::vector<double> variances;
  variances.reserve(pairs.size());
  for (const Pair& pair : pairs)
    variances.push_back(heights.variance(pair));
  return upper_median(variances, 1.0);
}

void refine(const SparseTarget& target, const SparsePoints& source, const Heights& heights,
            const SparseIcpConfig& config, NearestPairs& nearest, SparseIcpResult& result) {
  const bool plane = config.metric == SparseIcpConfig::Metric::kPlane;
  const double limit_m = 0.25 * target.l0_m;  // half of delta0: beyond it is another stem
  Refinement state;
  const double start = std::max(result.error_rms_m, 1e-3);
  state.variance_plane = start * start / 3.0;
  state.variance_height = heights.known ? 1.0 : state.variance_plane;
  Pose& pose = result.target_from_source;
  for (int i = 0; i < config.max_iterations; ++i) {
    state.pairs = match(nearest, source, pose, limit_m);
    if (state.pairs.size() < kFewestStems) return;
    weigh(target.grid.points(), source, heights, pose, plane, state);
    const Vector6d step =
        newton_step(target.grid.points(), source, heights, pose, plane, state, result.information);
    pose = pose * Pose::exp(step);
    ++result.iterations;
    if (small(step, config)) break;
  }
  result.sigma_plane_m = std::sqrt(state.variance_plane);
  result.sigma_height_m = std::sqrt(state.variance_height * median_variance(state.pairs, heights));
}

void measure(const SparseTarget& target, const SparsePoints& source, const SparseIcpConfig& config,
             std::size_t keep, NearestPairs& nearest, SparseIcpResult& result) {
  std::vector<Pair> pairs = match(nearest, source, result.target_from_source, kNoLimit);
  const double near = config.overlap_distance_ratio * target.l0_m;
  std::size_t overlapping = 0;
  for (const Pair& pair : pairs)
    overlapping += pair.squared_m2 <= near * near ? 1 : 0;
  result.overlap = static_cast<double>(overlapping) / static_cast<double>(source.size());
  result.outlier_ratio = 1.0 - result.overlap;
  trim(pairs, keep);
  double sum = 0.0;
  double squares = 0.0;
  for (const Pair& pair : pairs) {
    sum += std::sqrt(pair.squared_m2);
    squares += pair.squared_m2;
  }
  result.error_m = sum / static_cast<double>(pairs.size());
  result.error_rms_m = std::sqrt(squares / static_cast<double>(pairs.size()));
}

}  // namespace

void describe(ConfigTable& table, SparseIcpConfig& config) {
  table.add_enum(
      "metric", config.metric,
      {{"plane", SparseIcpConfig::Metric::kPlane}, {"space", SparseIcpConfig::Metric::kSpace}},
      "minimised over yaw and horizontal position (plane), or over all six degrees of freedom "
      "(space)");
  table.add("outlier_ratio", config.outlier_ratio, {0.0, 0.95}, "",
            "share of the source points left out of each step, those with the largest distances");
  table.add("max_iterations", config.max_iterations, {1, 1000}, "", "most steps of each stage");
  table.add("step_translation_m", config.step_translation_m, {0.0, 1.0}, "m",
            "converged when a step is shorter ...");
  table.add("step_rotation_rad", config.step_rotation_rad, {0.0, 1.0}, "rad", "... and turns less");
  table.add("refine", config.refine,
            "after trimming: weight pairs by Student's t with estimated noise");
  table.add("overlap_distance_ratio", config.overlap_distance_ratio, {0.001, 1.0}, "stem spacings",
            "pairs nearer than this share of the mean distance between neighbouring stems overlap");
}

SparseTarget::SparseTarget(const SparsePoints& points, std::vector<double> height_sds_m)
    : grid(points), height_sd_m(std::move(height_sds_m)) {
  UNDERSTORY_CHECK(height_sd_m.empty() || height_sd_m.size() == points.size());
  std::vector<Eigen::Vector2d> flat;
  flat.reserve(points.size());
  for (const Eigen::Vector3d& point : points)
    flat.emplace_back(point.head<2>());
  l0_m = mean_neighbour_distance(flat);
}

std::size_t trimmed_count(std::size_t points, double outlier_ratio) {
  const double kept = (1.0 - outlier_ratio) * static_cast<double>(points);
  return std::max(kFewestStems / 2, static_cast<std::size_t>(std::lround(kept)));
}

std::string too_few_stems() {
  return "fewer than " + std::to_string(kFewestStems) + " stems, or all on one line";
}

std::string to_string(SparseIcpStatus status) {
  switch (status) {
    case SparseIcpStatus::kConverged:
      return "converged";
    case SparseIcpStatus::kIterationLimit:
      return "iteration_limit";
    case SparseIcpStatus::kTooFewPoints:
      break;
  }
  return "too_few_points";
}

SparseIcpResult register_sparse_icp(const SparseTarget& target, const SparsePoints& source,
                                    const Pose& guess, const SparseIcpConfig& config,
                                    const std::vector<double>& source_height_sd_m) {
  UNDERSTORY_CHECK(source_height_sd_m.empty() || source_height_sd_m.size() == source.size());
  const Heights heights(target.height_sd_m, source_height_sd_m);
  SparseIcpResult result;
  result.target_from_source = guess;
  if (source.size() < kFewestStems || target.grid.points().size() < kFewestStems ||
      target.l0_m <= 0.0) {
    result.reason = too_few_stems();
    return result;
  }
  const bool plane = config.metric == SparseIcpConfig::Metric::kPlane;
  const std::size_t keep = trimmed_count(source.size(), config.outlier_ratio);
  result.status = SparseIcpStatus::kIterationLimit;
  result.reason = "the steps had not become small";
  NearestPairs nearest(target.grid, source.size(), height_weight(config, heights));
  Pose& pose = result.target_from_source;
  for (; result.iterations < config.max_iterations; ++result.iterations) {
    std::vector<Pair> pairs = match(nearest, source, pose, kNoLimit);
    trim(pairs, keep);
    // Heights that are known each in its own way wait for the weights.
    const bool flat = plane || (heights.known && config.refine);
    const Pose next = fit(target.grid.points(), source, pairs, pose, flat);
    const Vector6d step = right_difference(next, pose);
    pose = next;
    if (!small(step, config)) continue;
    result.status = SparseIcpStatus::kConverged;
    result.reason.clear();
    break;
  }
  measure(target, source, config, keep, nearest, result);
  if (config.refine) {
    refine(target, source, heights, config, nearest, result);
    measure(target, source, config, keep, nearest, result);
  }
  return result;
}

bool ConvergenceRegion::contains(double shift_m, double yaw_rad, double tilt_rad) const {
  const double shift = shift_m / delta0_m;
  const double yaw = yaw_rad / theta0_rad;
  const double tilt = tilt_rad / phi0_rad;
  return shift * shift + yaw * yaw + tilt * tilt <= 1.0;
}

ConvergenceRegion convergence_region(double l0_m, double radius_m, double outlier_ratio) {
  ConvergenceRegion region;
  region.delta0_m = 0.5 * l0_m;
  region.theta0_rad = region.delta0_m / (std::sqrt(1.0 - outlier_ratio) * radius_m);
  return region;
}

}  // namespace understory
