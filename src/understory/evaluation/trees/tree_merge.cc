#include "understory/evaluation/trees/tree_merge.h"

#include <cmath>

#include "understory/evaluation/trees/tree_errors.h"
#include "understory/geometry/plane/delaunay.h"
#include "understory/geometry/plane/plane_grid.h"

namespace understory {
namespace {

// About two spacings of stems: the field between trees is theirs, without steps.
constexpr double kFieldSdM = 4.0;
constexpr double kLeastFieldWeight = 1e-2;  // that of a tree 12 m away

Eigen::Vector2d place(const Tree& tree) {
  return {tree.x, tree.y};
}

// What is known at each node; nodes that know nothing weigh nothing.
struct Known {
  std::vector<Eigen::Vector2d> sum;
  std::vector<double> weight;
};

// (I + D^-1 A) / 2 on values and weights alike.
Known low_pass(const Known& in, const std::vector<std::vector<int>>& neighbours) {
  Known out = in;
  for (std::size_t i = 0; i < in.sum.size(); ++i) {
    if (neighbours[i].empty()) continue;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double weight = 0.0;
    for (const int j : neighbours[i]) {
      sum += in.sum[static_cast<std::size_t>(j)];
      weight += in.weight[static_cast<std::size_t>(j)];
    }
    const auto degree = static_cast<double>(neighbours[i].size());
    out.sum[i] = 0.5 * (in.sum[i] + sum / degree);
    out.weight[i] = 0.5 * (in.weight[i] + weight / degree);
  }
  return out;
}

std::vector<Tree> moved_by(const std::vector<Tree>& trees,
                           const std::vector<Eigen::Vector2d>& field, double share) {
  std::vector<Tree> result = trees;
  for (std::size_t i = 0; i < result.size(); ++i) {
    result[i].x += share * field[i].x();
    result[i].y += share * field[i].y();
  }
  return result;
}

// Of two sights of one tree: half way between, the rest from the one with more behind it.
Tree joined(const Tree& a, const Tree& b) {
  Tree tree = a.observations >= b.observations ? a : b;
  const Tree& other = a.observations >= b.observations ? b : a;
  tree.x = 0.5 * (a.x + b.x);
  tree.y = 0.5 * (a.y + b.y);
  tree.observations = a.observations + b.observations;
  const bool better =
      std::isfinite(other.dbh_m) && (!std::isfinite(tree.dbh_m) || other.dbh_sd_m < tree.dbh_sd_m);
  if (better) {
    tree.dbh_m = other.dbh_m;
    tree.dbh_sd_m = other.dbh_sd_m;
    tree.quality = other.quality;
  }
  if (tree.species.empty()) tree.species = other.species;
  if (!std::isfinite(tree.height_m)) {
    tree.height_m = other.height_m;
    tree.height_sd_m = other.height_sd_m;
    tree.height_is_lower_bound = other.height_is_lower_bound;
  }
  // Of two times the earlier one; of a tree that one of the lists alone misses, that one.
  tree.missing_since_s = std::fmin(tree.missing_since_s, other.missing_since_s);
  return tree;
}

}  // namespace

DeformationField deformation_field(const std::vector<Tree>& from, const std::vector<Tree>& to,
                                   const TreeMergeConfig& config) {
  SparsePoints targets;
  for (const Tree& tree : to)
    targets.emplace_back(tree.x, tree.y, 0.0);
  const PlaneGrid grid(targets);
  DeformationField field;
  std::vector<Eigen::Vector2d> places;
  Known known;
  std::size_t paired = 0;
  for (const Tree& tree : from) {
    places.push_back(place(tree));
    const auto found = targets.empty() ? PlaneGrid::Neighbour{}
                                       : grid.nearest({tree.x, tree.y, 0.0}, config.reach_m, 0.0);
    const bool has = found.index >= 0;
    Eigen::Vector2d v = Eigen::Vector2d::Zero();
    if (has) v = place(to[static_cast<std::size_t>(found.index)]) - places.back();
    field.raw.push_back(v);
    field.paired.push_back(has ? 1 : 0);
    field.mean_m += v.norm();
    paired += has ? 1 : 0;
    known.sum.push_back(v);
    known.weight.push_back(has ? 1.0 : 0.0);
  }
  if (paired > 0) field.mean_m /= static_cast<double>(paired);
  const std::vector<std::vector<int>> neighbours = natural_neighbours(places);
  if (neighbours.size() == places.size()) {
    for (int round = 0; round < 2 * config.smoothing; ++round)
      known = low_pass(known, neighbours);
  }
  for (std::size_t i = 0; i < from.size(); ++i)
    field.smoothed.push_back(known.weight[i] > 0.0 ? Eigen::Vector2d(known.sum[i] / known.weight[i])
                                                   : Eigen::Vector2d::Zero().eval());
  return field;
}

std::vector<Eigen::Vector2d> field_at(const std::vector<Tree>& from, const DeformationField& field,
                                      const std::vector<Eigen::Vector2d>& places) {
  SparsePoints points;
  for (const Tree& tree : from)
    points.emplace_back(tree.x, tree.y, 0.0);
  std::vector<Eigen::Vector2d> vectors(places.size(), Eigen::Vector2d::Zero());
  if (points.empty()) return vectors;
  const PlaneGrid grid(points);
  for (std::size_t i = 0; i < places.size(); ++i) {
    double weights = 0.0;
    grid.around({places[i].x(), places[i].y(), 0.0}, 3.0 * kFieldSdM, [&](std::size_t k) {
      const double squared = (points[k].head<2>() - places[i]).squaredNorm();
      const double weight = std::exp(-0.5 * squared / (kFieldSdM * kFieldSdM));
      vectors[i] += weight * field.smoothed[k];
      weights += weight;
    });
    if (weights >= kLeastFieldWeight) {
      vectors[i] /= weights;
    } else {
      vectors[i].setZero();
    }
  }
  return vectors;
}

MergedTrees merge_trees(const std::vector<Tree>& s, const std::vector<Tree>& l, double w,
                        const TreeMergeConfig& config) {
  const std::vector<Tree> a = moved_by(s, deformation_field(s, l, config).smoothed, w);
  const std::vector<Tree> b = moved_by(l, deformation_field(l, s, config).smoothed, 1.0 - w);
  std::vector<int> partner_of_a(a.size(), -1);
  std::vector<char> taken(b.size(), 0);
  MergedTrees result;
  for (const auto& [i, j] : match_trees(a, b, config.duplicate_m)) {
    partner_of_a[i] = static_cast<int>(j);
    taken[j] = 1;
    ++result.joined;
    result.apart_m += (place(a[i]) - place(b[j])).squaredNorm();
  }
  if (result.joined > 0)
    result.apart_m = std::sqrt(result.apart_m / static_cast<double>(result.joined));
  for (std::size_t i = 0; i < a.size(); ++i) {
    const int partner = partner_of_a[i];
    result.trees.push_back(partner < 0 ? a[i] : joined(a[i], b[static_cast<std::size_t>(partner)]));
    result.index_in_s.push_back(static_cast<int>(i));
    result.index_in_l.push_back(partner);
  }
  for (std::size_t j = 0; j < b.size(); ++j) {
    if (taken[j] != 0) continue;
    result.trees.push_back(b[j]);
    result.index_in_s.push_back(-1);
    result.index_in_l.push_back(static_cast<int>(j));
  }
  for (std::size_t k = 0; k < result.trees.size(); ++k)
    result.trees[k].id = static_cast<int>(k) + 1;
  return result;
}

}  // namespace understory
