#include "understory/pipeline/georeferencing/moved_tables.h"

#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "understory/evaluation/world_frame.h"
#include "understory/util/files/atomic_file.h"
#include "understory/util/files/csv.h"

namespace understory {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

// The columns of a place. Without that of z a row's height is told otherwise.
struct PlaceColumns {
  std::optional<std::size_t> x;
  std::optional<std::size_t> y;
  std::optional<std::size_t> z;
  [[nodiscard]] bool present() const { return x && y; }
};

using RowHeight = std::function<double(const CsvReader& row)>;

PlaceColumns columns_of(const CsvReader& table, const std::string& suffix) {
  return {table.find({"x" + suffix}), table.find({"y" + suffix}), table.find({"z" + suffix})};
}

void move_place(const CsvReader& row, const PlaceColumns& columns, const RowHeight& height,
                const Pose& motion, std::vector<std::string>& cells) {
  constexpr int kDecimals = 3;
  const double z = columns.z ? row.number(*columns.z) : height(row);
  const Vector3d place(row.number(*columns.x), row.number(*columns.y), std::isfinite(z) ? z : 0.0);
  if (!place.allFinite()) return;  // plots.csv: all that was seen
  const Vector3d at = motion * place;
  cells[*columns.x] = csv_cell(at.x(), kDecimals);
  cells[*columns.y] = csv_cell(at.y(), kDecimals);
  if (columns.z && std::isfinite(z)) cells[*columns.z] = csv_cell(at.z(), kDecimals);
}

std::string line_of(const std::vector<std::string>& cells) {
  std::string line;
  for (std::size_t i = 0; i < cells.size(); ++i)
    line += (i == 0 ? "" : ",") + cells[i];
  return line + "\n";
}

void move_table(const fs::path& from, const fs::path& to, const Pose& motion,
                const RowHeight& height) {
  if (!fs::exists(from)) return;
  CsvFormat format;
  format.edit = turned_back(from);
  CsvReader table(from, {"x", "y"}, format);
  AtomicTextFile file(to);
  std::vector<std::string> cells;
  for (const std::string& name : table.names())
    cells.push_back(csv_text(name));
  file.write(line_of(cells));
  const PlaceColumns both[] = {columns_of(table, ""), columns_of(table, "_to")};
  while (table.next()) {
    for (std::size_t i = 0; i < cells.size(); ++i)
      cells[i] = csv_text(std::string(table.text(i)));
    for (const PlaceColumns& columns : both)
      if (columns.present()) move_place(table, columns, height, motion, cells);
    file.write(line_of(cells));
  }
  file.commit();
}

void copy_table(const fs::path& from, const fs::path& to) {
  if (!fs::exists(from)) return;
  LineReader lines(from);
  AtomicTextFile file(to);
  std::string line;
  while (lines.next(line))
    file.write(line + "\n");
  file.commit();
}

}  // namespace

void write_moved_tables(const fs::path& from, const fs::path& to, const std::vector<Tree>& trees,
                        const Pose& target_from_world) {
  std::map<double, double> feet;  // by id
  double mean = 0.0;
  for (const Tree& tree : trees) {
    if (!std::isfinite(tree.z)) continue;
    feet[tree.id] = tree.z;
    mean += tree.z;
  }
  if (!feet.empty()) mean /= static_cast<double>(feet.size());
  const auto in_stem = [&](const CsvReader& row) {
    const auto foot = feet.find(row.number("tree_id"));
    return (foot == feet.end() ? mean : foot->second) + row.number("height_m");
  };
  const auto on_ground = [&](const CsvReader&) { return mean; };
  move_table(from / "stem_curves.csv", to / "stem_curves.csv", target_from_world, in_stem);
  move_table(from / "dead_wood.csv", to / "dead_wood.csv", target_from_world, on_ground);
  move_table(from / "plots.csv", to / "plots.csv", target_from_world, on_ground);
  copy_table(from / "plot_classes.csv", to / "plot_classes.csv");
}

}  // namespace understory
