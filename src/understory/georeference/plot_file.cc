#include "understory/georeference/plot_file.h"

#include <cpl_error.h>
#include <fmt/format.h>
#include <gdal_priv.h>
#include <ogrsf_frmts.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <numeric>
#include <optional>
#include <set>
#include <string_view>

#include "understory/geometry/quiet_gdal.h"
#include "understory/util/error.h"
#include "understory/util/files/csv.h"

namespace understory {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr const char* kAllSeen = "seen";  // the first row of plots.csv
constexpr const char* kExpected =
    "expected sample plots: X,Y,R, a .csv with x, y and radius_m, or polygons (or points with a "
    "column radius_m) as a GeoPackage";

// The three numbers of "X,Y,R"; nothing where it is no such text.
std::optional<Eigen::Vector3d> numbers_of(const std::string& given) {
  const std::vector<std::string_view> parts = split(given, ",", false);
  if (parts.size() != 3) return std::nullopt;
  Eigen::Vector3d numbers;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto number = to_number(trimmed(parts[i]));
    if (!number) return std::nullopt;
    numbers[static_cast<Eigen::Index>(i)] = *number;
  }
  return numbers;
}

// Throws where an outline is none.
void check(const PlotOutline& plot, const std::string& file) {
  const std::string position = "plot " + plot.id;
  if (plot.rings.empty()) {
    if (!plot.centre.allFinite())
      throw InputError(file, position, "expected a centre with two numbers");
    if (!(plot.radius_m > 0.0) || !std::isfinite(plot.radius_m))
      throw InputError(file, position, "expected a radius_m over 0");
    return;
  }
  double area = 0.0;
  for (const PlaneRing& ring : plot.rings) {
    for (const Eigen::Vector2d& point : ring)
      if (!point.allFinite())
        throw InputError(file, position, "expected an outline whose coordinates are numbers");
    area += signed_area_m2(ring);
  }
  if (!(area > 0.0)) throw InputError(file, position, "expected an outline with an area");
}

void check_all(const std::vector<PlotOutline>& plots, const std::string& file) {
  if (plots.empty()) throw InputError(file, "", "expected at least one plot: it holds none");
  std::set<std::string> ids;
  for (const PlotOutline& plot : plots) {
    if (!ids.insert(plot.id).second)
      throw InputError(file, "plot " + plot.id, "expected every id once");
    if (plot.id == kAllSeen)
      throw InputError(file, "plot " + plot.id,
                       "expected another id: plots.csv calls so the whole area that was seen");
    check(plot, file);
  }
}

std::vector<PlotOutline> read_table(const std::string& file) {
  CsvReader reader(file, {"x", "y", "radius_m"});
  const bool with_id = reader.find({"id"}).has_value();
  std::vector<PlotOutline> plots;
  while (reader.next()) {
    PlotOutline plot;
    plot.id = with_id ? std::string(reader.text("id")) : "";
    if (plot.id.empty()) plot.id = std::to_string(plots.size() + 1);
    plot.centre = {reader.finite("x"), reader.finite("y")};
    plot.radius_m = reader.finite("radius_m");
    if (!(plot.radius_m > 0.0)) reader.fail("expected a radius_m over 0");
    plots.push_back(std::move(plot));
  }
  return plots;
}

// From the system of the file to the one that is asked for.
class SystemChange {
 public:
  SystemChange() = default;
  SystemChange(const OGRSpatialReference* own, const std::string& system, const std::string& file) {
    const bool known = own != nullptr && (own->IsProjected() != 0 || own->IsGeographic() != 0);
    if (!known && system.empty()) return;
    if (known && system.empty())
      throw InputError(file, "",
                       fmt::format("expected plots in the frame of the cloud, which names no "
                                   "coordinate system: these are in {}. Name that of the cloud "
                                   "(--crs)",
                                   own->GetName()));
    if (!known)
      throw InputError(file, "",
                       "expected plots with a coordinate system: the file names none, and the "
                       "cloud is in one");
    from_ = std::unique_ptr<OGRSpatialReference>(own->Clone());
    from_->SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    to_.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    if (to_.SetFromUserInput(system.c_str()) != OGRERR_NONE)
      throw InputError(file, "", "not a coordinate system of the cloud: " + system.substr(0, 60));
    change_.reset(OGRCreateCoordinateTransformation(from_.get(), &to_));
    if (change_ == nullptr)
      throw InputError(file, "",
                       fmt::format("no way is known from its coordinate system, {}, to that of "
                                   "the cloud",
                                   own->GetName()));
  }
  // NaN where the system does not reach.
  [[nodiscard]] Eigen::Vector2d operator()(double x, double y) const {
    if (change_ != nullptr && change_->Transform(1, &x, &y) == 0) return {kNone, kNone};
    return {x, y};
  }

 private:
  std::unique_ptr<OGRSpatialReference> from_;
  OGRSpatialReference to_;
  std::unique_ptr<OGRCoordinateTransformation> change_;
};

PlaneRing ring_of(const OGRLinearRing& ring, bool outer, const SystemChange& change) {
  PlaneRing points;
  int count = ring.getNumPoints();
  // The last point is the first one again.
  if (count > 1 && ring.getX(0) == ring.getX(count - 1) && ring.getY(0) == ring.getY(count - 1))
    --count;
  for (int i = 0; i < count; ++i)
    points.push_back(change(ring.getX(i), ring.getY(i)));
  orient(points, outer);
  return points;
}

void add_polygon(const OGRPolygon& polygon, const SystemChange& change,
                 std::vector<PlaneRing>& rings) {
  if (polygon.getExteriorRing() == nullptr) return;
  rings.push_back(ring_of(*polygon.getExteriorRing(), true, change));
  for (int i = 0; i < polygon.getNumInteriorRings(); ++i)
    rings.push_back(ring_of(*polygon.getInteriorRing(i), false, change));
}

// Of a feature, without its id.
PlotOutline outline_of(const OGRFeature& feature, const SystemChange& change,
                       const std::string& file, const std::string& id) {
  PlotOutline plot;
  plot.id = id;
  const OGRGeometry* shape = feature.GetGeometryRef();
  if (shape == nullptr) throw InputError(file, "plot " + id, "expected an outline: it has none");
  std::unique_ptr<OGRGeometry> straight(shape->getLinearGeometry());
  const OGRwkbGeometryType type = wkbFlatten(straight->getGeometryType());
  if (type == wkbPoint) {
    const int column = feature.GetFieldIndex("radius_m");
    if (column < 0)
      throw InputError(file, "plot " + id, "expected a column radius_m beside its point");
    plot.centre = change(straight->toPoint()->getX(), straight->toPoint()->getY());
    plot.radius_m = feature.IsFieldSetAndNotNull(column) ? feature.GetFieldAsDouble(column) : kNone;
  } else if (type == wkbPolygon) {
    add_polygon(*straight->toPolygon(), change, plot.rings);
  } else if (type == wkbMultiPolygon) {
    for (const OGRPolygon* part : *straight->toMultiPolygon())
      add_polygon(*part, change, plot.rings);
  } else {
    throw InputError(file, "plot " + id,
                     fmt::format("expected a polygon or a point, not a {}",
                                 OGRGeometryTypeToName(straight->getGeometryType())));
  }
  // Of such an outline some ground would count twice, or as outside.
  const double area =
      std::accumulate(plot.rings.begin(), plot.rings.end(), 0.0,
                      [](double sum, const PlaneRing& ring) { return sum + signed_area_m2(ring); });
  if (area > 0.0 && straight->IsValid() == 0)
    throw InputError(
        file, "plot " + id,
        "expected an outline that does not cross itself, of parts that do not overlap. "
        "QGIS repairs it: Vector geometry, Fix geometries");
  if (type != wkbPoint && plot.rings.empty())
    throw InputError(file, "plot " + id, "expected an outline with an area");
  return plot;
}

std::string id_of(const OGRFeature& feature) {
  for (const char* name : {"id", "plot_id", "plot", "name"}) {
    const int column = feature.GetFieldIndex(name);
    if (column >= 0 && feature.IsFieldSetAndNotNull(column))
      return feature.GetFieldAsString(column);
  }
  return std::to_string(feature.GetFID());
}

// `system`: nothing leaves the coordinates as they are.
std::vector<PlotOutline> read_layer(const std::string& file,
                                    const std::optional<std::string>& system) {
  const QuietGdal quiet;
  const GDALDatasetUniquePtr dataset(
      GDALDataset::Open(file.c_str(), GDAL_OF_VECTOR | GDAL_OF_READONLY));
  if (dataset == nullptr) throw InputError(file, "", kExpected);
  OGRLayer* layer = dataset->GetLayerByName("plots");
  if (layer == nullptr && dataset->GetLayerCount() > 0) layer = dataset->GetLayer(0);
  if (layer == nullptr) throw InputError(file, "", kExpected);
  const SystemChange change =
      system ? SystemChange(layer->GetSpatialRef(), *system, file) : SystemChange();
  std::vector<PlotOutline> plots;
  layer->ResetReading();
  while (const OGRFeatureUniquePtr feature{layer->GetNextFeature()})
    plots.push_back(outline_of(*feature, change, file, id_of(*feature)));
  if (CPLGetLastErrorType() >= CE_Failure)
    throw InputError(file, "", std::string("expected whole plots: ") + CPLGetLastErrorMsg());
  return plots;
}

std::vector<PlotOutline> read_any(const std::string& given,
                                  const std::optional<std::string>& system) {
  std::vector<PlotOutline> plots;
  std::error_code ignored;
  if (const auto numbers = numbers_of(given)) {
    PlotOutline plot;
    plot.id = "1";
    plot.centre = numbers->head<2>();
    plot.radius_m = numbers->z();
    plots.push_back(std::move(plot));
  } else if (!std::filesystem::exists(given, ignored)) {
    throw InputError(given, "", std::string(kExpected) + ": no such file");
  } else if (std::filesystem::path(given).extension() == ".csv") {
    plots = read_table(given);
  } else {
    plots = read_layer(given, system);
  }
  check_all(plots, given);
  return plots;
}

}  // namespace

bool is_plot_text(const std::string& given) {
  return numbers_of(given).has_value();
}

std::vector<PlotOutline> read_plots(const std::string& given, const std::string& system) {
  return read_any(given, system);
}

void check_plots(const std::string& given) {
  (void)read_any(given, std::nullopt);
}

}  // namespace understory
