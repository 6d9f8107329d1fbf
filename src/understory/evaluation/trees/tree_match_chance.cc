#include "understory/evaluation/trees/tree_match_chance.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <iterator>
#include <limits>

#include "understory/evaluation/evaluation_constants.h"
#include "understory/evaluation/trees/tree_errors.h"
#include "understory/util/fixed_text.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using namespace evaluation_constants::tree_match_chance;

double weight_of(const MergedTrees& merged, double radius_m) {
  const double share = radius_m > 0.0 ? std::pow(merged.apart_m / radius_m, 2.0) : 0.0;
  return static_cast<double>(merged.joined) * (1.0 - share);
}

// Shifted as a whole by more than a tree is looked for; what has no overlap any more is rare.
std::vector<Tree> shifted(std::vector<Tree> trees, double reach_m, Random& random) {
  const double angle = random.uniform(0.0, 2.0 * M_PI);
  const double length = random.uniform(kLeastShift, kMostShift) * reach_m;
  for (Tree& tree : trees) {
    tree.x += length * std::cos(angle);
    tree.y += length * std::sin(angle);
  }
  return trees;
}

// Seen in a mirror, which no motion undoes, and each tree beside its place.
std::vector<Tree> scrambled(std::vector<Tree> trees, double max_m, Random& random) {
  for (Tree& tree : trees) {
    const double angle = random.uniform(0.0, 2.0 * M_PI);
    const double length = max_m * std::sqrt(random.uniform(0.0, 1.0));
    tree.x = -tree.x + length * std::cos(angle);
    tree.y += length * std::sin(angle);
  }
  return trees;
}

// Sum of 1 - d^2 / r^2 over pairs within the radius.
double weight_of(const std::vector<Tree>& a, const std::vector<Tree>& b,
                 const std::vector<TreePair>& pairs, double radius_m) {
  double weight = 0.0;
  for (const auto& [i, j] : pairs)
    weight += 1.0 - std::pow(std::hypot(a[i].x - b[j].x, a[i].y - b[j].y) / radius_m, 2.0);
  return weight;
}

// Copies of `l` that lost the places of their trees, weighed against `s` by `weight_with`.
void judge_copies(const std::vector<Tree>& s, const std::vector<Tree>& l, double reach_m,
                  const std::function<double(const std::vector<Tree>&)>& weight_with, bool searched,
                  const ProgressSink& progress, MatchChance& chance) {
  constexpr std::uint64_t kSeed = 20'210'707;
  std::vector<double> found(searched ? kSearchedCopies : kShiftedCopies,
                            std::numeric_limits<double>::quiet_NaN());
  parallel_for(found.size(), 1, [&](std::size_t k) {
    progress.poll();
    Random random(kSeed, k);
    std::vector<Tree> copy =
        searched ? scrambled(l, k == 0 ? 0.0 : 2.0 * reach_m, random) : shifted(l, reach_m, random);
    if (searched) {
      const auto motion = align_trees(copy, s, Alignment::kYaw, reach_m, progress);
      if (!motion) return;
      copy = moved(copy, *motion);
    }
    found[k] = weight_with(copy);
  });
  std::vector<double> weights;
  std::copy_if(found.begin(), found.end(), std::back_inserter(weights),
               [](double w) { return std::isfinite(w); });
  chance.copies = static_cast<int>(weights.size());
  if (weights.empty()) return;
  const auto n = static_cast<double>(weights.size());
  for (const double w : weights)
    chance.chance_weight += w / n;
  for (const double w : weights)
    chance.chance_sd += std::pow(w - chance.chance_weight, 2.0);
  chance.chance_sd = n > 1.0 ? std::sqrt(chance.chance_sd / (n - 1.0)) : 0.0;
}

// `diameters`: of the trees of each pair, NaN where unknown.
void judge_diameters(const std::vector<Eigen::Vector2d>& diameters, MatchChance& chance) {
  std::vector<Eigen::Vector2d> pairs;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& dbh : diameters) {
    if (!dbh.allFinite()) continue;
    pairs.push_back(dbh);
    mean += dbh;
  }
  chance.diameters = pairs.size();
  chance.diameter_correlation = chance.diameter_sigmas = std::numeric_limits<double>::quiet_NaN();
  if (pairs.size() < kLeastDiameters) return;
  const auto n = static_cast<double>(pairs.size());
  mean /= n;
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const Eigen::Vector2d& pair : pairs)
    scatter += (pair - mean) * (pair - mean).transpose();
  if (scatter.diagonal().minCoeff() < n * kLeastSpreadM * kLeastSpreadM) return;
  chance.diameter_correlation = scatter(0, 1) / std::sqrt(scatter(0, 0) * scatter(1, 1));
  chance.diameter_sigmas =
      std::atanh(std::clamp(chance.diameter_correlation, -0.999999, 0.999999)) * std::sqrt(n - 3.0);
}

// The verdict from what was found.
void judge(MatchChance& chance) {
  chance.sigmas = (chance.weight - chance.chance_weight) /
                  std::max({1.0, chance.chance_sd, std::sqrt(chance.chance_weight)});
  chance.beyond_chance =
      chance.pairs >= kLeastPairs &&
      (chance.sigmas > kLeastSigmas || chance.diameter_sigmas > kLeastDiameterSigmas);
}

}  // namespace

MatchChance match_chance(const std::vector<Tree>& s, const std::vector<Tree>& l,
                         const MergedTrees& merged, double weight, const TreeMergeConfig& config,
                         bool searched, const ProgressSink& progress) {
  MatchChance chance;
  chance.pairs = merged.joined;
  chance.weight = weight_of(merged, config.duplicate_m);
  if (merged.joined == 0) return chance;
  judge_copies(
      s, l, config.reach_m,
      [&](const std::vector<Tree>& copy) {
        return weight_of(merge_trees(s, copy, weight, config), config.duplicate_m);
      },
      searched, progress, chance);
  std::vector<Eigen::Vector2d> diameters;
  for (std::size_t k = 0; k < merged.trees.size(); ++k) {
    if (merged.index_in_s[k] < 0 || merged.index_in_l[k] < 0) continue;
    diameters.emplace_back(s[static_cast<std::size_t>(merged.index_in_s[k])].dbh_m,
                           l[static_cast<std::size_t>(merged.index_in_l[k])].dbh_m);
  }
  judge_diameters(diameters, chance);
  judge(chance);
  return chance;
}

MatchChance match_chance(const std::vector<Tree>& a, const std::vector<Tree>& b,
                         const std::vector<TreePair>& pairs, double radius_m, bool searched,
                         const ProgressSink& progress) {
  MatchChance chance;
  chance.pairs = pairs.size();
  chance.weight = weight_of(a, b, pairs, radius_m);
  if (pairs.empty()) return chance;
  judge_copies(
      b, a, radius_m,
      [&](const std::vector<Tree>& copy) {
        return weight_of(copy, b, match_trees(copy, b, radius_m), radius_m);
      },
      searched, progress, chance);
  std::vector<Eigen::Vector2d> diameters;
  for (const auto& [i, j] : pairs)
    diameters.emplace_back(a[i].dbh_m, b[j].dbh_m);
  judge_diameters(diameters, chance);
  judge(chance);
  return chance;
}

std::string chance_complaint(const MatchChance& chance) {
  if (chance.beyond_chance) return {};
  std::string text = fmt::format(
      "the {} trees found in both maps are no more than chance explains. They agree with a score "
      "of {:.1f}, and random places of the second map's trees with {:.1f} +- {:.1f}",
      chance.pairs, chance.weight, chance.chance_weight, chance.chance_sd);
  if (std::isfinite(chance.diameter_correlation))
    text += fmt::format("; their diameters agree with a correlation of {}",
                        fixed_text(chance.diameter_correlation, 2));
  return text + ". The maps may be of different stands";
}

}  // namespace understory
