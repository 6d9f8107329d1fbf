#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <variant>
#include <vector>

namespace understory {

// A table of places with named columns, as it goes into a CSV file or a layer of points.
struct PointColumn {
  enum class Kind { kText, kWhole, kReal };
  std::string name;
  Kind kind = Kind::kReal;
  int decimals = 3;  // of a real number in CSV
};
// Unknown, text, a whole number or a real one; NaN is unknown, too.
using PointCell = std::variant<std::monostate, std::string, int, double>;
struct PointRow {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  // NaN where a coordinate is unknown
  std::vector<PointCell> cells;                     // as many as columns
};
struct PointTable {
  std::vector<PointColumn> columns;
  std::vector<PointRow> rows;
};

// As CSV: x, y, z in metres with three decimals, then the columns; empty where unknown. The file
// appears whole or not at all. Throws OutputError.
void write_points_csv(const std::filesystem::path& path, const PointTable& table);

// As a GeoPackage with one layer of points; `crs_wkt` as for write_trees_gpkg. The same rows give
// the same bytes. Throws OutputError.
void write_points_gpkg(const std::filesystem::path& path, const PointTable& table,
                       const std::string& layer, const std::string& description,
                       const std::string& crs_wkt);

}  // namespace understory
