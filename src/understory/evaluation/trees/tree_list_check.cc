#include "understory/evaluation/trees/tree_list_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <tuple>

#include "understory/evaluation/evaluation_constants.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace evaluation_constants::tree_list_check;

// Place and observations.
using Row = std::tuple<double, double, int>;
std::vector<Row> sorted_rows(const std::vector<Tree>& trees) {
  std::vector<Row> rows;
  for (const Tree& tree : trees)
    rows.emplace_back(tree.x, tree.y, tree.observations);
  std::sort(rows.begin(), rows.end());
  return rows;
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
  const std::vector<Row> rows = sorted_rows(trees);
  std::size_t doubled = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto& [x, y, seen] = rows[i];
    bool found = false;
    for (std::size_t j = i; !found && j-- > 0 && x - std::get<0>(rows[j]) <= kOneStemM;)
      found = std::hypot(x - std::get<0>(rows[j]), y - std::get<1>(rows[j])) <= kOneStemM;
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
  const std::vector<Row> of_a = sorted_rows(a);
  const std::vector<Row> of_b = sorted_rows(b);
  std::vector<Row> both;
  std::set_intersection(of_a.begin(), of_a.end(), of_b.begin(), of_b.end(),
                        std::back_inserter(both));
  return !both.empty() && 2 * both.size() > std::min(a.size(), b.size());
}

}  // namespace understory
