#include "understory/pipeline/correction/correction_figures.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "understory/graph/loops/view_cone.h"
#include "understory/graph/self_correction/correction_pairs.h"
#include "understory/odometry/stems/stem_levelling.h"
#include "understory/pipeline/pipeline_constants.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using namespace pipeline_constants::correction_figures;

// Views with z up, and where they stand.
struct Placed {
  std::vector<SparsePoints> points;
  std::vector<Pose> before;
  std::vector<Pose> after;
};

Placed place(const CorrectionRun& run) {
  const std::size_t n = run.views.size();
  Placed placed;
  placed.points.resize(n);
  placed.before.resize(n);
  placed.after.resize(n);
  parallel_for(n, 16, [&](std::size_t i) {
    const Eigen::Quaterniond level =
        level_from_body(stem_up(run.views[i], run.steps[i].up.up_in_body));
    const Pose body_from_level(level.inverse(), Eigen::Vector3d::Zero());
    placed.points[i] = stem_points(run.views[i], level);
    placed.before[i] = run.steps[i].world_from_body * body_from_level;
    placed.after[i] = run.correction.world_from_body[i] * body_from_level;
  });
  return placed;
}

std::vector<ReportPair> drawn_pairs(const Placed& placed, const SelfCorrectionConfig& config) {
  const auto views = static_cast<std::uint64_t>(placed.points.size());
  const ConeOverlap overlap(estimate_view_cone(placed.points));
  Random random(static_cast<std::uint64_t>(config.seed));
  std::vector<ReportPair> pairs(views > 2 ? kPairs : 0);
  const std::uint64_t longest =
      config.pairs.longest_gap > 0 ? static_cast<std::uint64_t>(config.pairs.longest_gap) : views;
  for (ReportPair& pair : pairs) {
    const std::uint64_t earlier = random.below(views - 1);
    pair.earlier = static_cast<int>(earlier);
    pair.later =
        static_cast<int>(earlier + 1 + random.below(std::min(longest, views - 1 - earlier)));
  }
  std::vector<std::optional<SparseTarget>> targets(placed.points.size());
  parallel_for(targets.size(), 16, [&](std::size_t i) { targets[i].emplace(placed.points[i]); });
  parallel_for(pairs.size(), 32, [&](std::size_t k) {
    ReportPair& pair = pairs[k];
    const auto j = static_cast<std::size_t>(pair.earlier);
    const auto i = static_cast<std::size_t>(pair.later);
    pair.overlap = overlap(placed.before[i], placed.before[j]);
    if (pair.overlap <= 0.0) return;
    pair.error_m =
        placed_error(*targets[j], placed.points[i], placed.before[j].inverse() * placed.before[i],
                     overlap, config.pairs.outlier_ratio);
    pair.acceptable = pair.overlap > config.pairs.min_overlap &&
                      acceptable(pair.error_m, pair.overlap, config.pairs);
  });
  std::erase_if(pairs, [](const ReportPair& pair) {
    return pair.overlap <= 0.0 || !std::isfinite(pair.error_m);
  });
  return pairs;
}

// Share of the later view's stems that fall near one of the earlier's, and their mean distance.
void compare(const PlaneGrid& earlier, const SparsePoints& later, const Pose& earlier_from_later,
             float& overlap, float& error_m) {
  double sum = 0.0;
  double near = 0.0;
  for (const Eigen::Vector3d& point : later) {
    const auto found = earlier.nearest(earlier_from_later * point, kSame, 0.0);
    if (found.index < 0) continue;
    near += 1.0;
    sum += std::sqrt(found.squared_m2);
  }
  const double share = later.empty() ? 0.0 : near / static_cast<double>(later.size());
  overlap = static_cast<float>(share);
  if (share >= 0.1) error_m = static_cast<float>(sum / near);
}

ReportViewMatrix matrix_of(const Placed& placed, const std::vector<Pose>& world_from_view) {
  ReportViewMatrix matrix;
  const auto views = static_cast<int>(placed.points.size());
  matrix.views = views;
  matrix.side = std::min(views, kMatrix);
  const auto side = static_cast<std::size_t>(matrix.side);
  matrix.overlap.assign(side * side, std::nanf(""));
  matrix.error_m.assign(side * side, std::nanf(""));
  const auto view_at = [&](std::size_t k) {
    return k * static_cast<std::size_t>(views) / std::max<std::size_t>(1, side);
  };
  parallel_for(side, 4, [&](std::size_t row) {
    const std::size_t j = view_at(row);
    const PlaneGrid grid(placed.points[j]);
    const Pose view_from_world = world_from_view[j].inverse();
    for (std::size_t column = row; column < side; ++column) {
      const std::size_t i = view_at(column);
      if (placed.points[j].empty()) continue;
      compare(grid, placed.points[i], view_from_world * world_from_view[i],
              matrix.overlap[row * side + column], matrix.error_m[row * side + column]);
    }
  });
  return matrix;
}

std::vector<Eigen::Vector2f> sights_of(const Placed& placed, const std::vector<Pose>& poses) {
  std::vector<Eigen::Vector2f> sights;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    for (const Eigen::Vector3d& point : placed.points[i])
      sights.emplace_back((poses[i] * point).head<2>().cast<float>());
  }
  return sights;
}

// Where the correction moved the map most.
Eigen::Vector2f max_moved(const Placed& placed) {
  Eigen::Vector2f place = Eigen::Vector2f::Zero();
  double most = -1.0;
  for (std::size_t i = 0; i < placed.after.size(); ++i) {
    const double moved =
        (placed.after[i].translation() - placed.before[i].translation()).head<2>().norm();
    if (moved <= most) continue;
    most = moved;
    place = placed.after[i].translation().head<2>().cast<float>();
  }
  return place;
}

// Trees per hectare in rings about the way, by cells of a metre.
std::vector<double> density_of(const std::vector<Tree>& trees, const std::vector<Pose>& path) {
  SparsePoints way;
  for (const Pose& pose : path) {
    const Eigen::Vector3d at(pose.translation().x(), pose.translation().y(), 0.0);
    if (way.empty() || (at - way.back()).norm() > 1.0) way.push_back(at);
  }
  if (way.empty()) return {};
  const PlaneGrid grid(way);
  std::vector<double> counts(kRings, 0.0);
  std::vector<double> cells(kRings, 0.0);
  const auto count = [&](double x, double y, std::vector<double>& rings) {
    const auto found = grid.nearest({x, y, 0.0}, kRing * kRings, 0.0);
    const auto ring = static_cast<std::size_t>(std::sqrt(found.squared_m2) / kRing);
    if (found.index >= 0 && ring < rings.size()) rings[ring] += 1.0;
  };
  Eigen::Vector2d low = way.front().head<2>();
  Eigen::Vector2d high = low;
  for (const Eigen::Vector3d& at : way) {
    low = low.cwiseMin(at.head<2>());
    high = high.cwiseMax(at.head<2>());
  }
  const double reach = kRing * kRings;
  for (double x = low.x() - reach; x <= high.x() + reach; x += 1.0) {
    for (double y = low.y() - reach; y <= high.y() + reach; y += 1.0)
      count(x, y, cells);
  }
  for (const Tree& tree : trees)
    count(tree.x, tree.y, counts);
  for (std::size_t k = 0; k < counts.size(); ++k)
    counts[k] = cells[k] > 0.0 ? 1e4 * counts[k] / cells[k] : 0.0;
  return counts;
}

}  // namespace

void add_correction_figures(const CorrectionRun& run, const StemCorrectionConfig& config,
                            const std::vector<Tree>& trees, ReportCorrection& report) {
  const Placed placed = place(run);
  report.acceptable_m = config.correction.pairs.error_m;
  report.acceptable_per_overlap_m = config.correction.pairs.error_per_overlap_m;
  report.min_overlap = config.correction.pairs.min_overlap;
  report.pairs = drawn_pairs(placed, config.correction);
  report.matrix_before = matrix_of(placed, placed.before);
  report.matrix_after = matrix_of(placed, placed.after);
  report.sights_before = sights_of(placed, placed.before);
  report.sights_after = sights_of(placed, placed.after);
  report.max_moved = max_moved(placed);
  report.ring_m = kRing;
  report.trees_per_ha = density_of(trees, placed.after);
}

}  // namespace understory
