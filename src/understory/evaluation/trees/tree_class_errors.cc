#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "understory/evaluation/evaluation_constants.h"
#include "understory/evaluation/trees/tree_errors.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace evaluation_constants::tree_class_errors;

// Root mean square and mean of the differences that are numbers.
struct Differences {
  double sum = 0.0;
  double sum_of_squares = 0.0;
  std::size_t n = 0;
  void add(double d) {
    if (!std::isfinite(d)) return;
    sum += d;
    sum_of_squares += d * d;
    ++n;
  }
  [[nodiscard]] double mean() const {
    return n == 0 ? Tree::kUnknown : sum / static_cast<double>(n);
  }
  [[nodiscard]] double rms() const {
    return n == 0 ? Tree::kUnknown : std::sqrt(sum_of_squares / static_cast<double>(n));
  }
};

double share_of(std::size_t part, std::size_t whole) {
  return whole == 0 ? Tree::kUnknown : static_cast<double>(part) / static_cast<double>(whole);
}

double radius_of(const Tree& tree) {
  return std::isfinite(tree.dbh_m) ? 0.5 * tree.dbh_m : 0.0;
}

// The trees of one group.
struct GroupErrors {
  TreeErrors counts;
  Differences distance;
  Differences x;
  Differences y;
  Differences dbh;
  Differences height;
  Differences volume;

  void add(const Tree& a, const Tree& b) {
    ++counts.matched;
    const double d = std::hypot(a.x - b.x, a.y - b.y);
    counts.overlapping += d <= radius_of(a) + radius_of(b) ? 1 : 0;
    distance.add(d);
    x.add(a.x - b.x);
    y.add(a.y - b.y);
    dbh.add(a.dbh_m - b.dbh_m);
    height.add(a.height_m - b.height_m);
    volume.add(a.stem_volume_m3 - b.stem_volume_m3);
  }

  [[nodiscard]] TreeErrors errors() const {
    TreeErrors result = counts;
    result.recall = share_of(counts.matched, counts.trees_b);
    result.precision = share_of(counts.matched, counts.trees_a);
    result.overlapping_tree_ratio = share_of(counts.overlapping, counts.trees_b);
    result.position_rmse_m = distance.rms();
    result.x_bias_m = x.mean();
    result.y_bias_m = y.mean();
    result.dbh_rmse_m = dbh.rms();
    result.dbh_bias_m = dbh.mean();
    result.height_rmse_m = height.rms();
    result.height_bias_m = height.mean();
    result.volume_rmse_m3 = volume.rms();
    result.volume_bias_m3 = volume.mean();
    return result;
  }
};

// The class of each diameter; -1 without one.
std::vector<int> classes_of(const std::vector<Tree>& trees, double width_m) {
  std::vector<int> result;
  for (const Tree& tree : trees) {
    const double k = std::floor(tree.dbh_m / width_m + kOnTheBorder);
    if (k >= kMostClasses)
      throw InputError("tree lists", "",
                       fmt::format("expected at most {:.0f} classes of diameter, but a diameter of "
                                   "{:g} m is there",
                                   kMostClasses, tree.dbh_m));
    result.push_back(k >= 0.0 ? static_cast<int>(k) : -1);
  }
  return result;
}

}  // namespace

std::vector<TreeErrors> errors_by_group(const std::vector<Tree>& a, const std::vector<Tree>& b,
                                        const std::vector<TreePair>& pairs,
                                        const std::vector<int>& group_of_a,
                                        const std::vector<int>& group_of_b, std::size_t groups) {
  std::vector<GroupErrors> sums(groups);
  // What is counted for each tree of A: its own group, or that of its partner.
  std::vector<int> counted = group_of_a;
  for (const auto& [i, j] : pairs) {
    counted[i] = b[j].felled ? -1 : group_of_b[j];
    if (counted[i] >= 0) sums[static_cast<std::size_t>(counted[i])].add(a[i], b[j]);
  }
  for (const int group : counted)
    if (group >= 0) ++sums[static_cast<std::size_t>(group)].counts.trees_a;
  for (std::size_t j = 0; j < b.size(); ++j)
    if (group_of_b[j] >= 0 && !b[j].felled)
      ++sums[static_cast<std::size_t>(group_of_b[j])].counts.trees_b;
  std::vector<TreeErrors> result;
  for (const GroupErrors& group : sums)
    result.push_back(group.errors());
  return result;
}

TreeErrors errors_of_pairs(const std::vector<Tree>& a, const std::vector<Tree>& b,
                           const std::vector<TreePair>& pairs) {
  const std::vector<int> all_a(a.size(), 0);
  const std::vector<int> all_b(b.size(), 0);
  return errors_by_group(a, b, pairs, all_a, all_b, 1).front();
}

TreeErrors compare_trees(const std::vector<Tree>& a, const std::vector<Tree>& b, double radius_m) {
  return errors_of_pairs(a, b, match_trees(a, b, radius_m));
}

std::vector<ErrorsOfClass> errors_by_diameter(const std::vector<Tree>& a,
                                              const std::vector<Tree>& b,
                                              const std::vector<TreePair>& pairs, double width_m) {
  const std::vector<int> class_of_a = classes_of(a, width_m);
  const std::vector<int> class_of_b = classes_of(b, width_m);
  int last = -1;
  for (const auto* classes : {&class_of_a, &class_of_b})
    for (const int k : *classes)
      last = std::max(last, k);
  const auto groups = static_cast<std::size_t>(last + 1);
  const std::vector<TreeErrors> errors =
      errors_by_group(a, b, pairs, class_of_a, class_of_b, groups);
  std::vector<ErrorsOfClass> result;
  for (std::size_t k = 0; k < groups; ++k) {
    if (errors[k].trees_a + errors[k].trees_b == 0) continue;
    const auto from = static_cast<double>(k);
    result.push_back({from * width_m, (from + 1.0) * width_m, errors[k]});
  }
  return result;
}

}  // namespace understory
