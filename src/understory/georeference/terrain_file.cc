#include "understory/georeference/terrain_file.h"

#include <cpl_error.h>
#include <fmt/format.h>
#include <gdal_priv.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>
#include <string>
#include <system_error>
#include <vector>

#include "understory/geometry/quiet_gdal.h"
#include "understory/georeference/georeference_constants.h"
#include "understory/georeference/systems/coordinate_system.h"
#include "understory/util/error.h"
#include "understory/util/files/text_file.h"

namespace understory {
namespace {

using namespace georeference_constants::terrain_file;

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

// An opened raster: cells of `width` times `height` (north up), in its own coordinates.
class TerrainFile {
 public:
  explicit TerrainFile(const std::filesystem::path& path) : path_(path.string()) {
    if (!std::filesystem::exists(path)) fail("expected a terrain model: no such file");
    refuse_unreadable(false);
    dataset_.reset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY));
    if (dataset_ == nullptr || dataset_->GetRasterCount() < 1)
      fail("expected a terrain model (GeoTIFF, ESRI ASCII grid, XYZ on a regular grid)");
    if (dataset_->GetGeoTransform(to_map_.data()) != CE_None)
      fail("expected a terrain model that says where it lies: there is no geotransform");
    if (to_map_[2] != 0.0 || to_map_[4] != 0.0 || to_map_[1] <= 0.0 || to_map_[5] == 0.0)
      fail("expected a terrain model with north up, not a rotated one");
  }

  [[noreturn]] void fail(const std::string& expected) const {
    throw InputError(path_, "", expected);
  }
  // GDAL takes what the disk cannot read for the end of the file, or says no more than that it
  // failed. Throws ReadError with the place. Large files are read to their end only after a
  // failure.
  void refuse_unreadable(bool failed) const {
    constexpr std::uintmax_t kAlways = std::uintmax_t{1} << 30U;
    std::error_code error;
    if (!std::filesystem::is_regular_file(path_, error)) return;
    if (!failed && std::filesystem::file_size(path_, error) > kAlways) return;
    std::ifstream file(path_, std::ios::binary);
    std::vector<char> buffer(std::size_t{1} << 20U);
    std::uint64_t done = 0;
    while (file.read(buffer.data(), static_cast<std::streamsize>(buffer.size())))
      done += buffer.size();
    check_readable(file, path_, "at byte " + std::to_string(done));
  }
  // WKT, empty if none.
  [[nodiscard]] std::string system() const {
    const OGRSpatialReference* system = dataset_->GetSpatialRef();
    if (system == nullptr || (system->IsProjected() == 0 && system->IsGeographic() == 0)) return "";
    char* text = nullptr;
    system->exportToWkt(&text);
    std::string wkt = text == nullptr ? "" : text;
    CPLFree(text);
    return wkt;
  }
  [[nodiscard]] double cell() const { return to_map_[1]; }
  [[nodiscard]] Raster read(const PlaneArea& area) const;

  // GDAL finds a line of an ASCII grid behind the one before. Where the file is cut off it looks
  // for all of them again and again, without end. So lines are asked for one by one.
  void pass_lines(GDALRasterBand* band, int lines) const {
    if (std::string(dataset_->GetDriverName()).find("ASCII") == std::string::npos &&
        std::string(dataset_->GetDriverName()) != "AAIGrid")
      return;
    double value = 0.0;
    for (int line = 0; line < lines; ++line) {
      if (band->RasterIO(GF_Read, 0, line, 1, 1, &value, 1, 1, GDT_Float64, 0, 0, nullptr) !=
          CE_None)
        fail_at(line);
    }
  }

 private:
  [[noreturn]] void fail_at(int line) const {
    refuse_unreadable(true);
    throw InputError(path_, "line " + std::to_string(line + 1),
                     std::string("expected readable heights: ") + CPLGetLastErrorMsg());
  }

  std::string path_;
  GDALDatasetUniquePtr dataset_;
  std::array<double, 6> to_map_{};
};

Raster TerrainFile::read(const PlaneArea& area) const {
  const int width = dataset_->GetRasterXSize();
  const int height = dataset_->GetRasterYSize();
  const double dy = std::abs(to_map_[5]);
  if (std::abs(dy - cell()) > 1e-6 * cell()) fail("expected square cells");
  const bool north_first = to_map_[5] < 0.0;
  const double south = north_first ? to_map_[3] - height * dy : to_map_[3];
  const auto clamped = [](double value, int most) {
    return static_cast<int>(std::clamp(value, 0.0, static_cast<double>(most)));
  };
  const int first_column = clamped(std::floor((area.low.x() - to_map_[0]) / cell()) - 1.0, width);
  const int last_column = clamped(std::ceil((area.high.x() - to_map_[0]) / cell()) + 1.0, width);
  const int first_row = clamped(std::floor((area.low.y() - south) / dy) - 1.0, height);
  const int last_row = clamped(std::ceil((area.high.y() - south) / dy) + 1.0, height);
  if (last_column <= first_column || last_row <= first_row)
    fail(
        fmt::format("expected a terrain model of the place. It holds x {:.1f} to {:.1f}, y {:.1f} "
                    "to {:.1f}. The run needs x {:.1f} to {:.1f}, y {:.1f} to {:.1f}",
                    to_map_[0], to_map_[0] + width * cell(), south, south + height * dy,
                    area.low.x(), area.high.x(), area.low.y(), area.high.y()));
  Raster raster;
  raster.x0 = to_map_[0] + first_column * cell();
  raster.y0 = south + first_row * dy;
  raster.cell_m = cell();
  raster.columns = last_column - first_column;
  raster.rows = last_row - first_row;
  if (static_cast<double>(raster.columns) * raster.rows > kMostCells)
    fail("expected a terrain model with fewer cells over the place");
  GDALRasterBand* band = dataset_->GetRasterBand(1);
  int has_no_data = 0;
  const double no_data = band->GetNoDataValue(&has_no_data);
  std::vector<double> line(static_cast<std::size_t>(raster.columns));
  raster.values.assign(
      static_cast<std::size_t>(raster.columns) * static_cast<std::size_t>(raster.rows), kUnknown);
  bool first = true;
  const int begin = north_first ? height - last_row : first_row;
  pass_lines(band, begin);
  for (int k = 0; k < raster.rows; ++k) {
    const int row = north_first ? raster.rows - 1 - k : k;
    const int in_file = begin + k;
    if (band->RasterIO(GF_Read, first_column, in_file, raster.columns, 1, line.data(),
                       raster.columns, 1, GDT_Float64, 0, 0, nullptr) != CE_None)
      fail_at(in_file);
    for (int column = 0; column < raster.columns; ++column) {
      const double value = line[static_cast<std::size_t>(column)];
      if (!std::isfinite(value) || (has_no_data != 0 && value == no_data)) continue;
      if (std::abs(value) > 1e5) fail(fmt::format("expected heights in metres, found {:g}", value));
      if (first) raster.z0 = std::floor(value);
      first = false;
      raster.values[raster.index(column, row)] = static_cast<float>(value - raster.z0);
    }
  }
  if (first) fail("expected heights over the place: there are only cells without data");
  return raster;
}

// The heights of a file in a coordinate system, over cells of the local frame.
Raster in_local_frame(const TerrainFile& file, const CoordinateSystem& system,
                      const PlaneArea& area, const EastNorthUp& frame) {
  const auto in_system = [&](double x, double y) {
    const auto at = system.from_place(frame.to_place({x, y, 0.0}));
    if (!at) file.fail("expected a terrain model whose coordinate system reaches the place");
    return Eigen::Vector2d(at->head<2>());
  };
  PlaneArea wanted{in_system(area.low.x(), area.low.y()), in_system(area.low.x(), area.low.y())};
  constexpr int kEdge = 8;  // places along each side: sides of one frame are curves in the other
  for (int i = 0; i <= kEdge; ++i) {
    for (int j = 0; j <= kEdge; ++j) {
      const Eigen::Vector2d at =
          in_system(area.low.x() + (area.high.x() - area.low.x()) * i / kEdge,
                    area.low.y() + (area.high.y() - area.low.y()) * j / kEdge);
      wanted.low = wanted.low.cwiseMin(at);
      wanted.high = wanted.high.cwiseMax(at);
    }
  }
  const Raster source = file.read(wanted);
  constexpr double kMetresPerDegree = 111320.0;
  Raster raster;
  raster.cell_m = std::max(0.25, source.cell_m * (system.is_geographic() ? kMetresPerDegree : 1.0));
  raster.x0 = area.low.x();
  raster.y0 = area.low.y();
  raster.columns = static_cast<int>(std::ceil((area.high.x() - area.low.x()) / raster.cell_m)) + 1;
  raster.rows = static_cast<int>(std::ceil((area.high.y() - area.low.y()) / raster.cell_m)) + 1;
  if (static_cast<double>(raster.columns) * raster.rows > kMostCells)
    file.fail("expected a terrain model with fewer cells over the place");
  raster.values.assign(
      static_cast<std::size_t>(raster.columns) * static_cast<std::size_t>(raster.rows), kUnknown);
  for (int row = 0; row < raster.rows; ++row) {
    for (int column = 0; column < raster.columns; ++column) {
      const double x = raster.x0 + (column + 0.5) * raster.cell_m;
      const double y = raster.y0 + (row + 0.5) * raster.cell_m;
      const Eigen::Vector2d at = in_system(x, y);
      const double height = source.interpolate(at.x(), at.y());
      // The earth falls away under the level plane.
      const double drop = frame.to_place({x, y, 0.0}).height_m - frame.origin().height_m;
      raster.values[raster.index(column, row)] =
          static_cast<float>(height - frame.origin().height_m - drop);
    }
  }
  return raster;
}

}  // namespace

Raster read_terrain(const std::filesystem::path& path, const PlaneArea& area,
                    const std::optional<GeodeticPlace>& origin) {
  const QuietGdal quiet;
  const TerrainFile file(path);
  const std::string wkt = file.system();
  if (wkt.empty()) return file.read(area);
  const CoordinateSystem system(wkt);
  if (origin) return in_local_frame(file, system, area, EastNorthUp(*origin));
  if (system.is_geographic())
    file.fail(
        "expected a terrain model in metres, or a run whose place on the earth is known "
        "(fit it to a GNSS path first)");
  return file.read(area);
}

}  // namespace understory
