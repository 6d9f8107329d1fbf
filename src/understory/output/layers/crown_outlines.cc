#include "understory/output/layers/crown_outlines.h"

#include <gdal_alg.h>
#include <gdal_priv.h>
#include <ogrsf_frmts.h>

#include <array>
#include <cstddef>
#include <map>
#include <memory>
#include <utility>

#include "understory/geometry/quiet_gdal.h"
#include "understory/util/error.h"

namespace understory {
namespace {

PlaneRing ring_of(const OGRLinearRing& drawn, bool outer) {
  PlaneRing ring;
  for (int i = 0; i + 1 < drawn.getNumPoints(); ++i)  // the last point is the first one again
    ring.emplace_back(drawn.getX(i), drawn.getY(i));
  orient(ring, outer);
  return ring;
}

void add_rings(const OGRPolygon& part, std::vector<PlaneRing>& rings) {
  rings.push_back(ring_of(*part.getExteriorRing(), true));
  for (int i = 0; i < part.getNumInteriorRings(); ++i)
    rings.push_back(ring_of(*part.getInteriorRing(i), false));
}

GDALDatasetUniquePtr in_memory(const char* driver, int columns, int rows, int bands) {
  GDALDriver* found = GetGDALDriverManager()->GetDriverByName(driver);
  if (found == nullptr) throw InternalError(std::string("this GDAL has no driver ") + driver);
  GDALDatasetUniquePtr made(
      found->Create("", columns, rows, bands, bands > 0 ? GDT_Int32 : GDT_Unknown, nullptr));
  if (made == nullptr) throw InternalError(std::string("no memory for a raster of crowns"));
  return made;
}

// The crown of each cell as polygons, by the number of the crown.
std::map<int, std::vector<PlaneRing>> outlines_of_cells(const CanopyCrowns& crowns) {
  const QuietGdal quiet;
  const Raster& grid = crowns.canopy;
  const GDALDatasetUniquePtr cells = in_memory("MEM", grid.columns, grid.rows, 1);
  // Row 0 is the southern edge: the step along y is positive.
  std::array<double, 6> transform = {grid.x0, grid.cell_m, 0.0, grid.y0, 0.0, grid.cell_m};
  cells->SetGeoTransform(transform.data());
  GDALRasterBand* band = cells->GetRasterBand(1);
  band->SetNoDataValue(CanopyCrowns::kNone);
  std::vector<std::int32_t> owner = crowns.owner;
  const GDALDatasetUniquePtr drawn = in_memory("Memory", 0, 0, 0);
  OGRLayer* layer = drawn->CreateLayer("crowns", nullptr, wkbPolygon, nullptr);
  OGRFieldDefn field("crown", OFTInteger);
  if (layer == nullptr || layer->CreateField(&field) != OGRERR_NONE ||
      band->RasterIO(GF_Write, 0, 0, grid.columns, grid.rows, owner.data(), grid.columns, grid.rows,
                     GDT_Int32, 0, 0, nullptr) != CE_None ||
      GDALPolygonize(GDALRasterBand::ToHandle(band), GDALRasterBand::ToHandle(band->GetMaskBand()),
                     OGRLayer::ToHandle(layer), 0, nullptr, nullptr, nullptr) != CE_None)
    throw InternalError("the outlines of crowns cannot be drawn");
  std::map<int, std::vector<PlaneRing>> outlines;
  for (const OGRFeatureUniquePtr& part : *layer)
    add_rings(*part->GetGeometryRef()->toPolygon(), outlines[part->GetFieldAsInteger(0)]);
  return outlines;
}

}  // namespace

std::vector<CrownOutline> crown_outlines(const InventoryResult& inventory) {
  std::vector<CrownOutline> outlines;
  for (std::size_t i = 0; i < inventory.crown_outlines.size(); ++i) {
    const PlaneRing& outline = inventory.crown_outlines[i];
    if (outline.size() > 2) outlines.push_back({inventory.trees[i].id, {outline}});
  }
  if (!inventory.crowns || inventory.crowns->crowns.empty()) return outlines;
  std::map<int, std::vector<PlaneRing>> of_cells = outlines_of_cells(*inventory.crowns);
  for (std::size_t i = 0; i < inventory.crown_ids.size(); ++i) {
    // A top beside a higher one may have no cell of its own.
    const auto found = of_cells.find(static_cast<int>(i));
    if (inventory.crown_ids[i] != 0 && found != of_cells.end())
      outlines.push_back({inventory.crown_ids[i], std::move(found->second)});
  }
  return outlines;
}

}  // namespace understory
