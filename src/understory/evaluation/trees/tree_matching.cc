#include "understory/evaluation/trees/tree_matching.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "understory/evaluation/evaluation_constants.h"
#include "understory/evaluation/plane_cells.h"
#include "understory/evaluation/sparse_assignment.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace evaluation_constants::tree_matching;

double distance_in_plane(const Tree& a, const Tree& b) {
  return std::hypot(a.x - b.x, a.y - b.y);
}

PlaneCells cells_of(const std::vector<Tree>& trees, double radius_m) {
  return PlaneCells(
      trees.size(), radius_m, [&](std::size_t k) { return trees[k].x; },
      [&](std::size_t k) { return trees[k].y; });
}

}  // namespace

std::vector<TreePair> match_trees(const std::vector<Tree>& a, const std::vector<Tree>& b,
                                  double radius_m) {
  struct Candidate {
    double distance;
    std::size_t i;
    std::size_t j;
  };
  std::vector<Candidate> candidates;
  const PlaneCells cells = cells_of(b, radius_m);
  for (std::size_t i = 0; i < a.size(); ++i) {
    cells.around(a[i].x, a[i].y, [&](std::size_t j) {
      const double distance = distance_in_plane(a[i], b[j]);
      if (distance <= radius_m) candidates.push_back({distance, i, j});
    });
  }
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& p, const Candidate& q) {
    return std::tie(p.distance, p.i, p.j) < std::tie(q.distance, q.i, q.j);
  });
  std::vector<bool> taken_a(a.size(), false);
  std::vector<bool> taken_b(b.size(), false);
  std::vector<TreePair> pairs;
  for (const Candidate& c : candidates) {
    if (taken_a[c.i] || taken_b[c.j]) continue;
    taken_a[c.i] = taken_b[c.j] = true;
    pairs.emplace_back(c.i, c.j);
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

double pair_cost(const Tree& a, const Tree& b, const TreeAssignmentConfig& config) {
  const double place = distance_in_plane(a, b) / config.radius_m;
  const double largest = std::max(a.dbh_m, b.dbh_m);
  double diameter = kUnknownDiameterCost;
  if (std::isfinite(a.dbh_m) && std::isfinite(b.dbh_m) && largest > 0.0) {
    const double share = std::abs(a.dbh_m - b.dbh_m) / (config.diameter_share * largest);
    diameter = std::min(1.0, share * share);
  }
  return place * place + diameter;
}

std::vector<TreePair> assign_trees(const std::vector<Tree>& a, const std::vector<Tree>& b,
                                   const TreeAssignmentConfig& config) {
  SparseCosts costs;
  costs.columns = b.size();
  const PlaneCells cells = cells_of(b, config.radius_m);
  for (const Tree& tree : a) {
    cells.around(tree.x, tree.y, [&](std::size_t j) {
      if (distance_in_plane(tree, b[j]) <= config.radius_m)
        costs.edges.push_back({j, pair_cost(tree, b[j], config)});
    });
    if (costs.edges.size() > config.most_pairs)
      throw InputError("tree lists", "",
                       fmt::format("more than {} pairs of trees lie within {:g} m of one another; "
                                   "expected a smaller radius, or lists that hold each tree once",
                                   config.most_pairs, config.radius_m));
    costs.first.push_back(costs.edges.size());
  }
  std::vector<TreePair> pairs;
  const std::vector<std::size_t> column_of = least_cost_assignment(costs, kUnmatchedCost);
  for (std::size_t i = 0; i < a.size(); ++i)
    if (column_of[i] != kNoColumn) pairs.emplace_back(i, column_of[i]);
  return pairs;
}

}  // namespace understory
