#include "understory/output/layers/geo_files.h"

#include <cpl_conv.h>
#include <cpl_error.h>
#include <gdal_priv.h>
#include <ogrsf_frmts.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <system_error>
#include <unordered_map>
#include <utility>

#include "understory/geometry/quiet_gdal.h"
#include "understory/output/clouds/point_table.h"
#include "understory/output/plot_files.h"
#include "understory/util/error.h"
#include "understory/util/files/atomic_file.h"

namespace understory {
namespace {

constexpr float kNoData = -9999.0F;

[[noreturn]] void fail(const std::filesystem::path& path) {
  const int code = errno;
  const std::string told = CPLGetLastErrorMsg();
  std::error_code ignored;
  std::filesystem::remove(part_path(path), ignored);
  std::string reason = "cannot be written";
  if (code == ENOSPC || code == EACCES || code == ENOENT || code == EROFS) {
    reason += std::string(": ") + std::strerror(code);
  } else if (!told.empty()) {
    reason += ": " + told;
  }
  throw OutputError(path.string(), reason);
}

GDALDriver* driver(const char* name) {
  GDALDriver* found = GetGDALDriverManager()->GetDriverByName(name);
  if (found == nullptr) throw InternalError(std::string("this GDAL has no driver ") + name);
  return found;
}

// Closing writes the rest, so its errors count.
void close(GDALDatasetUniquePtr dataset, const std::filesystem::path& path) {
  CPLErrorReset();
  GDALClose(GDALDataset::ToHandle(dataset.release()));
  if (CPLGetLastErrorType() >= CE_Failure) fail(path);
  sync_and_rename(part_path(path), path);
}

void set_system(OGRSpatialReference& system, const std::string& wkt) {
  system.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  if (wkt.empty()) {
    // By this name GDAL knows srs_id -1; 0 would be undefined degrees.
    system.SetLocalCS("Undefined Cartesian SRS");
  } else if (system.SetFromUserInput(wkt.c_str()) != OGRERR_NONE) {
    throw InternalError("not a coordinate system: " + wkt);
  }
}

// Left null where the value is not known.
void set_field(OGRFeature& feature, const TreeColumn& column, const Tree& tree) {
  if (const auto* whole = std::get_if<int Tree::*>(&column.member)) {
    feature.SetField(column.name, tree.*(*whole));
    return;
  }
  if (const auto* text = std::get_if<std::string Tree::*>(&column.member)) {
    if (!(tree.*(*text)).empty()) feature.SetField(column.name, (tree.*(*text)).c_str());
    return;
  }
  const double value = tree.*std::get<double Tree::*>(column.member);
  if (std::isfinite(value)) feature.SetField(column.name, value);
}

OGRFieldType type_of(const TreeColumn& column) {
  return std::holds_alternative<int Tree::*>(column.member)           ? OFTInteger
         : std::holds_alternative<std::string Tree::*>(column.member) ? OFTString
                                                                      : OFTReal;
}

}  // namespace

namespace {

// The raster in memory, as GDAL sees it: a TIFF starts in the north.
GDALDatasetUniquePtr in_memory(const Raster& raster, const std::string& crs_wkt,
                               const std::string& meaning, const std::filesystem::path& path) {
  GDALDatasetUniquePtr dataset(
      driver("MEM")->Create("", raster.columns, raster.rows, 1, GDT_Float32, nullptr));
  if (dataset == nullptr) fail(path);
  const double top = raster.y0 + raster.rows * raster.cell_m;
  std::array<double, 6> transform = {raster.x0, raster.cell_m, 0.0, top, 0.0, -raster.cell_m};
  dataset->SetGeoTransform(transform.data());
  if (!crs_wkt.empty()) {
    OGRSpatialReference system;
    set_system(system, crs_wkt);
    dataset->SetSpatialRef(&system);
  }
  GDALRasterBand* band = dataset->GetRasterBand(1);
  band->SetNoDataValue(kNoData);
  band->SetUnitType("metre");
  if (!meaning.empty()) band->SetDescription(meaning.c_str());
  std::vector<float> line(static_cast<std::size_t>(raster.columns));
  for (int row = 0; row < raster.rows; ++row) {
    const int from = raster.rows - 1 - row;
    for (int column = 0; column < raster.columns; ++column) {
      const float value = raster.values[raster.index(column, from)];
      line[static_cast<std::size_t>(column)] =
          std::isfinite(value) ? static_cast<float>(raster.z0 + static_cast<double>(value))
                               : kNoData;
    }
    if (band->RasterIO(GF_Write, 0, row, raster.columns, 1, line.data(), raster.columns, 1,
                       GDT_Float32, 0, 0, nullptr) != CE_None) {
      fail(path);
    }
  }
  return dataset;
}

}  // namespace

void write_geotiff(const std::filesystem::path& path, const Raster& raster,
                   const std::string& crs_wkt, const std::string& meaning) {
  UNDERSTORY_CHECK(!raster.empty());
  const QuietGdal quiet;
  const GDALDatasetUniquePtr source = in_memory(raster, crs_wkt, meaning, path);
  char** options = CSLSetNameValue(nullptr, "COMPRESS", "DEFLATE");
  options = CSLSetNameValue(options, "PREDICTOR", "YES");
  options = CSLSetNameValue(options, "OVERVIEW_RESAMPLING", "AVERAGE");
  GDALDatasetUniquePtr dataset(driver("COG")->CreateCopy(part_path(path).c_str(), source.get(),
                                                         FALSE, options, nullptr, nullptr));
  CSLDestroy(options);
  if (dataset == nullptr) fail(path);
  close(std::move(dataset), path);
}

namespace {

// A layer of the package with its description.
OGRLayer* add_layer(GDALDataset& dataset, const char* name, OGRwkbGeometryType type,
                    const std::string& crs_wkt, const std::string& description,
                    const std::filesystem::path& path) {
  OGRSpatialReference system;
  set_system(system, crs_wkt);
  char** options = CSLSetNameValue(nullptr, "DESCRIPTION", description.c_str());
  OGRLayer* layer = dataset.CreateLayer(name, &system, type, options);
  CSLDestroy(options);
  if (layer == nullptr) fail(path);
  return layer;
}

void add_field(OGRLayer& layer, const char* name, OGRFieldType type,
               const std::filesystem::path& path) {
  OGRFieldDefn field(name, type);
  if (layer.CreateField(&field) != OGRERR_NONE) fail(path);
}

void add_trees(OGRLayer& layer, const std::vector<Tree>& trees, const std::filesystem::path& path) {
  for (const Tree& tree : trees) {
    const std::unique_ptr<OGRFeature> feature(new OGRFeature(layer.GetLayerDefn()));
    for (const TreeColumn& column : kTreeColumns) {
      if (!column.place) set_field(*feature, column, tree);
    }
    OGRPoint point(tree.x, tree.y, tree.z);
    feature->SetGeometry(&point);
    if (layer.CreateFeature(feature.get()) != OGRERR_NONE) fail(path);
  }
}

void add_line(OGRLayer& layer, const PathLine& line, const std::filesystem::path& path) {
  const std::unique_ptr<OGRFeature> feature(new OGRFeature(layer.GetLayerDefn()));
  feature->SetField("begin_s", line.begin_s);
  feature->SetField("end_s", line.end_s);
  feature->SetField("length_m", line.length_m);
  OGRLineString drawn;
  for (const Eigen::Vector3d& point : line.points)
    drawn.addPoint(point.x(), point.y(), point.z());
  feature->SetGeometry(&drawn);
  if (layer.CreateFeature(feature.get()) != OGRERR_NONE) fail(path);
}

// Places to look from again: a layer with its rows.
void add_looks(GDALDataset& dataset, const std::vector<LookPoint>& looks,
               const std::string& crs_wkt, const std::filesystem::path& path) {
  if (looks.empty()) return;
  OGRLayer* layer = add_layer(dataset, "look_again", wkbPoint25D, crs_wkt,
                              "where to stand to measure doubtful stems again", path);
  for (const char* name : {"trees", "tree_ids", "bearing_deg", "reason"}) {
    const std::string text = name;
    add_field(*layer, name,
              text == "trees"         ? OFTInteger
              : text == "bearing_deg" ? OFTReal
                                      : OFTString,
              path);
  }
  for (const LookPoint& look : looks) {
    const std::unique_ptr<OGRFeature> feature(new OGRFeature(layer->GetLayerDefn()));
    std::string ids;
    for (const int id : look.trees)
      ids += (ids.empty() ? "" : ", ") + std::to_string(id);
    feature->SetField("trees", static_cast<int>(look.trees.size()));
    feature->SetField("tree_ids", ids.c_str());
    feature->SetField("bearing_deg", look.bearing_deg);
    feature->SetField("reason", look.reason.c_str());
    OGRPoint point(look.place.x(), look.place.y(), look.place.z());
    feature->SetGeometry(&point);
    if (layer->CreateFeature(feature.get()) != OGRERR_NONE) fail(path);
  }
}

void add_plot_fields(OGRLayer& layer, const std::filesystem::path& path) {
  for (const char* name : {"plot", "kind"})
    add_field(layer, name, OFTString, path);
  for (const PlotColumn& column : plot_columns())
    add_field(layer, column.name, OFTReal, path);
}

OGRLinearRing closed(const PlaneRing& points) {
  OGRLinearRing ring;
  for (const Eigen::Vector2d& point : points)
    ring.addPoint(point.x(), point.y());
  ring.closeRings();
  return ring;
}

// Each hole belongs to the outer ring before it.
OGRMultiPolygon polygons_of(const std::vector<PlaneRing>& rings) {
  OGRMultiPolygon all;
  std::unique_ptr<OGRPolygon> part;
  for (const PlaneRing& points : rings) {
    if (signed_area_m2(points) > 0.0 && part != nullptr) all.addGeometryDirectly(part.release());
    if (part == nullptr) part = std::make_unique<OGRPolygon>();
    OGRLinearRing ring = closed(points);
    part->addRing(&ring);
  }
  if (part != nullptr) all.addGeometryDirectly(part.release());
  return all;
}

void add_plots(OGRLayer& layer, const std::vector<StandPlot>& plots,
               const std::filesystem::path& path) {
  for (const StandPlot& plot : plots) {
    const std::unique_ptr<OGRFeature> feature(new OGRFeature(layer.GetLayerDefn()));
    feature->SetField("plot", plot.shape.id.c_str());
    feature->SetField("kind", plot.shape.kind.c_str());
    for (const PlotColumn& column : plot_columns()) {
      const double value = column.value(plot);
      if (std::isfinite(value)) feature->SetField(column.name, value);
    }
    const OGRMultiPolygon shape = polygons_of(plot.drawn);
    feature->SetGeometry(&shape);
    if (layer.CreateFeature(feature.get()) != OGRERR_NONE) fail(path);
  }
}

// Columns of trees.csv that the layer `crowns` has, beside the number of the tree.
bool tells_of_crown(const TreeColumn& column) {
  const auto* member = std::get_if<double Tree::*>(&column.member);
  return member != nullptr &&
         (*member == &Tree::height_m || *member == &Tree::crown_base_m ||
          *member == &Tree::crown_area_m2 || *member == &Tree::crown_volume_m3);
}

// The outlines of crowns: a layer with its rows.
void add_crowns(GDALDataset& dataset, const std::vector<CrownOutline>& crowns,
                const std::vector<Tree>& trees, const std::string& crs_wkt,
                const std::filesystem::path& path) {
  if (crowns.empty()) return;
  OGRLayer* layer = add_layer(dataset, "crowns", wkbMultiPolygon, crs_wkt,
                              "crowns of the trees, seen from above", path);
  add_field(*layer, "tree_id", OFTInteger, path);
  for (const TreeColumn& column : kTreeColumns)
    if (tells_of_crown(column)) add_field(*layer, column.name, OFTReal, path);
  std::unordered_map<int, const Tree*> by_id;
  for (const Tree& tree : trees)
    by_id.emplace(tree.id, &tree);
  for (const CrownOutline& crown : crowns) {
    const std::unique_ptr<OGRFeature> feature(new OGRFeature(layer->GetLayerDefn()));
    feature->SetField("tree_id", crown.tree);
    for (const TreeColumn& column : kTreeColumns)
      if (tells_of_crown(column)) set_field(*feature, column, *by_id.at(crown.tree));
    const OGRMultiPolygon shape = polygons_of(crown.rings);
    feature->SetGeometry(&shape);
    if (layer->CreateFeature(feature.get()) != OGRERR_NONE) fail(path);
  }
}

// The pieces of one kind: a layer with its rows. They have the ids of dead_wood.csv.
void add_dead_wood(GDALDataset& dataset, const std::vector<DrawnWood>& pieces, DeadWoodKind kind,
                   const std::string& crs_wkt, const std::filesystem::path& path) {
  const bool stumps = kind == DeadWoodKind::kStump;
  const auto of_kind = [&](const DrawnWood& one) { return one.piece.kind == kind; };
  if (std::none_of(pieces.begin(), pieces.end(), of_kind)) return;
  OGRLayer* layer =
      add_layer(dataset, stumps ? "stumps" : "logs", stumps ? wkbPoint25D : wkbLineString25D,
                crs_wkt, stumps ? "stumps at their foot" : "lying stems from the thick end", path);
  add_field(*layer, "id", OFTInteger, path);
  const char* length = stumps ? "height_m" : "length_m";
  for (const char* name : {"diameter_m", "diameter_to_m", "diameter_sd_m", length, "volume_m3"})
    add_field(*layer, name, OFTReal, path);
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    if (!of_kind(pieces[i])) continue;
    const DeadWood& piece = pieces[i].piece;
    const std::unique_ptr<OGRFeature> feature(new OGRFeature(layer->GetLayerDefn()));
    feature->SetField("id", static_cast<int>(i) + 1);
    feature->SetField("diameter_m", piece.diameter_m);
    feature->SetField("diameter_to_m", piece.diameter_to_m);
    feature->SetField("diameter_sd_m", piece.diameter_sd_m);
    feature->SetField(length, piece.length_m());
    feature->SetField("volume_m3", piece.volume_m3());
    const Eigen::Vector3d& from = pieces[i].from;
    const Eigen::Vector3d& to = pieces[i].to;
    OGRPoint foot(from.x(), from.y(), from.z());
    OGRLineString line;
    line.addPoint(&foot);
    line.addPoint(to.x(), to.y(), to.z());
    if (stumps) {
      feature->SetGeometry(&foot);
    } else {
      feature->SetGeometry(&line);
    }
    if (layer->CreateFeature(feature.get()) != OGRERR_NONE) fail(path);
  }
}

// An empty package under the name that it has until it is whole.
GDALDatasetUniquePtr new_package(const std::filesystem::path& path) {
  // The same rows give the same bytes: without this the file holds the time of writing.
  CPLSetThreadLocalConfigOption("OGR_CURRENT_DATE", "2000-01-01T00:00:00.000Z");
  std::error_code ignored;
  std::filesystem::remove(part_path(path), ignored);
  GDALDatasetUniquePtr dataset(
      driver("GPKG")->Create(part_path(path).c_str(), 0, 0, 0, GDT_Unknown, nullptr));
  if (dataset == nullptr) fail(path);
  return dataset;
}

OGRFieldType type_of(PointColumn::Kind kind) {
  return kind == PointColumn::Kind::kText    ? OFTString
         : kind == PointColumn::Kind::kWhole ? OFTInteger
                                             : OFTReal;
}

void add_row(OGRLayer& layer, const PointRow& row, const std::filesystem::path& path) {
  const std::unique_ptr<OGRFeature> feature(new OGRFeature(layer.GetLayerDefn()));
  for (std::size_t k = 0; k < row.cells.size(); ++k) {
    const int field = static_cast<int>(k);
    if (const auto* text = std::get_if<std::string>(&row.cells[k])) {
      feature->SetField(field, text->c_str());
    } else if (const auto* whole = std::get_if<int>(&row.cells[k])) {
      feature->SetField(field, *whole);
    } else if (const auto* real = std::get_if<double>(&row.cells[k]);
               real && std::isfinite(*real)) {
      feature->SetField(field, *real);
    }
  }
  OGRPoint point(row.point.x(), row.point.y(), row.point.z());
  feature->SetGeometry(&point);
  if (layer.CreateFeature(feature.get()) != OGRERR_NONE) fail(path);
}

}  // namespace

void write_trees_gpkg(const std::filesystem::path& path, const std::vector<Tree>& trees,
                      const std::string& crs_wkt, const TreeLayers& layers) {
  const QuietGdal quiet;
  GDALDatasetUniquePtr dataset = new_package(path);
  const std::string above = layers.heights.empty() ? "" : "; heights are " + layers.heights;
  OGRLayer* layer = add_layer(*dataset, "trees", wkbPoint25D, crs_wkt,
                              "trees where the stem meets the ground" + above, path);
  for (const TreeColumn& column : kTreeColumns) {
    if (!column.place) add_field(*layer, column.name, type_of(column), path);
  }
  OGRLayer* drawn = nullptr;
  if (layers.path.points.size() > 1) {
    drawn =
        add_layer(*dataset, "path", wkbLineString25D, crs_wkt, "path of the scanner" + above, path);
    for (const char* name : {"begin_s", "end_s", "length_m"})
      add_field(*drawn, name, OFTReal, path);
  }
  OGRLayer* plotted = nullptr;
  if (!layers.plots.empty()) {
    plotted = add_layer(*dataset, "plots", wkbMultiPolygon, crs_wkt,
                        "sample plots and grid cells with the figures of their trees", path);
    add_plot_fields(*plotted, path);
  }
  dataset->StartTransaction();
  add_trees(*layer, trees, path);
  if (drawn != nullptr) add_line(*drawn, layers.path, path);
  if (plotted != nullptr) add_plots(*plotted, layers.plots, path);
  add_looks(*dataset, layers.look_again, crs_wkt, path);
  add_crowns(*dataset, layers.crowns, trees, crs_wkt, path);
  for (const DeadWoodKind kind : {DeadWoodKind::kStump, DeadWoodKind::kLog})
    add_dead_wood(*dataset, layers.dead_wood, kind, crs_wkt, path);
  if (dataset->CommitTransaction() != OGRERR_NONE) fail(path);
  close(std::move(dataset), path);
}

void write_points_gpkg(const std::filesystem::path& path, const PointTable& table,
                       const std::string& layer, const std::string& description,
                       const std::string& crs_wkt) {
  const QuietGdal quiet;
  GDALDatasetUniquePtr dataset = new_package(path);
  OGRLayer* points = add_layer(*dataset, layer.c_str(), wkbPoint25D, crs_wkt, description, path);
  for (const PointColumn& column : table.columns) {
    OGRFieldDefn field(column.name.c_str(), type_of(column.kind));
    if (points->CreateField(&field) != OGRERR_NONE) fail(path);
  }
  dataset->StartTransaction();
  for (const PointRow& row : table.rows)
    add_row(*points, row, path);
  if (dataset->CommitTransaction() != OGRERR_NONE) fail(path);
  close(std::move(dataset), path);
}

}  // namespace understory
