#include "understory/evaluation/trees/tree_changes.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "understory/evaluation/evaluation_constants.h"
#include "understory/util/error.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace evaluation_constants::tree_changes;

// The value below which a share of the values lies; NaN of too few.
double quantile_of(std::vector<double> values, double share) {
  if (values.size() < kLeastTrees) return Tree::kUnknown;
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

// Spread of values as a standard deviation that single wrong ones do not move; NaN of too few.
double spread_of(const std::vector<double>& values) {
  if (values.size() < kLeastTrees) return Tree::kUnknown;
  const double middle = upper_median(values);
  std::vector<double> apart;
  for (const double value : values)
    apart.push_back(std::abs(value - middle));
  const double spread = kSdOverMad * upper_median(apart);
  return spread > 0.0 ? spread : Tree::kUnknown;  // copied values have no errors to tell
}

// Whether the tree may be higher than its height says. Neither that nor the volume below it tells
// growth then.
bool may_be_higher(const Tree& tree) {
  return tree.height_is_lower_bound > 0.5;  // not where it is not known
}

// Fills one increment of every tree that stays.
IncrementSummary add_increments(const std::vector<Tree>& old_trees,
                                const std::vector<Tree>& new_trees, double Tree::*figure,
                                double Tree::*sd_of, Increment TreeChange::*increment,
                                std::vector<TreeChange>& changes) {
  IncrementSummary summary;
  std::vector<double> values;
  bool lacks_sd = false;
  for (TreeChange& change : changes) {
    if (change.fate != TreeFate::kStays) continue;
    const Tree& before = old_trees[*change.in_old];
    const Tree& after = new_trees[*change.in_new];
    if (figure != &Tree::dbh_m && (may_be_higher(before) || may_be_higher(after))) continue;
    Increment& each = change.*increment;
    each.value = after.*figure - before.*figure;
    if (!std::isfinite(each.value)) continue;
    each.sd = std::hypot(before.*sd_of, after.*sd_of);
    lacks_sd = lacks_sd || !std::isfinite(each.sd);
    values.push_back(each.value);
  }
  if (lacks_sd) summary.stand_in_sd = spread_of(values);
  double sum = 0.0;
  for (TreeChange& change : changes) {
    Increment& each = change.*increment;
    if (!std::isfinite(each.value)) continue;
    if (!std::isfinite(each.sd)) each.sd = summary.stand_in_sd;
    each.significant = std::abs(each.value) > kSignificance * each.sd;
    (each.value > 0.0 ? summary.grown : summary.shrunk) += each.significant ? 1 : 0;
    sum += each.value;
  }
  summary.known = values.size();
  if (values.empty()) return summary;
  const auto n = static_cast<double>(values.size());
  summary.mean = sum / n;
  double squares = 0.0;
  for (const double value : values)
    squares += std::pow(value - summary.mean, 2.0);
  if (values.size() > 1) summary.mean_sd = std::sqrt(squares / (n - 1.0) / n);
  return summary;
}

// Thicker trees cannot be new: OLD lists trees from a diameter on, and it takes the fastest growth.
double ingrowth_limit(const std::vector<Tree>& old_trees, const std::vector<TreeChange>& changes) {
  std::vector<double> diameters;
  std::vector<double> increments;
  for (const Tree& tree : old_trees)
    if (std::isfinite(tree.dbh_m)) diameters.push_back(tree.dbh_m);
  for (const TreeChange& change : changes)
    if (std::isfinite(change.dbh_m.value)) increments.push_back(change.dbh_m.value);
  return quantile_of(std::move(diameters), kThinShare) +
         std::max(0.0, quantile_of(std::move(increments), kFastShare));
}

// What OLD missed among the thick trees, and so what NEW may have missed among the gone.
void judge_missed(const std::vector<Tree>& new_trees, const EpochArea& old_area,
                  TreeChanges& result) {
  if (!std::isfinite(result.ingrowth_limit_m)) return;
  std::size_t thick = 0;
  for (const Tree& tree : new_trees)
    if (tree.dbh_m > result.ingrowth_limit_m && old_area.holds(tree.x, tree.y)) ++thick;
  if (thick == 0) return;
  result.missed_share =
      static_cast<double>(result.count(TreeFate::kMissedBefore)) / static_cast<double>(thick);
  const std::size_t gone = result.count(TreeFate::kGone);
  // Of the trees that stand, a share is missed; those found are the rest of them.
  const double found = static_cast<double>(result.count(TreeFate::kStays));
  const double missed = result.missed_share < 1.0
                            ? found * result.missed_share / (1.0 - result.missed_share)
                            : static_cast<double>(gone);
  result.expected_missed = std::min(missed, static_cast<double>(gone));
  result.expected_missed_sd = std::sqrt(result.expected_missed);
}

}  // namespace

std::string to_string(TreeFate fate) {
  switch (fate) {
    case TreeFate::kStays:
      return "stays";
    case TreeFate::kGone:
      return "gone";
    case TreeFate::kNew:
      return "new";
    case TreeFate::kMissedBefore:
      return "missed_before";
    case TreeFate::kOutsideNew:
      return "outside_new";
    case TreeFate::kOutsideOld:
      return "outside_old";
  }
  throw InternalError("no such fate of a tree");
}

bool TreeChanges::misfit() const {
  return missed_share > kMostMissedShare;
}

TreeChanges tree_changes(const std::vector<Tree>& old_trees, const std::vector<Tree>& new_trees,
                         const std::vector<TreePair>& pairs, const EpochArea& old_area,
                         const EpochArea& new_area) {
  TreeChanges result;
  std::vector<bool> paired(new_trees.size(), false);
  for (std::size_t i = 0; i < old_trees.size(); ++i) {
    TreeChange& change = result.trees.emplace_back();
    change.in_old = i;
    change.fate =
        new_area.holds(old_trees[i].x, old_trees[i].y) ? TreeFate::kGone : TreeFate::kOutsideNew;
  }
  for (const auto& [i, j] : pairs) {
    result.trees[i].in_new = j;
    result.trees[i].fate = TreeFate::kStays;
    paired[j] = true;
  }
  result.dbh = add_increments(old_trees, new_trees, &Tree::dbh_m, &Tree::dbh_sd_m,
                              &TreeChange::dbh_m, result.trees);
  result.height = add_increments(old_trees, new_trees, &Tree::height_m, &Tree::height_sd_m,
                                 &TreeChange::height_m, result.trees);
  result.volume = add_increments(old_trees, new_trees, &Tree::stem_volume_m3,
                                 &Tree::stem_volume_sd_m3, &TreeChange::volume_m3, result.trees);
  result.ingrowth_limit_m = ingrowth_limit(old_trees, result.trees);
  for (std::size_t j = 0; j < new_trees.size(); ++j) {
    if (paired[j]) continue;
    const Tree& tree = new_trees[j];
    TreeChange& change = result.trees.emplace_back();
    change.in_new = j;
    change.fate = !old_area.holds(tree.x, tree.y)        ? TreeFate::kOutsideOld
                  : tree.dbh_m > result.ingrowth_limit_m ? TreeFate::kMissedBefore
                                                         : TreeFate::kNew;
  }
  for (const TreeChange& change : result.trees)
    ++result.counts[static_cast<std::size_t>(change.fate)];
  judge_missed(new_trees, old_area, result);
  return result;
}

}  // namespace understory
