#include "understory/registration/ndt.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "understory/registration/ndt_kernel.h"
#include "understory/registration/solve.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"

namespace understory {

using internal::MixtureConstants;

void describe(ConfigTable& table, NdtConfig& config) {
  using Search = NdtConfig::Search;
  table.add_enum("search", config.search,
                 {{"1", Search::k1}, {"7", Search::k7}, {"8", Search::k8}, {"27", Search::k27}},
                 "cells looked at for a point: its own, with face neighbours, the 8 around it "
                 "(weighted by nearness), or all 27");
  table.add_enum(
      "hessian", config.hessian,
      {{"gauss_newton", NdtConfig::Hessian::kGaussNewton}, {"newton", NdtConfig::Hessian::kNewton}},
      "curvature used for the steps");
  table.add("outlier_ratio", config.outlier_ratio, {0.01, 0.95}, "",
            "share of points expected to match nothing");
  table.add("max_iterations", config.max_iterations, {1, 1000}, "", "most steps of one match");
  table.add("step_translation_m", config.step_translation_m, {1e-7, 0.1}, "m",
            "converged when a step is shorter");
  table.add("step_rotation_rad", config.step_rotation_rad, {1e-8, 0.1}, "rad",
            "converged when a step turns less");
  table.add("widening", config.widening, {1.0, 20.0}, "",
            "the first steps see normals this much wider; 1 = no such steps");
  table.add("wide_until_m", config.wide_until_m, {1e-4, 1.0}, "m",
            "the first steps end when one is shorter");
  table.add("max_step_m", config.max_step_m, {0.01, 10.0}, "m", "longest step");
  table.add("degenerate_ratio", config.degenerate_ratio, {0.0, 0.5}, "",
            "a direction with less of the strongest direction's information is undetermined");
  table.add("min_matches", config.min_matches, {6, 100000}, "",
            "fewer matched points are no match");
  table.add("independent_share", config.independent_share, {1e-4, 1.0}, "",
            "share of matched points that counts as independent");
}

namespace internal {

MixtureConstants mixture_constants(double outlier_ratio, double cell_size_m) {
  const double c1 = 10.0 * (1.0 - outlier_ratio);
  const double c2 = outlier_ratio / (cell_size_m * cell_size_m * cell_size_m);
  const double d3 = -std::log(c2);
  MixtureConstants constants;
  constants.d1 = -std::log(c1 + c2) - d3;
  constants.d2 = -2.0 * std::log((-std::log(c1 * std::exp(-0.5) + c2) - d3) / constants.d1);
  return constants;
}

}  // namespace internal

namespace {

constexpr std::size_t kBlock = 128;

// Sums over a block of points, in axes of the target around the source's origin. Row i of `h` is
// sum of w j_i (j0..j5, e): the last column but one is the gradient, the last is padding.
struct BlockSums {
  float h[6][8] = {};
  double cost = 0.0;
  double nearest_squared = 0.0;
  double weight = 0.0;
  double weighted_residual = 0.0;
  double weighted_rows = 0.0;
  double surface_squared = 0.0;
  std::uint32_t matched = 0;
};

// The pose in units of cells around a whole cell near the source's origin, so that single precision
// is enough wherever the map is.
struct LocalPose {
  std::array<int, 3> base;
  Eigen::Matrix3f rotation;
  Eigen::Vector3f translation;  // metres from the corner of the base cell
  float cell;
  float per_cell;
};

LocalPose localise(const Pose& pose, double cell_size) {
  const Eigen::Vector3d origin = (pose.translation() / cell_size).array().floor();
  return {
      {static_cast<int>(origin.x()), static_cast<int>(origin.y()), static_cast<int>(origin.z())},
      pose.rotation_matrix().cast<float>(),
      (pose.translation() - cell_size * origin).cast<float>(),
      static_cast<float>(cell_size),
      static_cast<float>(1.0 / cell_size)};
}

// Which cells around a point are looked at, and with which weight.
struct Neighbour {
  int dx, dy, dz;
  float weight;
};

using Neighbours = std::array<Neighbour, 27>;

int fixed_neighbours(NdtConfig::Search search, Neighbours& to) {
  int n = 0;
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        const int apart = std::abs(x) + std::abs(y) + std::abs(z);
        if (apart == 0 || search == NdtConfig::Search::k27 ||
            (search == NdtConfig::Search::k7 && apart == 1))
          to[static_cast<std::size_t>(n++)] = {x, y, z, 1.0F};
      }
    }
  }
  return n;
}

// The 2x2x2 cells whose centres surround the point, with trilinear weights: the cost has no jumps
// where a point goes from cell to cell.
int surrounding_cells(const float* fraction, Neighbours& to) {
  int step[3];
  float near_share[3];
  for (int k = 0; k < 3; ++k) {
    step[k] = fraction[k] < 0.5F ? -1 : 1;
    near_share[k] = 1.0F - std::abs(fraction[k] - 0.5F);
  }
  int n = 0;
  for (int corner = 0; corner < 8; ++corner) {
    float weight = 1.0F;
    int at[3];
    for (int k = 0; k < 3; ++k) {
      const bool far = ((corner >> k) & 1) != 0;
      at[k] = far ? step[k] : 0;
      weight *= far ? 1.0F - near_share[k] : near_share[k];
    }
    to[static_cast<std::size_t>(n++)] = {at[0], at[1], at[2], weight};
  }
  return n;
}

// One point against one cell.
struct Match {
  float j[3]
         [8];  // per row: derivative of the normalised residual (rotation, translation), residual
  float q = 0.0F;
  int rows = 0;
};

void match(const NdtCell& cell, const Eigen::Vector3f& offset, const Eigen::Vector3f& lever,
           Match& to) {
  to.q = 0.0F;
  to.rows = cell.rows;
  for (int k = 0; k < cell.rows; ++k) {
    const Eigen::Vector3f& a = cell.row[static_cast<std::size_t>(k)];
    const float e = a.dot(offset);
    float* j = to.j[k];
    j[0] = lever.y() * a.z() - lever.z() * a.y();
    j[1] = lever.z() * a.x() - lever.x() * a.z();
    j[2] = lever.x() * a.y() - lever.y() * a.x();
    j[3] = a.x();
    j[4] = a.y();
    j[5] = a.z();
    j[6] = e;
    j[7] = 0.0F;
    to.q += e * e;
  }
}

void add_gauss_newton(const Match& match, float weight, BlockSums& sums) {
  for (int k = 0; k < match.rows; ++k) {
    const float* j = match.j[k];
    for (int row = 0; row < 6; ++row) {
      const float scaled = weight * j[row];
      for (int column = 0; column < 8; ++column)
        sums.h[row][column] += scaled * j[column];
    }
  }
}

// What the exact Hessian has beyond Gauss-Newton: the curvature of the mixture, and that of the
// rotation, for a step exp(omega, v) of SE(3).
void add_exact_terms(const Match& match, const NdtCell& cell, const Eigen::Vector3f& lever,
                     float weight, float d2, BlockSums& sums) {
  float pull[6] = {};
  for (int k = 0; k < match.rows; ++k) {
    for (int i = 0; i < 6; ++i)
      pull[i] += match.j[k][6] * match.j[k][i];
  }
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column)
      sums.h[row][column] -= weight * d2 * pull[row] * pull[column];
  }
  for (int k = 0; k < match.rows; ++k) {
    const Eigen::Vector3f& a = cell.row[static_cast<std::size_t>(k)];
    const float scaled = weight * match.j[k][6];
    Eigen::Matrix3f turning = 0.5F * (a * lever.transpose() + lever * a.transpose());
    turning.diagonal().array() -= a.dot(lever);
    Eigen::Matrix3f cross;
    cross << 0.0F, -a.z(), a.y(), a.z(), 0.0F, -a.x(), -a.y(), a.x(), 0.0F;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        sums.h[row][column] += scaled * turning(row, column);
        sums.h[row][3 + column] -= 0.5F * scaled * cross(row, column);
        sums.h[3 + row][column] -= 0.5F * scaled * cross(column, row);
      }
    }
  }
}

class Accumulator {
 public:
  Accumulator(const NdtMap& target, const Points& source, const Pose& pose, const NdtConfig& config,
              double widening)
      : target_(target),
        source_(source),
        local_(localise(pose, target.cell_size())),
        exact_(config.hessian == NdtConfig::Hessian::kNewton),
        trilinear_(config.search == NdtConfig::Search::k8) {
    const MixtureConstants mixture =
        internal::mixture_constants(config.outlier_ratio, target.cell_size());
    d2_ = static_cast<float>(mixture.d2 / (widening * widening));
    pull_ = static_cast<float>(-mixture.d1 * mixture.d2);
    if (!trilinear_) fixed_count_ = fixed_neighbours(config.search, fixed_);
  }

  [[nodiscard]] BlockSums block(std::size_t begin, std::size_t end) const {
    BlockSums sums;
    Neighbours moving;
    for (std::size_t i = begin; i < end; ++i)
      add_point(source_[i], moving, sums);
    return sums;
  }

 private:
  void add_point(const Eigen::Vector3f& point, Neighbours& moving, BlockSums& sums) const {
    const Eigen::Vector3f lever = local_.rotation * point;
    const Eigen::Vector3f placed = lever + local_.translation;
    int at[3];
    float fraction[3];
    for (int k = 0; k < 3; ++k) {
      const float scaled = placed[k] * local_.per_cell;
      const int whole = voxel_floor(scaled);
      at[k] = whole;
      fraction[k] = scaled - static_cast<float>(whole);
    }
    const int count = trilinear_ ? surrounding_cells(fraction, moving) : fixed_count_;
    const Neighbours& neighbours = trilinear_ ? moving : fixed_;
    float nearest = std::numeric_limits<float>::infinity();
    Match matched;
    for (int n = 0; n < count; ++n) {
      const Neighbour& step = neighbours[static_cast<std::size_t>(n)];
      const NdtCell* cell =
          target_.find(local_.base[0] + at[0] + step.dx, local_.base[1] + at[1] + step.dy,
                       local_.base[2] + at[2] + step.dz);
      if (cell == nullptr) continue;
      const Eigen::Vector3f from_center(
          local_.cell * (fraction[0] - 0.5F - static_cast<float>(step.dx)),
          local_.cell * (fraction[1] - 0.5F - static_cast<float>(step.dy)),
          local_.cell * (fraction[2] - 0.5F - static_cast<float>(step.dz)));
      const Eigen::Vector3f offset = from_center - cell->mean;
      nearest = std::min(nearest, offset.squaredNorm());
      if (cell->rows == 0) continue;
      match(*cell, offset, lever, matched);
      add_match(matched, *cell, lever, step.weight, sums);
    }
    if (nearest < std::numeric_limits<float>::infinity()) {
      sums.nearest_squared += static_cast<double>(nearest);
      ++sums.matched;
    }
  }

  void add_match(const Match& matched, const NdtCell& cell, const Eigen::Vector3f& lever,
                 float share, BlockSums& sums) const {
    if (matched.q * d2_ > 60.0F) return;
    const float likelihood = std::exp(-0.5F * d2_ * matched.q);
    const float weight = pull_ * likelihood * share;
    add_gauss_newton(matched, weight, sums);
    if (exact_) add_exact_terms(matched, cell, lever, weight, d2_, sums);
    sums.cost -= static_cast<double>(weight / d2_);
    sums.weight += static_cast<double>(weight);
    sums.weighted_residual += static_cast<double>(weight * matched.q);
    sums.weighted_rows += static_cast<double>(weight) * matched.rows;
    const float first = matched.j[0][6];
    sums.surface_squared += static_cast<double>(weight * first * first / cell.row[0].squaredNorm());
  }

  const NdtMap& target_;
  const Points& source_;
  LocalPose local_;
  bool exact_;
  bool trilinear_;
  Neighbours fixed_{};
  int fixed_count_ = 0;
  float d2_ = 1.0F;    // of the (widened) kernel
  float pull_ = 1.0F;  // weight of a perfect match
};

void add_block(const BlockSums& block, NdtCost& to) {
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column)
      to.hessian(row, column) += static_cast<double>(block.h[row][column]);
    to.gradient[row] += static_cast<double>(block.h[row][6]);
  }
  to.cost += block.cost;
  to.matched += block.matched;
  to.nearest_squared += block.nearest_squared;
  to.weight += block.weight;
  to.weighted_residual += block.weighted_residual;
  to.weighted_rows += block.weighted_rows;
  to.surface_squared += block.surface_squared;
}

}  // namespace

NdtCost ndt_cost(const NdtMap& target, const Points& source, const Pose& target_from_source,
                 const NdtConfig& config, double widening) {
  const Accumulator accumulator(target, source, target_from_source, config, widening);
  const std::size_t blocks = (source.size() + kBlock - 1) / kBlock;
  std::vector<BlockSums> sums(blocks);
  parallel_for(blocks, 2, [&](std::size_t b) {
    sums[b] = accumulator.block(b * kBlock, std::min(source.size(), (b + 1) * kBlock));
  });
  NdtCost total;
  for (const BlockSums& block : sums)
    add_block(block, total);
  // From steps in axes of the target to right perturbations: both parts turn with the source.
  Matrix6d turn = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = target_from_source.rotation_matrix();
  turn.bottomRightCorner<3, 3>() = turn.topLeftCorner<3, 3>();
  total.gradient = (turn.transpose() * total.gradient).eval();
  total.hessian = (turn.transpose() * total.hessian * turn).eval();
  total.hessian = (0.5 * (total.hessian + total.hessian.transpose())).eval();
  return total;
}

namespace {

RegistrationResult refused(RegistrationStatus status, std::string reason, const Pose& guess) {
  RegistrationResult result;
  result.status = status;
  result.reason = std::move(reason);
  result.target_from_source = guess;
  return result;
}

// The Hessian promises what independent points with exactly modelled residuals would give; the
// residuals themselves tell by how much they are wider.
Matrix6d realistic_information(const NdtCost& at, const NdtConfig& config) {
  const double variance = at.weighted_rows > 0.0 ? at.weighted_residual / at.weighted_rows : 1.0;
  return config.independent_share / std::max(variance, 0.1) * at.hessian;
}

void describe_fit(const NdtCost& at, const Points& source, double range_m, const NdtConfig& config,
                  RegistrationResult& result) {
  const auto matched = static_cast<double>(at.matched);
  result.inlier_ratio = matched / static_cast<double>(source.size());
  result.fitness_m2 = at.matched > 0 ? at.nearest_squared / matched : 0.0;
  result.surface_residual_m2 = at.weight > 0.0 ? at.surface_squared / at.weight : 0.0;
  result.information = realistic_information(at, config);
  result.degenerate_directions =
      internal::degenerate_directions(result.information, range_m, config.degenerate_ratio);
}

}  // namespace

RegistrationResult register_ndt(const NdtMap& target, const Points& source, const Pose& guess,
                                const std::optional<PosePrior>& prior, const NdtConfig& config) {
  if (target.empty()) return refused(RegistrationStatus::kTooFewPoints, "empty target", guess);
  if (source.size() < static_cast<std::size_t>(config.min_matches)) {
    return refused(RegistrationStatus::kTooFewPoints,
                   "only " + std::to_string(source.size()) + " source points", guess);
  }
  const double range = internal::mean_range(source);
  double widening = config.widening;
  const auto evaluate = [&](const Pose& pose) {
    const NdtCost at = ndt_cost(target, source, pose, config, widening);
    const double share = config.independent_share;
    internal::Quadratic sum{share * at.cost, share * at.gradient, share * at.hessian};
    if (prior) internal::add_prior(*prior, pose, sum);
    return sum;
  };
  internal::StepLimits limits{config.max_iterations, config.step_translation_m,
                              config.step_rotation_rad, config.max_step_m, range};
  internal::Minimum minimum{guess, {}, 0, false};
  // From far away a narrow normal has no pull: wide ones first, until the steps become short.
  if (widening > 1.0) {
    limits.step_translation_m = config.wide_until_m;
    limits.step_rotation_rad = config.wide_until_m / range;
    minimum = internal::minimise(evaluate, guess, limits);
  }
  const int wide_iterations = minimum.iterations;
  widening = 1.0;
  limits.step_translation_m = config.step_translation_m;
  limits.step_rotation_rad = config.step_rotation_rad;
  minimum = internal::minimise(evaluate, minimum.pose, limits);
  minimum.iterations += wide_iterations;

  NdtConfig plain = config;  // information has to be positive
  plain.hessian = NdtConfig::Hessian::kGaussNewton;
  const NdtCost at = ndt_cost(target, source, minimum.pose, plain);
  if (at.matched < static_cast<std::size_t>(config.min_matches)) {
    return refused(RegistrationStatus::kTooFewMatches,
                   "only " + std::to_string(at.matched) + " of " + std::to_string(source.size()) +
                       " points near the target",
                   guess);
  }
  if (!(at.hessian.trace() > 0.0)) {
    return refused(RegistrationStatus::kDegenerate, "nothing near constrains the pose", guess);
  }
  RegistrationResult result;
  result.target_from_source = minimum.pose;
  result.iterations = minimum.iterations;
  result.status =
      minimum.converged ? RegistrationStatus::kConverged : RegistrationStatus::kIterationLimit;
  if (!minimum.converged)
    result.reason = "no small step within " + std::to_string(config.max_iterations) + " iterations";
  describe_fit(at, source, range, config, result);
  return result;
}

RegistrationResult register_ndt(std::span<const NdtMapPtr> targets, const Points& source,
                                const Pose& guess, const std::optional<PosePrior>& prior,
                                const NdtConfig& config) {
  UNDERSTORY_CHECK(!targets.empty());
  RegistrationResult result;
  Pose start = guess;
  int iterations = 0;
  for (const NdtMapPtr& target : targets) {
    result = register_ndt(*target, source, start, prior, config);
    iterations += result.iterations;
    if (!result.usable()) {
      result.target_from_source = guess;
      break;
    }
    start = result.target_from_source;
  }
  result.iterations = iterations;
  return result;
}

}  // namespace understory
