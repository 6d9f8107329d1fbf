#include "understory/output/change_files.h"

#include <cmath>
#include <utility>

namespace understory {
namespace {

using Kind = PointColumn::Kind;

// A figure in both epochs, its increment, and whether that is significant.
struct ChangeFigure {
  const char* name;
  const char* unit;
  double Tree::*figure;
  Increment TreeChange::*increment;
  int decimals;
};
constexpr ChangeFigure kChangeFigures[] = {
    {"dbh", "m", &Tree::dbh_m, &TreeChange::dbh_m, 4},
    {"height", "m", &Tree::height_m, &TreeChange::height_m, 2},
    {"stem_volume", "m3", &Tree::stem_volume_m3, &TreeChange::volume_m3, 4},
};

PointCell known(double value) {
  return std::isfinite(value) ? PointCell(value) : PointCell();
}

}  // namespace

PointTable changes_table(const std::vector<Tree>& old_trees, const std::vector<Tree>& new_trees,
                         const TreeChanges& changes) {
  PointTable table;
  table.columns = {{"change", Kind::kText, 0},
                   {"id_old", Kind::kWhole, 0},
                   {"id_new", Kind::kWhole, 0},
                   {"apart_m", Kind::kReal, 3}};
  for (const ChangeFigure& each : kChangeFigures) {
    const std::string name = each.name;
    const std::string unit = std::string("_") + each.unit;
    table.columns.push_back({name + "_old" + unit, Kind::kReal, each.decimals});
    table.columns.push_back({name + "_new" + unit, Kind::kReal, each.decimals});
    table.columns.push_back({name + "_increment" + unit, Kind::kReal, each.decimals});
    table.columns.push_back({name + "_increment_sd" + unit, Kind::kReal, each.decimals});
    table.columns.push_back({name + "_significant", Kind::kWhole, 0});
  }
  for (const TreeChange& change : changes.trees) {
    const Tree* before = change.in_old ? &old_trees[*change.in_old] : nullptr;
    const Tree* after = change.in_new ? &new_trees[*change.in_new] : nullptr;
    const Tree& place = after != nullptr ? *after : *before;
    PointRow row{{place.x, place.y, place.z}, {to_string(change.fate), {}, {}, {}}};
    if (before != nullptr) row.cells[1] = before->id;
    if (after != nullptr) row.cells[2] = after->id;
    if (before != nullptr && after != nullptr)
      row.cells[3] = std::hypot(before->x - after->x, before->y - after->y);
    for (const ChangeFigure& each : kChangeFigures) {
      const Increment& increment = change.*each.increment;
      row.cells.push_back(before != nullptr ? known(before->*each.figure) : PointCell());
      row.cells.push_back(after != nullptr ? known(after->*each.figure) : PointCell());
      row.cells.push_back(known(increment.value));
      row.cells.push_back(known(increment.sd));
      row.cells.push_back(std::isfinite(increment.value) && std::isfinite(increment.sd)
                              ? PointCell(increment.significant ? 1 : 0)
                              : PointCell());
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

void write_changes(const std::filesystem::path& path, const PointTable& changes,
                   const LayerFrame& layers) {
  if (path.extension() != ".gpkg") return write_points_csv(path, changes);
  PointTable placed = changes;
  for (PointRow& row : placed.rows)
    row.point = layers.from_world(row.point);
  write_points_gpkg(path, placed, "changes", "trees of two epochs, and what became of them",
                    layers.wkt());
}

}  // namespace understory
