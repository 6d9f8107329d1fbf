#include "understory/evaluation/tree_errors.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <tuple>

#include "understory/util/error.h"
#include "understory/util/files/csv.h"

namespace understory {
namespace {

// Nothing where the cell is empty or not finite.
std::optional<int> whole_number(const CsvReader& table, const std::string& column) {
  const double value = table.number(column);
  if (!std::isfinite(value)) return std::nullopt;
  if (std::abs(value) > std::numeric_limits<int>::max())
    table.fail("expected a smaller number in column '" + column + "'");
  return static_cast<int>(value);
}

// Stays as it is where the cell is empty: an unknown number, or no observations.
void read_cell(const CsvReader& table, const TreeColumn& column, Tree& tree) {
  if (const auto* number = std::get_if<double Tree::*>(&column.member)) {
    tree.*(*number) = table.number(column.name);
  } else if (const auto value = whole_number(table, column.name)) {
    tree.*std::get<int Tree::*>(column.member) = *value;
  }
}

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

double plane_distance(const Tree& a, const Tree& b) {
  return std::hypot(a.x - b.x, a.y - b.y);
}

double ratio(std::size_t part, std::size_t whole) {
  return whole == 0 ? kUnknown : static_cast<double>(part) / static_cast<double>(whole);
}

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
  [[nodiscard]] double mean() const { return n == 0 ? kUnknown : sum / static_cast<double>(n); }
  [[nodiscard]] double rms() const {
    return n == 0 ? kUnknown : std::sqrt(sum_of_squares / static_cast<double>(n));
  }
};

bool near_path(const Tree& tree, const Trajectory& path, double within_m) {
  return std::any_of(path.begin(), path.end(), [&](const StampedPose& pose) {
    const Eigen::Vector3d& p = pose.world_from_body.translation();
    return std::hypot(tree.x - p.x(), tree.y - p.y()) <= within_m;
  });
}

}  // namespace

std::vector<Tree> read_trees(const std::filesystem::path& path) {
  CsvReader table(path, {"x", "y"});
  std::vector<Tree> trees;
  while (table.next()) {
    Tree tree;
    for (const TreeColumn& column : kTreeColumns)
      read_cell(table, column, tree);
    if (!std::isfinite(table.number("id"))) tree.id = static_cast<int>(trees.size()) + 1;
    tree.x = table.finite("x");
    tree.y = table.finite("y");
    if (!std::isfinite(tree.z)) tree.z = 0.0;
    tree.felled = !table.text("felled_at").empty();
    trees.push_back(tree);
  }
  return trees;
}

std::vector<TreePair> match_trees(const std::vector<Tree>& a, const std::vector<Tree>& b,
                                  double radius_m) {
  struct Candidate {
    double distance;
    std::size_t i;
    std::size_t j;
  };
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; j < b.size(); ++j) {
      const double distance = plane_distance(a[i], b[j]);
      if (distance <= radius_m) candidates.push_back({distance, i, j});
    }
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

std::vector<Tree> moved(const std::vector<Tree>& trees, const Pose& target_from_source) {
  std::vector<Tree> result = trees;
  for (Tree& tree : result) {
    const Eigen::Vector3d p = target_from_source * Eigen::Vector3d(tree.x, tree.y, tree.z);
    tree.x = p.x();
    tree.y = p.y();
    tree.z = p.z();
  }
  return result;
}

TreeErrors compare_trees(const std::vector<Tree>& a, const std::vector<Tree>& b, double radius_m) {
  TreeErrors errors;
  Differences position;
  Differences dbh;
  Differences height;
  const auto felled = [](const Tree& tree) { return tree.felled; };
  errors.trees_a = a.size();
  errors.trees_b = b.size() - static_cast<std::size_t>(std::count_if(b.begin(), b.end(), felled));
  for (const auto& [i, j] : match_trees(a, b, radius_m)) {
    if (b[j].felled) {
      --errors.trees_a;
      continue;
    }
    ++errors.matched;
    position.add(plane_distance(a[i], b[j]));
    dbh.add(a[i].dbh_m - b[j].dbh_m);
    height.add(a[i].height_m - b[j].height_m);
  }
  errors.recall = ratio(errors.matched, errors.trees_b);
  errors.precision = ratio(errors.matched, errors.trees_a);
  errors.position_rmse_m = position.rms();
  errors.dbh_rmse_m = dbh.rms();
  errors.dbh_bias_m = dbh.mean();
  errors.height_rmse_m = height.rms();
  return errors;
}

VisibleTreeErrors compare_visible_trees(const std::vector<Tree>& a, const std::vector<Tree>& b,
                                        double radius_m, const Visibility& visibility) {
  std::vector<bool> matched_a(a.size(), false);
  std::vector<bool> matched_b(b.size(), false);
  for (const auto& [i, j] : match_trees(a, b, radius_m))
    matched_a[i] = matched_b[j] = true;
  VisibleTreeErrors errors;
  for (std::size_t j = 0; j < b.size(); ++j) {
    const auto returns = visibility.returns_by_tree.find(b[j].id);
    if (b[j].felled || returns == visibility.returns_by_tree.end() ||
        returns->second < visibility.min_returns ||
        !near_path(b[j], visibility.path, visibility.within_m)) {
      continue;
    }
    ++errors.expected;
    if (matched_b[j]) ++errors.found;
  }
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!near_path(a[i], visibility.path, visibility.within_m)) continue;
    ++errors.reported;
    if (!matched_a[i]) ++errors.false_trees;
  }
  errors.recall = ratio(errors.found, errors.expected);
  errors.false_share = ratio(errors.false_trees, errors.reported);
  return errors;
}

MapAgreement compare_maps(const std::vector<Tree>& a, const std::vector<Tree>& b, double radius_m,
                          const Trajectory& path, double within_m) {
  std::vector<bool> paired_a(a.size(), false);
  std::vector<bool> paired_b(b.size(), false);
  for (const auto& [i, j] : match_trees(a, b, radius_m))
    paired_a[i] = paired_b[j] = true;
  MapAgreement result;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!near_path(a[i], path, within_m)) continue;
    ++result.trees_a;
    if (paired_a[i]) ++result.paired_a;
  }
  for (std::size_t j = 0; j < b.size(); ++j) {
    if (!near_path(b[j], path, within_m)) continue;
    ++result.trees_b;
    if (paired_b[j]) ++result.paired_b;
  }
  const std::size_t all = result.trees_a + result.trees_b;
  result.agreement =
      all == 0 ? std::numeric_limits<double>::quiet_NaN()
               : static_cast<double>(result.paired_a + result.paired_b) / static_cast<double>(all);
  return result;
}

std::map<int, long> read_returns(const std::filesystem::path& path) {
  CsvReader table(path, {"tree_id", "returns"});
  std::map<int, long> returns;
  while (table.next()) {
    returns[static_cast<int>(table.finite("tree_id"))] +=
        static_cast<long>(table.finite("returns"));
  }
  return returns;
}

}  // namespace understory
