#include "understory/output/layers/moved_vectors.h"

#include <cpl_conv.h>
#include <cpl_error.h>
#include <cpl_string.h>
#include <gdal_priv.h>
#include <ogrsf_frmts.h>

#include <Eigen/Core>
#include <cmath>
#include <memory>

#include "understory/geometry/quiet_gdal.h"
#include "understory/georeference/systems/coordinate_system.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using Eigen::Vector3d;

[[noreturn]] void fail_at(const std::filesystem::path& path) {
  throw OutputError(path.string(), std::string("cannot be written: ") + CPLGetLastErrorMsg());
}

// Mean height of the points of the layer `trees`; 0 where there are none.
double mean_height(GDALDataset& dataset) {
  double sum = 0.0;
  int count = 0;
  OGRLayer* trees = dataset.GetLayerByName("trees");
  if (trees == nullptr) return 0.0;
  trees->ResetReading();
  while (const OGRFeatureUniquePtr tree{trees->GetNextFeature()}) {
    const OGRGeometry* shape = tree->GetGeometryRef();
    if (shape == nullptr || wkbFlatten(shape->getGeometryType()) != wkbPoint) continue;
    const double height = shape->toPoint()->getZ();
    if (!std::isfinite(height)) continue;
    sum += height;
    ++count;
  }
  return count > 0 ? sum / count : 0.0;
}

// Of metres towards the east, in the units of a frame, per metre towards the north there.
double east_units(const LayerFrame& frame, const Vector3d& at) {
  const bool geographic = frame.system() != nullptr && frame.system()->is_geographic();
  return geographic ? 1.0 / std::cos(at.y() * M_PI / 180.0) : 1.0;
}

class Mover {
 public:
  Mover(const VectorMove& move, double height) : move_(move), height_(height) {}

  [[nodiscard]] Vector3d place(const Vector3d& point) const {
    return move_.to.from_world(move_.target_from_world * move_.from.to_world(point));
  }
  [[nodiscard]] double height() const { return height_; }
  // Of a direction at a place, degrees clockwise from the y axis of the layers.
  [[nodiscard]] double bearing_deg(const Vector3d& at, double degrees) const {
    const double turn = degrees * M_PI / 180.0;
    const double unit = move_.from.units_per_metre();
    const Vector3d ahead =
        at + unit * Vector3d(std::sin(turn) * east_units(move_.from, at), std::cos(turn), 0.0);
    const Vector3d here = place(at);
    const Vector3d way = place(ahead) - here;
    const double found = std::atan2(way.x() / east_units(move_.to, here), way.y()) * 180.0 / M_PI;
    return std::round(found < 0.0 ? found + 360.0 : found);
  }
  // A place of the world frame of the run, in that of the result.
  [[nodiscard]] Vector3d in_world(double x, double y, double z) const {
    return move_.target_from_world * Vector3d(x, y, z);
  }

 private:
  const VectorMove& move_;
  double height_;
};

void move_ring(const Mover& mover, OGRLinearRing& ring) {
  for (int i = 0; i < ring.getNumPoints(); ++i) {
    const Vector3d at = mover.place({ring.getX(i), ring.getY(i), mover.height()});
    ring.setPoint(i, at.x(), at.y());
  }
}

void move_shape(const Mover& mover, OGRGeometry& shape) {
  const OGRwkbGeometryType type = wkbFlatten(shape.getGeometryType());
  if (type == wkbPoint) {
    OGRPoint& point = *shape.toPoint();
    const Vector3d at = mover.place({point.getX(), point.getY(), point.getZ()});
    point.setX(at.x());
    point.setY(at.y());
    point.setZ(at.z());
  } else if (type == wkbLineString) {
    OGRLineString& line = *shape.toLineString();
    for (int i = 0; i < line.getNumPoints(); ++i) {
      const Vector3d at = mover.place({line.getX(i), line.getY(i), line.getZ(i)});
      line.setPoint(i, at.x(), at.y(), at.z());
    }
  } else if (type == wkbMultiPolygon) {
    for (OGRPolygon* part : *shape.toMultiPolygon()) {
      for (OGRLinearRing* ring : *part)
        move_ring(mover, *ring);
    }
  }
}

void move_columns(const Mover& mover, const VectorMove& move, OGRFeature& row) {
  const OGRGeometry* shape = row.GetGeometryRef();
  if (shape == nullptr) return;
  OGREnvelope box;
  shape->getEnvelope(&box);
  const int bearing = row.GetFieldIndex("bearing_deg");
  if (bearing >= 0 && wkbFlatten(shape->getGeometryType()) == wkbPoint) {
    const OGRPoint& point = *shape->toPoint();
    row.SetField(bearing, mover.bearing_deg({point.getX(), point.getY(), point.getZ()},
                                            row.GetFieldAsDouble(bearing)));
  }
  const int x = row.GetFieldIndex("x");
  const int y = row.GetFieldIndex("y");
  if (x < 0 || y < 0 || !row.IsFieldSetAndNotNull(x) || !row.IsFieldSetAndNotNull(y)) return;
  const double ground =
      move.from.to_world({0.5 * (box.MinX + box.MaxX), 0.5 * (box.MinY + box.MaxY), mover.height()})
          .z();
  const Vector3d at = mover.in_world(row.GetFieldAsDouble(x), row.GetFieldAsDouble(y), ground);
  row.SetField(x, at.x());
  row.SetField(y, at.y());
}

OGRLayer& layer_like(OGRLayer& source, GDALDataset& target, const LayerFrame& frame,
                     const std::filesystem::path& path) {
  OGRSpatialReference system;
  system.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  if (frame.wkt().empty()) {
    system.SetLocalCS("Undefined Cartesian SRS");  // by this name GDAL knows srs_id -1
  } else if (system.SetFromUserInput(frame.wkt().c_str()) != OGRERR_NONE) {
    throw InternalError("not a coordinate system: " + frame.wkt());
  }
  const char* description = source.GetMetadataItem("DESCRIPTION");
  char** options =
      CSLSetNameValue(nullptr, "DESCRIPTION", description == nullptr ? "" : description);
  OGRLayer* layer = target.CreateLayer(source.GetName(), &system, source.GetGeomType(), options);
  CSLDestroy(options);
  if (layer == nullptr) fail_at(path);
  const OGRFeatureDefn& columns = *source.GetLayerDefn();
  for (int i = 0; i < columns.GetFieldCount(); ++i) {
    OGRFieldDefn column(columns.GetFieldDefn(i)->GetNameRef(), columns.GetFieldDefn(i)->GetType());
    if (layer->CreateField(&column) != OGRERR_NONE) fail_at(path);
  }
  return *layer;
}

}  // namespace

void add_moved_vectors(const std::filesystem::path& from_file, const std::filesystem::path& to_file,
                       const VectorMove& move) {
  if (!std::filesystem::exists(from_file) || !std::filesystem::exists(to_file)) return;
  const QuietGdal quiet;
  // The same rows give the same bytes: without this the file holds the time of writing.
  CPLSetThreadLocalConfigOption("OGR_CURRENT_DATE", "2000-01-01T00:00:00.000Z");
  const GDALDatasetUniquePtr source(
      GDALDataset::Open(from_file.c_str(), GDAL_OF_VECTOR | GDAL_OF_READONLY));
  if (source == nullptr) throw InputError(from_file.string(), "", "expected a GeoPackage");
  GDALDatasetUniquePtr target(GDALDataset::Open(to_file.c_str(), GDAL_OF_VECTOR | GDAL_OF_UPDATE));
  if (target == nullptr) fail_at(to_file);
  const Mover mover(move, mean_height(*source));
  for (const char* name : {"plots", "look_again", "crowns", "stumps", "logs"}) {
    OGRLayer* own = source->GetLayerByName(name);
    if (own == nullptr) continue;
    OGRLayer& layer = layer_like(*own, *target, move.to, to_file);
    target->StartTransaction();
    own->ResetReading();
    while (const OGRFeatureUniquePtr row{own->GetNextFeature()}) {
      const std::unique_ptr<OGRFeature> moved(new OGRFeature(layer.GetLayerDefn()));
      if (moved->SetFrom(row.get()) != OGRERR_NONE) fail_at(to_file);
      move_columns(mover, move, *moved);
      if (moved->GetGeometryRef() != nullptr) move_shape(mover, *moved->GetGeometryRef());
      if (layer.CreateFeature(moved.get()) != OGRERR_NONE) fail_at(to_file);
    }
    if (target->CommitTransaction() != OGRERR_NONE) fail_at(to_file);
  }
  CPLErrorReset();
  GDALClose(GDALDataset::ToHandle(target.release()));
  if (CPLGetLastErrorType() >= CE_Failure) fail_at(to_file);
}

}  // namespace understory
