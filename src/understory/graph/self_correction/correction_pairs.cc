#include "understory/graph/self_correction/correction_pairs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "understory/graph/graph_constants.h"
#include "understory/util/error.h"
#include "understory/util/index.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace graph_constants::correction_pairs;

// Different pairs (j, i) with gaps in the range, drawn at random, ascending.
std::vector<std::pair<int, int>> drawn_pairs(int views, const PairConfig& config,
                                             std::uint64_t seed) {
  const int longest = config.longest_gap > 0 ? std::min(config.longest_gap, views - 1) : views - 1;
  std::vector<std::pair<int, int>> pairs;
  if (longest < config.shortest_gap) return pairs;
  Random random(seed);
  for (int k = 0; k < config.tested; ++k) {
    const auto gap = config.shortest_gap + static_cast<int>(random.below(static_cast<std::uint64_t>(
                                               longest - config.shortest_gap + 1)));
    const auto j = static_cast<int>(random.below(static_cast<std::uint64_t>(views)));
    if (j + gap < views) pairs.emplace_back(j, j + gap);
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

}  // namespace

void describe(ConfigTable& table, PairConfig& config) {
  table.add_enum(
      "rule", config.rule,
      {{"poisson_disks", PairRule::kPoissonDisks}, {"delaunay_stars", PairRule::kDelaunayStars}},
      "how pairs are chosen: spread by Poisson disks, or by the association of Delaunay stars "
      "(this also gives the order)");
  table.add("tested", config.tested, {1, 100'000'000}, "",
            "number of pairs of views drawn at random");
  table.add("shortest_gap", config.shortest_gap, {1, 1'000'000}, "",
            "least number of views between the two of a pair");
  table.add("longest_gap", config.longest_gap, {0, 100'000'000}, "",
            "largest number of views between the two of a pair; 0: any");
  table.add("min_overlap", config.min_overlap, {0.0, 1.0}, "",
            "least overlap of the sectors that the two views see, by their poses");
  table.add("error_m", config.error_m, {0.0, 10.0}, "m",
            "largest mean match error of a pair without overlap");
  table.add("error_per_overlap_m", config.error_per_overlap_m, {0.0, 10.0}, "m",
            "increase of that limit from no overlap to full overlap");
  table.add("chosen", config.chosen, {1, 1'000'000}, "", "number of pairs chosen of those drawn");
  table.add("outlier_ratio", config.outlier_ratio, {0.0, 0.95}, "",
            "share of the stems left out of the mean match error");
}

bool acceptable(double error_m, double overlap, const PairConfig& config) {
  return error_m < config.error_m + overlap * config.error_per_overlap_m;
}

double placed_error(const SparseTarget& target, const SparsePoints& source,
                    const Pose& target_from_source, const ConeOverlap& overlap,
                    double outlier_ratio) {
  constexpr double kFar = 1e9;
  std::vector<double> distances;
  for (const Eigen::Vector3d& point : source) {
    const Eigen::Vector3d in_target = target_from_source * point;
    if (!overlap.holds(in_target)) continue;
    const auto found = target.grid.nearest(in_target, kFar, 0.0);
    if (found.index >= 0) distances.push_back(std::sqrt(found.squared_m2));
  }
  if (distances.size() < kFewestStems) return std::nan("");
  const auto keep = static_cast<std::size_t>(
      std::max(1.0, std::round((1.0 - outlier_ratio) * static_cast<double>(distances.size()))));
  std::sort(distances.begin(), distances.end());
  double sum = 0.0;
  for (std::size_t k = 0; k < keep; ++k)
    sum += distances[k];
  return sum / static_cast<double>(keep);
}

std::vector<CorrectionPair> promising_pairs(const std::vector<SparseTarget>& targets,
                                            const std::vector<Pose>& world_from_view,
                                            const ConeOverlap& overlap, const PairConfig& config,
                                            std::uint64_t seed) {
  UNDERSTORY_CHECK(targets.size() == world_from_view.size());
  const auto drawn = drawn_pairs(static_cast<int>(targets.size()), config, seed);
  std::vector<CorrectionPair> pairs(drawn.size());
  std::vector<char> good(drawn.size(), 0);
  parallel_for(drawn.size(), 64, [&](std::size_t k) {
    const auto [j, i] = drawn[k];
    CorrectionPair& pair = pairs[k];
    pair.j = j;
    pair.i = i;
    pair.overlap = overlap(world_from_view[at(i)], world_from_view[at(j)]);
    if (pair.overlap <= config.min_overlap) return;
    pair.error_m = placed_error(targets[at(j)], targets[at(i)].grid.points(),
                                world_from_view[at(j)].inverse() * world_from_view[at(i)], overlap,
                                config.outlier_ratio);
    good[k] = acceptable(pair.error_m, pair.overlap, config) ? 1 : 0;
  });
  std::vector<CorrectionPair> result;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    if (good[k] != 0) result.push_back(pairs[k]);
  }
  return result;
}

std::vector<CorrectionPair> poisson_disk_choice(const std::vector<CorrectionPair>& pairs,
                                                int wanted) {
  if (pairs.size() <= at(wanted)) return pairs;
  const auto [low_j, high_j] = std::minmax_element(
      pairs.begin(), pairs.end(), [](const auto& a, const auto& b) { return a.j < b.j; });
  const auto [low_i, high_i] = std::minmax_element(
      pairs.begin(), pairs.end(), [](const auto& a, const auto& b) { return a.i < b.i; });
  const double area = (high_j->j - low_j->j + 1.0) * (high_i->i - low_i->i + 1.0);
  using Grid = std::map<std::pair<long, long>, std::pair<double, std::size_t>>;
  // (28) and (29) at once: of every grid point that is the nearest to some pair, its nearest pair.
  const auto rounded = [&](double spacing) {
    Grid grid;
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      const long a = std::lround(pairs[k].j / spacing);
      const long b = std::lround(pairs[k].i / spacing);
      const double distance = std::hypot(pairs[k].j - static_cast<double>(a) * spacing,
                                         pairs[k].i - static_cast<double>(b) * spacing);
      const auto [found, added] = grid.try_emplace({a, b}, distance, k);
      if (!added && distance < found->second.first) found->second = {distance, k};
    }
    return grid;
  };
  double spacing = std::sqrt(area / wanted);
  Grid best = rounded(spacing);
  const auto off = [&](const Grid& grid) {
    return std::abs(static_cast<double>(grid.size()) - wanted);
  };
  while (best.size() < at(wanted) && spacing > kLeastSpacing) {
    spacing *= kSpacingStep;
    Grid finer = rounded(spacing);
    const bool better = off(finer) < off(best);
    const bool past = finer.size() >= at(wanted);
    if (better) best = std::move(finer);
    if (past) break;
  }
  std::vector<std::size_t> chosen;
  for (const auto& [cell, nearest] : best)
    chosen.push_back(nearest.second);
  std::sort(chosen.begin(), chosen.end());
  std::vector<CorrectionPair> result;
  for (const std::size_t k : chosen)
    result.push_back(pairs[k]);
  return result;
}

std::vector<CorrectionPair> ordered(std::vector<CorrectionPair> pairs, CorrectionOrder order,
                                    std::uint64_t seed) {
  if (pairs.empty()) return pairs;
  if (order == CorrectionOrder::kRandom) {
    Random random(seed);
    for (std::size_t k = pairs.size() - 1; k > 0; --k)
      std::swap(pairs[k], pairs[random.below(k + 1)]);
    return pairs;
  }
  int middle = 0;
  if (order == CorrectionOrder::kMediumGaps) {
    std::vector<int> gaps;
    for (const CorrectionPair& pair : pairs)
      gaps.push_back(pair.gap());
    std::nth_element(gaps.begin(), gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2),
                     gaps.end());
    middle = gaps[gaps.size() / 2];
  }
  sort_stably(pairs, [&](const auto& a, const auto& b) {
    return std::abs(a.gap() - middle) < std::abs(b.gap() - middle);
  });
  return pairs;
}

std::vector<CorrectionPair> lattice_pairs(int views, int spacing, int longest_gap) {
  std::vector<CorrectionPair> pairs;
  for (int i = spacing; i < views; i += spacing) {
    for (int gap = longest_gap / spacing * spacing; gap > 0; gap -= spacing) {
      if (gap > i) continue;
      CorrectionPair pair;
      pair.j = i - gap;
      pair.i = i;
      pairs.push_back(pair);
    }
  }
  return pairs;
}

}  // namespace understory
