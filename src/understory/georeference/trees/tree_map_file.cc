#include "understory/georeference/trees/tree_map_file.h"

#include <fmt/format.h>
#include <ogrsf_frmts.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <optional>
#include <utility>

#include "understory/geometry/quiet_gdal.h"
#include "understory/georeference/georeference_constants.h"
#include "understory/util/error.h"
#include "understory/util/files/csv.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace georeference_constants::tree_match;

// Names of the columns of one figure, in lower case.
using ColumnNames = std::vector<std::string>;
const ColumnNames& x_names() {
  static const ColumnNames kNames{"x",     "east_m", "easting",       "east",
                                  "utm_x", "lon",    "longitude_deg", "longitude"};
  return kNames;
}
const ColumnNames& y_names() {
  static const ColumnNames kNames{"y",     "north_m", "northing",     "north",
                                  "utm_y", "lat",     "latitude_deg", "latitude"};
  return kNames;
}
const ColumnNames& z_names() {
  static const ColumnNames kNames{"z", "ground_m", "elevation"};
  return kNames;
}
const ColumnNames& height_names() {
  static const ColumnNames kNames{"height_m", "height", "tree_height", "ht", "h"};
  return kNames;
}
const ColumnNames& diameter_names() {
  static const ColumnNames kNames{"dbh_m", "dbh_cm", "dbh", "d", "diameter"};
  return kNames;
}

// Diameters whose column does not name a unit.
void settle_unit(const std::string& column, TreeMapFile& map) {
  double scale = 1.0;
  std::vector<double> known;
  for (const Tree& tree : map.trees)
    if (std::isfinite(tree.dbh_m)) known.push_back(tree.dbh_m);
  if (column == "dbh_cm") {
    scale = 0.01;
  } else if (column != "dbh_m" && upper_median(known) > kThickestM) {
    const bool millimetres = upper_median(known) > 100.0 * kThickestM;
    scale = millimetres ? 0.001 : 0.01;
    map.remarks.push_back("the column '" + column + "' is taken for " +
                          (millimetres ? "millimetres" : "centimetres"));
  }
  const double median_m = scale * upper_median(known, 1.0);
  if (median_m > kThickestM || median_m < kThinnestM)
    map.remarks.push_back(fmt::format(
        "the median diameter in the column '{}' is {:.4g} m: its unit is another one. The place "
        "does not depend on it, as only their order counts",
        column, median_m));
  for (Tree& tree : map.trees)
    tree.dbh_m *= scale;
}

TreeMapFile read_table(const std::filesystem::path& path) {
  CsvReader table(path, {}, {.any_case = true});
  const std::size_t x = table.require(x_names());
  const std::size_t y = table.require(y_names());
  const auto z = table.find(z_names());
  const auto height = table.find(height_names());
  const auto diameter = table.find(diameter_names());
  const auto value = [&](const std::optional<std::size_t>& column) {
    return column ? table.number(*column) : Tree::kUnknown;
  };
  TreeMapFile map;
  while (table.next()) {
    Tree tree;
    tree.id = static_cast<int>(map.trees.size()) + 1;
    tree.x = table.number(x);
    tree.y = table.number(y);
    if (!std::isfinite(tree.x) || !std::isfinite(tree.y))
      table.fail("expected a position in '" + table.names()[x] + "' and '" + table.names()[y] +
                 "'");
    tree.z = value(z);
    tree.height_m = value(height);
    tree.dbh_m = value(diameter);
    map.trees.push_back(tree);
  }
  if (diameter) settle_unit(table.names()[*diameter], map);
  return map;
}

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char letter) { return static_cast<char>(std::tolower(letter)); });
  return text;
}

// The field with the first of the names that the layer has; -1 for none.
int field_of(OGRFeatureDefn& definition, const ColumnNames& names) {
  for (const std::string& name : names) {
    for (int i = 0; i < definition.GetFieldCount(); ++i)
      if (lower(definition.GetFieldDefn(i)->GetNameRef()) == name) return i;
  }
  return -1;
}

double field_value(const OGRFeature& feature, int field) {
  if (field < 0 || feature.IsFieldSetAndNotNull(field) == 0) return Tree::kUnknown;
  return feature.GetFieldAsDouble(field);
}

OGRLayer* layer_of(GDALDataset& dataset) {
  OGRLayer* first = nullptr;
  for (int i = 0; i < dataset.GetLayerCount(); ++i) {
    OGRLayer* layer = dataset.GetLayer(i);
    const OGRwkbGeometryType type = wkbFlatten(layer->GetGeomType());
    if (type != wkbPoint && type != wkbUnknown) continue;
    if (lower(layer->GetName()) == "trees") return layer;
    if (first == nullptr) first = layer;
  }
  return first;
}

std::string system_of(OGRLayer& layer) {
  const OGRSpatialReference* system = layer.GetSpatialRef();
  if (system == nullptr || (system->IsProjected() == 0 && system->IsGeographic() == 0)) return "";
  char* text = nullptr;
  system->exportToWkt(&text);
  std::string wkt = text == nullptr ? "" : text;
  CPLFree(text);
  return wkt;
}

TreeMapFile read_layer(const std::filesystem::path& path) {
  const QuietGdal quiet;
  const GDALDatasetUniquePtr dataset(
      GDALDataset::Open(path.c_str(), GDAL_OF_VECTOR | GDAL_OF_READONLY));
  OGRLayer* layer = dataset == nullptr ? nullptr : layer_of(*dataset);
  if (layer == nullptr)
    throw InputError(path.string(), "",
                     "expected a map of trees: a CSV table, a GeoPackage or another file with a "
                     "layer of points, or a point cloud (.las, .laz)");
  TreeMapFile map;
  map.coordinate_system = system_of(*layer);
  const int height = field_of(*layer->GetLayerDefn(), height_names());
  const int diameter = field_of(*layer->GetLayerDefn(), diameter_names());
  bool flat = true;
  layer->ResetReading();
  while (const OGRFeatureUniquePtr feature{layer->GetNextFeature()}) {
    const OGRGeometry* geometry = feature->GetGeometryRef();
    if (geometry == nullptr || wkbFlatten(geometry->getGeometryType()) != wkbPoint) continue;
    const OGRPoint* point = geometry->toPoint();
    if (!std::isfinite(point->getX()) || !std::isfinite(point->getY())) continue;
    Tree tree;
    tree.id = static_cast<int>(map.trees.size()) + 1;
    tree.x = point->getX();
    tree.y = point->getY();
    tree.z = point->Is3D() != 0 ? point->getZ() : Tree::kUnknown;
    flat = flat && !(std::abs(tree.z) > 0.0);
    tree.height_m = field_value(*feature, height);
    tree.dbh_m = field_value(*feature, diameter);
    map.trees.push_back(tree);
  }
  for (Tree& tree : map.trees)
    if (flat) tree.z = Tree::kUnknown;  // a third coordinate that nobody filled in
  if (diameter >= 0)
    settle_unit(lower(layer->GetLayerDefn()->GetFieldDefn(diameter)->GetNameRef()), map);
  return map;
}

}  // namespace

TreeMapFile read_tree_map(const std::filesystem::path& path, const std::string& crs) {
  if (!std::filesystem::is_regular_file(path))
    throw InputError(
        path.string(), "",
        std::filesystem::is_directory(path)
            ? "is a folder: expected one file with a map of trees, such as the trees.csv or "
              "trees.gpkg of a run"
            : "expected a map of trees: no such file");
  const std::string name = lower(path.filename().string());
  const bool table = name.ends_with(".csv") || name.ends_with(".csv.gz") || name.ends_with(".txt");
  TreeMapFile map = table ? read_table(path) : read_layer(path);
  if (map.trees.empty()) throw InputError(path.string(), "", "expected trees: there is none");
  if (map.coordinate_system.empty()) map.coordinate_system = crs;
  return map;
}

}  // namespace understory
