#include "understory/sensor/tree.h"

#include "understory/util/files/csv.h"

namespace understory {
namespace {

std::string cell_of(const Tree& tree, const TreeColumn& column, int more_decimals) {
  if (const auto* number = std::get_if<double Tree::*>(&column.member))
    return csv_cell(tree.*(*number), column.decimals + more_decimals);
  if (const auto* text = std::get_if<std::string Tree::*>(&column.member))
    return csv_text(tree.*(*text));
  return std::to_string(tree.*std::get<int Tree::*>(column.member));
}

}  // namespace

std::string tree_csv_header() {
  std::string header;
  for (const TreeColumn& column : kTreeColumns)
    header += (header.empty() ? "" : ",") + std::string(column.name);
  return header;
}

std::string tree_csv_row(const Tree& tree, int more_decimals) {
  std::string row;
  for (const TreeColumn& column : kTreeColumns)
    row += (&column == kTreeColumns.data() ? "" : ",") + cell_of(tree, column, more_decimals);
  return row;
}

}  // namespace understory
