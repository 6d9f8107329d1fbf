#include "understory/evaluation/trees/tree_errors.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "understory/evaluation/evaluation_constants.h"
#include "understory/evaluation/plane_cells.h"
#include "understory/evaluation/trees/tree_list_check.h"
#include "understory/evaluation/world_frame.h"
#include "understory/util/error.h"
#include "understory/util/files/csv.h"

namespace understory {
namespace {

using namespace evaluation_constants::tree_errors;

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
  } else if (const auto* text = std::get_if<std::string Tree::*>(&column.member)) {
    tree.*(*text) = table.text(column.name);
  } else if (const auto value = whole_number(table, column.name)) {
    tree.*std::get<int Tree::*>(column.member) = *value;
  }
}

// A row whose diameter is no diameter in metres.
struct ThickRow {
  std::string position;
  double dbh_m = 0.0;
};

// Refuses what stands for an unknown size elsewhere: 0, -1, -9999.
void refuse_no_size(const CsvReader& table, const char* what, const char* column, double size_m) {
  if (size_m <= 0.0)
    table.fail(
        fmt::format("expected a {} above 0 in column '{}', found {:.6g}: an unknown one is an "
                    "empty cell",
                    what, column, size_m));
}

void refuse_unknown(const CsvReader& table, const Tree& tree) {
  refuse_no_size(table, "diameter", "dbh_m", tree.dbh_m);
  refuse_no_size(table, "height", "height_m", tree.height_m);
  if (tree.z < kLowestGroundM)
    table.fail(
        fmt::format("expected a place in metres in column 'z', found {:.6g}: no tree stands "
                    "so low, and an unknown one is an empty cell",
                    tree.z));
}

double ratio(std::size_t part, std::size_t whole) {
  return whole == 0 ? Tree::kUnknown : static_cast<double>(part) / static_cast<double>(whole);
}

// Tells which trees stand near a path.
class NearPath {
 public:
  NearPath(const Trajectory& path, double within_m)
      : path_(path),
        within_m_(within_m),
        cells_(
            path.size(), within_m,
            [&](std::size_t k) { return path[k].world_from_body.translation().x(); },
            [&](std::size_t k) { return path[k].world_from_body.translation().y(); }) {}

  bool holds(const Tree& tree) const {
    bool near = false;
    cells_.around(tree.x, tree.y, [&](std::size_t k) {
      if (near) return;
      const Eigen::Vector3d& p = path_[k].world_from_body.translation();
      near = std::hypot(tree.x - p.x(), tree.y - p.y()) <= within_m_;
    });
    return near;
  }

 private:
  const Trajectory& path_;
  double within_m_;
  PlaneCells cells_;
};

}  // namespace

std::vector<Tree> read_trees(const std::filesystem::path& path) {
  CsvReader table(path, {"x", "y"}, {.edit = turned_back(path)});
  std::vector<Tree> trees;
  std::optional<ThickRow> thick;
  while (table.next()) {
    Tree tree;
    for (const TreeColumn& column : kTreeColumns)
      read_cell(table, column, tree);
    refuse_unknown(table, tree);
    if (tree.dbh_m > kThickestTreeM && !thick)
      thick = ThickRow{table.lines().position(), tree.dbh_m};
    if (!std::isfinite(table.number("id"))) tree.id = static_cast<int>(trees.size()) + 1;
    tree.x = table.finite("x");
    tree.y = table.finite("y");
    if (!std::isfinite(tree.z)) tree.z = 0.0;
    tree.felled = !table.text("felled_at").empty();
    trees.push_back(tree);
  }
  // Where the whole list is in another unit, its reader says which.
  if (thick && diameter_complaint(trees).empty())
    throw InputError(
        path.string(), thick->position,
        fmt::format("expected a diameter in metres in column 'dbh_m', found {:.6g}: no tree is "
                    "thicker than {:.0f} m, and an unknown diameter is an empty cell",
                    thick->dbh_m, kThickestTreeM));
  return trees;
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

VisibleTreeErrors compare_visible_trees(const std::vector<Tree>& a, const std::vector<Tree>& b,
                                        const std::vector<TreePair>& pairs,
                                        const Visibility& visibility) {
  const NearPath near_path(visibility.path, visibility.within_m);
  std::vector<bool> matched_a(a.size(), false);
  std::vector<bool> matched_b(b.size(), false);
  for (const auto& [i, j] : pairs)
    matched_a[i] = matched_b[j] = true;
  VisibleTreeErrors errors;
  for (std::size_t j = 0; j < b.size(); ++j) {
    const auto returns = visibility.returns_by_tree.find(b[j].id);
    if (b[j].felled || returns == visibility.returns_by_tree.end() ||
        returns->second < visibility.min_returns || !near_path.holds(b[j])) {
      continue;
    }
    ++errors.expected;
    if (matched_b[j]) ++errors.found;
  }
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!near_path.holds(a[i])) continue;
    ++errors.reported;
    if (!matched_a[i]) ++errors.false_trees;
  }
  errors.recall = ratio(errors.found, errors.expected);
  errors.false_share = ratio(errors.false_trees, errors.reported);
  return errors;
}

MapAgreement compare_maps(const std::vector<Tree>& a, const std::vector<Tree>& b,
                          const std::vector<TreePair>& pairs, const Trajectory& path,
                          double within_m) {
  const NearPath near_path(path, within_m);
  std::vector<bool> paired_a(a.size(), false);
  std::vector<bool> paired_b(b.size(), false);
  for (const auto& [i, j] : pairs)
    paired_a[i] = paired_b[j] = true;
  MapAgreement result;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!near_path.holds(a[i])) continue;
    ++result.trees_a;
    if (paired_a[i]) ++result.paired_a;
  }
  for (std::size_t j = 0; j < b.size(); ++j) {
    if (!near_path.holds(b[j])) continue;
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
