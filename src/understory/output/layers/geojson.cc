#include "understory/output/layers/geojson.h"

#include <cpl_error.h>
#include <ogrsf_frmts.h>

#include <memory>
#include <system_error>

#include "understory/geometry/quiet_gdal.h"
#include "understory/util/error.h"
#include "understory/util/files/atomic_file.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail_to_write(const fs::path& path) {
  std::error_code ignored;
  fs::remove(part_path(path), ignored);
  throw OutputError(path.string(), std::string("cannot be written: ") + CPLGetLastErrorMsg());
}

// From the layer's system to longitude and latitude.
std::unique_ptr<OGRCoordinateTransformation> way_to_globe(OGRLayer& layer,
                                                          const fs::path& package) {
  const OGRSpatialReference* system = layer.GetSpatialRef();
  if (system == nullptr || system->IsLocal() != 0)
    throw InputError(
        package.string(), layer.GetName(),
        "has no place on the globe, which GeoJSON needs: `understory georeference` gives "
        "a run one, and `understory inventory --crs` a cloud");
  OGRSpatialReference globe;
  globe.SetWellKnownGeogCS("WGS84");
  globe.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  std::unique_ptr<OGRCoordinateTransformation> way(
      OGRCreateCoordinateTransformation(system, &globe));
  if (!way)
    throw InputError(package.string(), layer.GetName(),
                     std::string("no way leads to WGS 84: ") + CPLGetLastErrorMsg());
  return way;
}

// "trees, path".
std::string layers_of(GDALDataset& package) {
  std::string names;
  for (OGRLayer* layer : package.GetLayers())
    names += (names.empty() ? "" : ", ") + std::string(layer->GetName());
  return names.empty() ? "none" : names;
}

void add_fields(OGRLayer& from, OGRLayer& to, bool points, const fs::path& path) {
  for (int k = 0; k < from.GetLayerDefn()->GetFieldCount(); ++k)
    if (to.CreateField(from.GetLayerDefn()->GetFieldDefn(k)) != OGRERR_NONE) fail_to_write(path);
  OGRFieldDefn height("z", OFTReal);
  if (points && to.CreateField(&height) != OGRERR_NONE) fail_to_write(path);
}

std::size_t add_features(OGRLayer& from, OGRLayer& to, OGRCoordinateTransformation& way,
                         const fs::path& package, const fs::path& path) {
  std::size_t count = 0;
  from.ResetReading();
  while (const std::unique_ptr<OGRFeature> feature{from.GetNextFeature()}) {
    const std::unique_ptr<OGRFeature> placed(new OGRFeature(to.GetLayerDefn()));
    placed->SetFrom(feature.get());
    if (OGRGeometry* geometry = placed->GetGeometryRef()) {
      if (wkbFlatten(geometry->getGeometryType()) == wkbPoint && geometry->Is3D() != 0)
        placed->SetField("z", geometry->toPoint()->getZ());
      geometry->flattenTo2D();
      if (geometry->transform(&way) != OGRERR_NONE)
        throw InputError(package.string(), from.GetName(),
                         "a place lies beyond its coordinate system");
    }
    if (to.CreateFeature(placed.get()) != OGRERR_NONE) fail_to_write(path);
    ++count;
  }
  return count;
}

}  // namespace

std::size_t write_geojson(const fs::path& package, const std::string& layer, const fs::path& path) {
  const QuietGdal quiet;
  const GDALDatasetUniquePtr source(
      GDALDataset::Open(package.c_str(), GDAL_OF_VECTOR | GDAL_OF_READONLY));
  if (source == nullptr) throw InputError(package.string(), "", "expected a GeoPackage");
  OGRLayer* from = source->GetLayerByName(layer.c_str());
  if (from == nullptr)
    throw InputError(package.string(), "",
                     "expected a layer `" + layer + "`: the file has " + layers_of(*source));
  const auto way = way_to_globe(*from, package);
  GDALDriver* driver = GetGDALDriverManager()->GetDriverByName("GeoJSON");
  if (driver == nullptr) throw InternalError("this GDAL has no driver GeoJSON");
  std::error_code ignored;
  fs::remove(part_path(path), ignored);
  GDALDatasetUniquePtr target(
      driver->Create(part_path(path).c_str(), 0, 0, 0, GDT_Unknown, nullptr));
  if (target == nullptr) fail_to_write(path);
  const OGRwkbGeometryType type = wkbFlatten(from->GetGeomType());
  OGRSpatialReference globe;
  globe.SetWellKnownGeogCS("WGS84");
  globe.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  char** options = CSLSetNameValue(nullptr, "RFC7946", "YES");
  OGRLayer* to = target->CreateLayer(layer.c_str(), &globe, type, options);
  CSLDestroy(options);
  if (to == nullptr) fail_to_write(path);
  add_fields(*from, *to, type == wkbPoint, path);
  const std::size_t count = add_features(*from, *to, *way, package, path);
  CPLErrorReset();
  GDALClose(GDALDataset::ToHandle(target.release()));
  if (CPLGetLastErrorType() >= CE_Failure) fail_to_write(path);
  sync_and_rename(part_path(path), path);
  return count;
}

}  // namespace understory
