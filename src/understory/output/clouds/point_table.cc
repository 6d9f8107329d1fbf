#include "understory/output/clouds/point_table.h"

#include "understory/util/files/atomic_file.h"
#include "understory/util/files/csv.h"

namespace understory {
namespace {

std::string cell_text(const PointCell& cell, int decimals) {
  if (const auto* text = std::get_if<std::string>(&cell)) return *text;
  if (const auto* whole = std::get_if<int>(&cell)) return std::to_string(*whole);
  if (const auto* real = std::get_if<double>(&cell)) return csv_cell(*real, decimals);
  return {};
}

}  // namespace

void write_points_csv(const std::filesystem::path& path, const PointTable& table) {
  AtomicTextFile file(path);
  std::string text = "x,y,z";
  for (const PointColumn& column : table.columns)
    text += "," + column.name;
  file.write(text + "\n");
  for (const PointRow& row : table.rows) {
    text = csv_cell(row.point.x(), 3) + "," + csv_cell(row.point.y(), 3) + "," +
           csv_cell(row.point.z(), 3);
    for (std::size_t k = 0; k < table.columns.size(); ++k)
      text += "," + cell_text(row.cells[k], table.columns[k].decimals);
    file.write(text + "\n");
  }
  file.commit();
}

}  // namespace understory
