#include "understory/evaluation/trees/tree_falls.h"

#include <algorithm>
#include <map>
#include <string>

#include "understory/evaluation/world_frame.h"
#include "understory/util/error.h"
#include "understory/util/files/csv.h"

namespace understory {
namespace {

TimeNs time_in(const CsvReader& table, const std::string& column) {
  TimeNs time = 0;
  if (!parse_seconds(std::string(table.text(column)), time))
    table.fail("expected seconds in column '" + column + "'");
  return time;
}

std::map<int, TreeFall> by_tree(const std::vector<TreeFall>& falls) {
  std::map<int, TreeFall> result;
  for (const TreeFall& fall : falls)
    result.emplace(fall.tree_id, fall);
  return result;
}

}  // namespace

std::vector<TreeFall> read_tree_falls(const std::filesystem::path& path) {
  CsvReader table(path, {"id", "x", "y", "seen_until", "gone_since"}, {.edit = turned_back(path)});
  std::vector<TreeFall> falls;
  while (table.next()) {
    TreeFall fall;
    fall.tree_id = static_cast<int>(table.finite("id"));
    fall.x = table.finite("x");
    fall.y = table.finite("y");
    fall.seen_until = time_in(table, "seen_until");
    fall.gone_since = time_in(table, "gone_since");
    if (!table.text("missed").empty()) fall.missed = static_cast<int>(table.finite("missed"));
    falls.push_back(fall);
  }
  return falls;
}

std::vector<TreeFall> placed(const std::vector<TreeFall>& falls, const std::vector<Tree>& trees) {
  std::map<int, const Tree*> by_id;
  for (const Tree& tree : trees)
    by_id.emplace(tree.id, &tree);
  std::vector<TreeFall> result;
  for (TreeFall fall : falls) {
    const auto found = by_id.find(fall.tree_id);
    if (found == by_id.end()) continue;
    fall.x = found->second->x;
    fall.y = found->second->y;
    result.push_back(fall);
  }
  return result;
}

std::vector<TreeFall> merged_falls(const MergedTrees& merged, const std::vector<Tree>& s,
                                   const std::vector<TreeFall>& falls_of_s,
                                   const std::vector<Tree>& l,
                                   const std::vector<TreeFall>& falls_of_l) {
  const std::map<int, TreeFall> in_s = by_tree(falls_of_s);
  const std::map<int, TreeFall> in_l = by_tree(falls_of_l);
  const auto fall_of = [](const std::map<int, TreeFall>& falls, const std::vector<Tree>& trees,
                          int index) {
    return index < 0 ? falls.end() : falls.find(trees[static_cast<std::size_t>(index)].id);
  };
  std::vector<TreeFall> result;
  for (std::size_t k = 0; k < merged.trees.size(); ++k) {
    const auto a = fall_of(in_s, s, merged.index_in_s[k]);
    const auto b = fall_of(in_l, l, merged.index_in_l[k]);
    if (a == in_s.end() && b == in_l.end()) continue;
    TreeFall fall = a != in_s.end() ? a->second : b->second;
    if (a != in_s.end() && b != in_l.end()) {
      const TimeNs from = std::max(a->second.seen_until, b->second.seen_until);
      const TimeNs to = std::min(a->second.gone_since, b->second.gone_since);
      if (from < to) {
        fall.seen_until = from;
        fall.gone_since = to;
      }
      fall.missed = a->second.missed + b->second.missed;
    }
    fall.tree_id = merged.trees[k].id;
    fall.x = merged.trees[k].x;
    fall.y = merged.trees[k].y;
    result.push_back(fall);
  }
  return result;
}

}  // namespace understory
