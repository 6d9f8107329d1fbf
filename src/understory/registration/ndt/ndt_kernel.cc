#include "understory/registration/ndt/ndt_kernel.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "understory/registration/ndt/ndt_batch.h"
#include "understory/util/parallel.h"

namespace understory {

using internal::MixtureConstants;
using internal::NdtBatch;
using internal::NdtSums;

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

// The pose in units of cells around a whole cell near the source's origin, so that single precision
// is enough wherever the map is.
struct LocalPose {
  std::array<int, 3> base;
  Eigen::Matrix3f rotation;
  Eigen::Vector3f translation;              // metres from the corner of the base cell
  std::vector<Eigen::Vector3f> viewpoints;  // from the source's origin, axes of the target
  float cell;
  float per_cell;
};

LocalPose localise(const Pose& pose, double cell_size,
                   const std::vector<Eigen::Vector3d>& viewpoints) {
  std::vector<Eigen::Vector3f> turned;
  for (const Eigen::Vector3d& viewpoint : viewpoints)
    turned.emplace_back((pose.rotation_matrix() * viewpoint).cast<float>());
  const Eigen::Vector3d origin = (pose.translation() / cell_size).array().floor();
  return {
      {static_cast<int>(origin.x()), static_cast<int>(origin.y()), static_cast<int>(origin.z())},
      pose.rotation_matrix().cast<float>(),
      (pose.translation() - cell_size * origin).cast<float>(),
      std::move(turned),
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

// What the exact Hessian has beyond Gauss-Newton, for one point and one cell. It is the curvature
// of the mixture, and of the rotation for a step exp(omega, v) of SE(3).
void add_exact_terms(const NdtCell& cell, const Eigen::Vector3f& offset,
                     const Eigen::Vector3f& lever, float d2, float pull_share, NdtSums& sums) {
  using Vector6f = Eigen::Matrix<float, 6, 1>;
  Vector6f slope = Vector6f::Zero();
  Eigen::Vector3f force = Eigen::Vector3f::Zero();
  float q = 0.0F;
  for (int k = 0; k < cell.rows; ++k) {
    const Eigen::Vector3f& a = cell.row[static_cast<std::size_t>(k)];
    const float e = a.dot(offset);
    slope.head<3>() += e * lever.cross(a);
    slope.tail<3>() += e * a;
    force += e * a;
    q += e * e;
  }
  const float weight = pull_share * internal::exp_of_negative(-0.5F * d2 * q);
  Eigen::Matrix<float, 6, 6> terms = -d2 * slope * slope.transpose();
  terms.topLeftCorner<3, 3>() += 0.5F * (force * lever.transpose() + lever * force.transpose()) -
                                 force.dot(lever) * Eigen::Matrix3f::Identity();
  Eigen::Matrix3f cross;
  cross << 0.0F, -force.z(), force.y(), force.z(), 0.0F, -force.x(), -force.y(), force.x(), 0.0F;
  terms.topRightCorner<3, 3>() -= 0.5F * cross;
  terms.bottomLeftCorner<3, 3>() -= 0.5F * cross.transpose();
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column) {
      sums.exact[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)] +=
          weight * terms(row, column);
    }
  }
}

struct PointIndices {
  std::array<std::size_t, kBlock> index;
  std::size_t count = 0;
};

class Accumulator {
 public:
  Accumulator(const NdtMap& target, const NdtSource& source, const Pose& pose,
              const NdtConfig& config, double widening)
      : target_(target),
        source_(source),
        local_(localise(pose, target.cell_size(), target.viewpoints_in_source())),
        exact_(config.hessian == NdtConfig::Hessian::kNewton),
        trilinear_(config.search == NdtConfig::Search::k8) {
    const MixtureConstants mixture =
        internal::mixture_constants(config.outlier_ratio, target.cell_size());
    d2_ = static_cast<float>(mixture.d2 / (widening * widening));
    pull_ = static_cast<float>(-mixture.d1 * mixture.d2);
    if (!trilinear_) fixed_count_ = fixed_neighbours(config.search, fixed_);
  }

  // Adds the points of `which` (indices into the source, at most kBlock) to the sums, and leaves in
  // it those without a cell. Goes over them step by step, so that the memory of the cells is asked
  // for well before it is needed.
  void add(PointIndices& which, NdtSums& sums) const {
    std::array<Placed, kBlock> placed;
    const std::size_t n = which.count;
    for (std::size_t i = 0; i < n; ++i) {
      placed[i] = place(source_.points[which.index[i]]);
      placed[i].lidar = std::min(source_.lidar_of(which.index[i]), local_.viewpoints.size() - 1);
      target_.prefetch(placed[i].at[0], placed[i].at[1], placed[i].at[2]);
    }
    for (std::size_t i = 0; i < n; ++i) {
      placed[i].own = target_.find(placed[i].at[0], placed[i].at[1], placed[i].at[2]);
      if (placed[i].own != nullptr) __builtin_prefetch(placed[i].own);
    }
    NdtBatch batch;
    Neighbours moving;
    which.count = 0;
    for (std::size_t i = 0; i < n; ++i) {
      if (!add_point(placed[i], moving, batch, sums)) which.index[which.count++] = which.index[i];
    }
    batch.flush(d2_, pull_, sums);
  }

 private:
  struct Placed {
    Eigen::Vector3f lever;  // from the source's origin, axes of the target
    std::array<int, 3> at;  // cell
    float fraction[3];      // place in the cell, 0..1
    std::size_t lidar;      // by which it was measured
    const NdtCell* own;
  };

  [[nodiscard]] Placed place(const Eigen::Vector3f& point) const {
    Placed placed;
    placed.lever = local_.rotation * point;
    for (int k = 0; k < 3; ++k) {
      const float scaled = (placed.lever[k] + local_.translation[k]) * local_.per_cell;
      const int whole = voxel_floor(scaled);
      placed.at[static_cast<std::size_t>(k)] = local_.base[static_cast<std::size_t>(k)] + whole;
      placed.fraction[k] = scaled - static_cast<float>(whole);
    }
    return placed;
  }

  // False if there is no cell.
  bool add_point(const Placed& placed, Neighbours& moving, NdtBatch& batch, NdtSums& sums) const {
    const int count = trilinear_ ? surrounding_cells(placed.fraction, moving) : fixed_count_;
    const Neighbours& neighbours = trilinear_ ? moving : fixed_;
    float nearest = std::numeric_limits<float>::infinity();
    for (int n = 0; n < count; ++n) {
      const Neighbour& step = neighbours[static_cast<std::size_t>(n)];
      const bool own = step.dx == 0 && step.dy == 0 && step.dz == 0;
      const NdtCell* cell = own ? placed.own
                                : target_.find(placed.at[0] + step.dx, placed.at[1] + step.dy,
                                               placed.at[2] + step.dz);
      if (cell == nullptr) continue;
      const Eigen::Vector3f from_center(
          local_.cell * (placed.fraction[0] - 0.5F - static_cast<float>(step.dx)),
          local_.cell * (placed.fraction[1] - 0.5F - static_cast<float>(step.dy)),
          local_.cell * (placed.fraction[2] - 0.5F - static_cast<float>(step.dz)));
      Eigen::Vector3f offset = from_center - cell->mean;
      nearest = std::min(nearest, offset.squaredNorm());
      if (cell->rows == 0) continue;
      if (cell->near_side_m > 0.0F) {
        const Eigen::Vector3f ray = placed.lever - local_.viewpoints[placed.lidar];
        offset += cell->near_side_m / std::max(ray.norm(), 1e-3F) * ray - cell->mean_near_side;
      }
      if (batch.full()) batch.flush(d2_, pull_, sums);
      batch.add(*cell, offset, placed.lever, step.weight);
      if (exact_) add_exact_terms(*cell, offset, placed.lever, d2_, pull_ * step.weight, sums);
    }
    if (nearest == std::numeric_limits<float>::infinity()) return false;
    sums.nearest_squared += static_cast<double>(nearest);
    ++sums.matched;
    return true;
  }

  const NdtMap& target_;
  const NdtSource& source_;
  LocalPose local_;
  bool exact_;
  bool trilinear_;
  Neighbours fixed_{};
  int fixed_count_ = 0;
  float d2_ = 1.0F;    // of the (widened) kernel
  float pull_ = 1.0F;  // weight of a perfect match
};

void add_block(const NdtSums& block, MatchSums& to) {
  const float* from = block.hessian.data();
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) {
      const auto value = static_cast<double>(*from++);
      to.hessian(row, column) += value;
      if (column != row) to.hessian(column, row) += value;
    }
    to.gradient[row] += static_cast<double>(*from++);
    for (int column = 0; column < 6; ++column) {
      to.hessian(row, column) += static_cast<double>(
          block.exact[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)]);
    }
  }
  to.MatchCounts::operator+=(block);
}

}  // namespace

MatchSums ndt_cost(const NdtMap& target, const NdtSource& source, const Pose& target_from_source,
                   const NdtConfig& config, double widening, const NdtMap* coarser) {
  const Accumulator accumulator(target, source, target_from_source, config, widening);
  std::optional<Accumulator> fallback;
  if (coarser != nullptr) fallback.emplace(*coarser, source, target_from_source, config, widening);
  const std::size_t blocks = (source.size() + kBlock - 1) / kBlock;
  std::vector<NdtSums> sums(blocks);
  parallel_for(blocks, 2, [&](std::size_t b) {
    PointIndices which;
    const std::size_t end = std::min(source.size(), (b + 1) * kBlock);
    for (std::size_t i = b * kBlock; i < end; ++i)
      which.index[which.count++] = i;
    accumulator.add(which, sums[b]);
    if (!fallback || which.count == 0) return;
    // They pull, and are not counted as matched: shares and fitness are those of the finest cells.
    const std::size_t matched = sums[b].matched;
    const double nearest = sums[b].nearest_squared;
    fallback->add(which, sums[b]);
    sums[b].matched = matched;
    sums[b].nearest_squared = nearest;
  });
  MatchSums total;
  for (const NdtSums& block : sums)
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

}  // namespace understory
