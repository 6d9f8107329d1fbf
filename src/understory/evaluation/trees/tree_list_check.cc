#include "understory/evaluation/trees/tree_list_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <tuple>

#include "understory/evaluation/evaluation_constants.h"
#include "understory/util/median.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace evaluation_constants::tree_list_check;

// Place and observations.
using Row = std::tuple<double, double, int>;
Row row_of(const Tree& tree) {
  return {tree.x, tree.y, tree.observations};
}

std::vector<const Tree*> by_row(const std::vector<Tree>& trees) {
  std::vector<const Tree*> sorted;
  for (const Tree& tree : trees)
    sorted.push_back(&tree);
  sort_stably(sorted, [](const Tree* a, const Tree* b) { return row_of(*a) < row_of(*b); });
  return sorted;
}

// Whether both are known and not the same.
bool differ(double a, double b) {
  return std::isfinite(a) && std::isfinite(b) && a != b;
}

std::string unit_of_median(double median) {
  if (median < kThinnestMedianM) return "they look like kilometres";
  return median > kThickestCentimetres ? "they look like millimetres"
                                       : "they look like centimetres or inches";
}

}  // namespace

std::string diameter_complaint(const std::vector<Tree>& trees) {
  std::vector<double> known;
  for (const Tree& tree : trees)
    if (std::isfinite(tree.dbh_m) && tree.dbh_m > 0.0) known.push_back(tree.dbh_m);
  if (known.size() < kLeastKnown) return {};
  const double median = upper_median(known);
  if (median >= kThinnestMedianM && median <= kThickestMedianM) return {};
  return fmt::format("the median of {} diameters is {:.4g}, which are no metres: {}", known.size(),
                     median, unit_of_median(median));
}

std::string diameter_complaint(const std::vector<Tree>& a, const std::vector<Tree>& b,
                               const std::vector<TreePair>& pairs) {
  std::vector<double> ratios;
  for (const auto& [i, j] : pairs) {
    if (a[i].dbh_m > 0.0 && b[j].dbh_m > 0.0) ratios.push_back(b[j].dbh_m / a[i].dbh_m);
  }
  if (ratios.size() < kLeastKnown) return {};
  const double ratio = upper_median(ratios);
  if (ratio < kMostRatio && ratio > 1.0 / kMostRatio) return {};
  return fmt::format(
      "the diameters of the second list are {:.3g} times those of the first, over {} trees of "
      "both. One list is in another unit, or holds radii",
      ratio, ratios.size());
}

std::size_t doubled_rows(const std::vector<Tree>& trees) {
  const std::vector<const Tree*> rows = by_row(trees);
  std::size_t doubled = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Tree& tree = *rows[i];
    bool found = false;
    for (std::size_t j = i; !found && j-- > 0 && tree.x - rows[j]->x <= kOneStemM;)
      found = std::hypot(tree.x - rows[j]->x, tree.y - rows[j]->y) <= kOneStemM;
    doubled += found ? 1 : 0;
  }
  return doubled;
}

std::string doubles_complaint(const std::vector<Tree>& trees) {
  const std::size_t doubled = doubled_rows(trees);
  if (doubled < kLeastDoubles ||
      static_cast<double>(doubled) <= kMostDoubles * static_cast<double>(trees.size()))
    return {};
  return fmt::format(
      "{} of {} rows lie within {:.0f} cm of an earlier one: trees stand twice in it", doubled,
      trees.size(), 100.0 * kOneStemM);
}

bool are_copies(const std::vector<Tree>& a, const std::vector<Tree>& b) {
  const std::vector<const Tree*> of_a = by_row(a);
  const std::vector<const Tree*> of_b = by_row(b);
  std::size_t both = 0;
  std::size_t measured_anew = 0;
  for (auto i = of_a.begin(), j = of_b.begin(); i != of_a.end() && j != of_b.end();) {
    const Row row_i = row_of(**i);
    const Row row_j = row_of(**j);
    if (row_i == row_j) {
      ++both;
      measured_anew += differ((*i)->dbh_m, (*j)->dbh_m) || differ((*i)->height_m, (*j)->height_m);
    }
    if (row_i <= row_j) ++i;
    if (row_j <= row_i) ++j;
  }
  return both > 0 && 2 * both > std::min(a.size(), b.size()) &&
         static_cast<double>(measured_anew) <= kMostAnew * static_cast<double>(both);
}

}  // namespace understory
