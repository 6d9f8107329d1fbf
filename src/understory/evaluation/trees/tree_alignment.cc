#include <algorithm>
#include <cmath>
#include <tuple>

#include "understory/evaluation/evaluation_constants.h"
#include "understory/evaluation/plane_cells.h"
#include "understory/evaluation/trees/tree_errors.h"

namespace understory {
namespace {

using namespace evaluation_constants::tree_alignment;

// Two trees of one list and their distance.
struct Span {
  double length;
  std::size_t from;
  std::size_t to;
};

// In ascending order of both indices.
std::vector<Span> spans(const std::vector<Tree>& trees, bool both_directions) {
  const PlaneCells cells(
      trees.size(), kMaxPairM, [&](std::size_t k) { return trees[k].x; },
      [&](std::size_t k) { return trees[k].y; });
  std::vector<Span> result;
  std::vector<Span> of_one;
  for (std::size_t i = 0; i < trees.size(); ++i) {
    of_one.clear();
    cells.around(trees[i].x, trees[i].y, [&](std::size_t j) {
      if (i == j || (!both_directions && j < i)) return;
      const double x = trees[i].x - trees[j].x;
      const double y = trees[i].y - trees[j].y;
      const double square = x * x + y * y;  // most pairs are too long, and roots are slow
      if (square > kMaxPairM * kMaxPairM || square < kMinPairM * kMinPairM) return;
      of_one.push_back({std::sqrt(square), i, j});
    });
    std::sort(of_one.begin(), of_one.end(),
              [](const Span& p, const Span& q) { return p.to < q.to; });
    result.insert(result.end(), of_one.begin(), of_one.end());
  }
  return result;
}

// Every n-th, so that at most `limit` are left, spread over the whole list.
template <typename T>
std::vector<T> thinned(const std::vector<T>& all, std::size_t limit) {
  if (all.size() <= limit) return all;
  std::vector<T> result;
  for (std::size_t k = 0; k < limit; ++k)
    result.push_back(all[k * all.size() / limit]);
  return result;
}

Pose from_spans(const std::vector<Tree>& a, const Span& pa, const std::vector<Tree>& b,
                const Span& pb) {
  const double yaw_a = std::atan2(a[pa.to].y - a[pa.from].y, a[pa.to].x - a[pa.from].x);
  const double yaw_b = std::atan2(b[pb.to].y - b[pb.from].y, b[pb.to].x - b[pb.from].x);
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(yaw_b - yaw_a, Eigen::Vector3d::UnitZ()));
  const auto middle = [](const Tree& s, const Tree& t) {
    return Eigen::Vector3d(0.5 * (s.x + t.x), 0.5 * (s.y + t.y), 0.5 * (s.z + t.z));
  };
  return {rotation, middle(b[pb.from], b[pb.to]) - rotation * middle(a[pa.from], a[pa.to])};
}

// Trees of B in square cells, for counting matches quickly.
class TreeGrid {
 public:
  TreeGrid(const std::vector<Tree>& trees, double radius_m) : trees_(trees), cell_m_(radius_m) {
    low_x_ = low_y_ = 0.0;
    double high_x = 0.0;
    double high_y = 0.0;
    for (std::size_t i = 0; i < trees.size(); ++i) {
      low_x_ = i == 0 ? trees[i].x : std::min(low_x_, trees[i].x);
      low_y_ = i == 0 ? trees[i].y : std::min(low_y_, trees[i].y);
      high_x = i == 0 ? trees[i].x : std::max(high_x, trees[i].x);
      high_y = i == 0 ? trees[i].y : std::max(high_y, trees[i].y);
    }
    // No more than a million cells however far apart the trees are.
    cell_m_ = std::max({radius_m, (high_x - low_x_) / 1000.0, (high_y - low_y_) / 1000.0});
    columns_ = static_cast<long>((high_x - low_x_) / cell_m_) + 1;
    rows_ = static_cast<long>((high_y - low_y_) / cell_m_) + 1;
    cells_.resize(static_cast<std::size_t>(columns_ * rows_));
    for (std::size_t i = 0; i < trees.size(); ++i) {
      cells_[static_cast<std::size_t>(column(trees[i].x) + columns_ * row(trees[i].y))].push_back(
          i);
    }
  }

  [[nodiscard]] bool any_within(double x, double y, double radius_m) const {
    for (long r = row(y) - 1; r <= row(y) + 1; ++r) {
      for (long c = column(x) - 1; c <= column(x) + 1; ++c) {
        if (r < 0 || c < 0 || r >= rows_ || c >= columns_) continue;
        for (const std::size_t i : cells_[static_cast<std::size_t>(c + columns_ * r)]) {
          const double dx = trees_[i].x - x;
          const double dy = trees_[i].y - y;
          if (dx * dx + dy * dy <= radius_m * radius_m) return true;
        }
      }
    }
    return false;
  }

 private:
  [[nodiscard]] long column(double x) const {
    return static_cast<long>(std::floor((x - low_x_) / cell_m_));
  }
  [[nodiscard]] long row(double y) const {
    return static_cast<long>(std::floor((y - low_y_) / cell_m_));
  }

  const std::vector<Tree>& trees_;
  double cell_m_;
  double low_x_;
  double low_y_;
  long columns_ = 0;
  long rows_ = 0;
  std::vector<std::vector<std::size_t>> cells_;
};

// How many trees of A fall on one of B; 0 as soon as they can be no more than `to_beat`.
std::size_t count_near(const std::vector<Tree>& a, const Pose& b_from_a, const TreeGrid& grid,
                       double radius_m, std::size_t to_beat) {
  const double c = b_from_a.rotation_matrix()(0, 0);
  const double s = b_from_a.rotation_matrix()(1, 0);
  const Eigen::Vector3d& t = b_from_a.translation();
  std::size_t count = 0;
  std::size_t left = a.size();
  for (const Tree& tree : a) {
    if (count + left-- <= to_beat) return 0;
    const double x = c * tree.x - s * tree.y + t.x();
    const double y = s * tree.x + c * tree.y + t.y();
    count += grid.any_within(x, y, radius_m) ? 1 : 0;
  }
  return count;
}

std::optional<Pose> best_hypothesis(const std::vector<Tree>& a, const std::vector<Tree>& b,
                                    double radius_m, const ProgressSink& progress) {
  std::vector<Span> spans_b = spans(b, true);
  std::sort(spans_b.begin(), spans_b.end(), [](const Span& p, const Span& q) {
    return std::tie(p.length, p.from, p.to) < std::tie(q.length, q.from, q.to);
  });
  const TreeGrid grid(b, radius_m);
  const std::vector<Tree> counted = thinned(a, a.size() > kMany ? kCountedOfMany : kMany);
  std::optional<Pose> best;
  std::size_t best_count = kMinMatches - 1;
  std::size_t tried = 0;
  for (const Span& span : thinned(spans(a, false), kMaxPairsOfA)) {
    progress.poll();
    const double slack = 0.5 * radius_m;
    auto at = std::lower_bound(
        spans_b.begin(), spans_b.end(), span.length - slack,
        [](const Span& candidate, double length) { return candidate.length < length; });
    for (; at != spans_b.end() && at->length <= span.length + slack; ++at) {
      if (++tried > kMaxHypotheses) return best;
      const Pose b_from_a = from_spans(a, span, b, *at);
      const std::size_t count = count_near(counted, b_from_a, grid, radius_m, best_count);
      if (count <= best_count) continue;
      best_count = count;
      best = b_from_a;
    }
  }
  return best;
}

}  // namespace

std::optional<Pose> align_trees(const std::vector<Tree>& a, const std::vector<Tree>& b,
                                Alignment alignment, double radius_m,
                                const ProgressSink& progress) {
  std::optional<Pose> b_from_a = best_hypothesis(a, b, radius_m, progress);
  if (!b_from_a) return b_from_a;
  std::vector<TreePair> previous;
  for (int k = 0; k < kMaxIterations; ++k) {
    const std::vector<TreePair> pairs = match_trees(moved(a, *b_from_a), b, radius_m);
    if (pairs.size() < kMinMatches) return std::nullopt;
    if (pairs == previous) break;
    std::vector<Eigen::Vector3d> source;
    std::vector<Eigen::Vector3d> target;
    for (const auto& [i, j] : pairs) {
      source.emplace_back(a[i].x, a[i].y, a[i].z);
      target.emplace_back(b[j].x, b[j].y, b[j].z);
    }
    b_from_a = (alignment == Alignment::kSe3 ? align_points_se3(source, target)
                                             : align_points_yaw(source, target))
                   .target_from_source;
    previous = pairs;
  }
  return b_from_a;
}

}  // namespace understory
