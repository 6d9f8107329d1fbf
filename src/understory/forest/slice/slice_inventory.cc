#include "understory/forest/slice/slice_inventory.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_set>
#include <utility>
#include <vector>

#include "understory/forest/forest_constants.h"
#include "understory/forest/slice/slice_stems.h"
#include "understory/forest/slice/slice_thinner.h"
#include "understory/forest/stems/stem_axis.h"
#include "understory/forest/trees/tree_doubt.h"
#include "understory/forest/trees/tree_sheets.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace forest_constants::slice_inventory;

struct Extent {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity());
  std::uint64_t points = 0;
};

Extent extent_of(const PointBlocks& cloud) {
  Extent extent;
  cloud([&](std::span<const Eigen::Vector3d> points) {
    for (const Eigen::Vector3d& point : points) {
      extent.low = extent.low.cwiseMin(point);
      extent.high = extent.high.cwiseMax(point);
    }
    extent.points += points.size();
  });
  return extent;
}

// The middle of the cut in each square, as a surface; where it holds nothing, that of all points.
class CutSurface {
 public:
  explicit CutSurface(const Extent& extent) {
    raster_.cell_m = std::max(1.0, (extent.high - extent.low).head<2>().maxCoeff() / kMostCells);
    raster_.x0 = std::floor(extent.low.x()) - raster_.cell_m;
    raster_.y0 = std::floor(extent.low.y()) - raster_.cell_m;
    raster_.z0 = 0.5 * (extent.low.z() + extent.high.z());
    raster_.columns = raster_.column_of(extent.high.x()) + 2;
    raster_.rows = raster_.row_of(extent.high.y()) + 2;
    const auto cells =
        static_cast<std::size_t>(raster_.columns) * static_cast<std::size_t>(raster_.rows);
    raster_.values.assign(cells, 0.0F);
    squares_.assign(cells, {});
  }

  void add(const Eigen::Vector3d& point) {
    const std::size_t at = raster_.index(raster_.column_of(point.x()), raster_.row_of(point.y()));
    Square& square = squares_[at];
    const auto z = static_cast<float>(point.z() - raster_.z0);
    square.low = std::min(square.low, z);
    square.high = std::max(square.high, z);
  }

  // Metres from the lowest to the highest point of a square, exceeded by a tenth of them.
  [[nodiscard]] double thickness() const {
    std::vector<float> all;
    for (const Square& square : squares_)
      if (square.high > square.low) all.push_back(square.high - square.low);
    if (all.empty()) return 0.0;
    const auto at = static_cast<std::ptrdiff_t>(kThinner * static_cast<double>(all.size() - 1));
    std::nth_element(all.begin(), all.begin() + at, all.end());
    return static_cast<double>(all[static_cast<std::size_t>(at)]);
  }

  // Lowered by breast height, as if it were ground.
  [[nodiscard]] Raster as_ground() {
    for (std::size_t i = 0; i < squares_.size(); ++i)
      if (squares_[i].high >= squares_[i].low)
        raster_.values[i] = 0.5F * (squares_[i].low + squares_[i].high);
    raster_.z0 -= kBreastHeight;
    return std::move(raster_);
  }

 private:
  struct Square {
    float low = std::numeric_limits<float>::max();
    float high = std::numeric_limits<float>::lowest();
  };
  Raster raster_;
  std::vector<Square> squares_;
};

// Squares of a metre that hold points.
double area_of(const std::vector<SlicePoint>& points) {
  std::unordered_set<std::int64_t> cells;
  for (const SlicePoint& point : points) {
    const auto column = static_cast<std::int64_t>(std::floor(point.x / kAreaCell));
    const auto row = static_cast<std::int64_t>(std::floor(point.y / kAreaCell));
    cells.insert(row * 4'000'037 + column);
  }
  return static_cast<double>(kAreaCell) * static_cast<double>(kAreaCell) *
         static_cast<double>(cells.size());
}

Tree tree_of(const InventoryResult& result, const StemFit& stem, int id) {
  Tree tree;
  tree.id = id;
  tree.x = result.origin.x() + stem.centre.x();
  tree.y = result.origin.y() + stem.centre.y();
  tree.z = result.ground.terrain.cell_value(tree.x, tree.y) + kBreastHeight;
  tree.dbh_m = 2.0 * stem.radius_m;
  tree.dbh_sd_m = 2.0 * std::sqrt(std::max(0.0, stem.covariance(2, 2)));
  tree.observations = stem.returns;
  tree.x_sd_m = std::sqrt(std::max(0.0, stem.covariance(0, 0)));
  tree.y_sd_m = std::sqrt(std::max(0.0, stem.covariance(1, 1)));
  return tree;
}

void remark(const std::vector<SliceStem>& stems, double thickness_m, InventoryResult& result) {
  result.remarks.push_back(fmt::format(
      "A cut of {:.0f} cm was measured. Heights, lean and the ground are not known, and a diameter "
      "is that of the cut, wherever it lies on the stem.",
      100.0 * thickness_m));
  for (std::size_t i = 0; i < stems.size(); ++i) {
    if (stems[i].rings_apart_m <= 0.0) continue;
    result.remarks.push_back(fmt::format(
        "Tree {} shows two rings, {:.1f} cm apart: the scans do not lie on each other, or bark and "
        "something around it were seen. Do not rely on its diameter.",
        i + 1, 100.0 * stems[i].rings_apart_m));
  }
}

}  // namespace

InventoryResult take_slice(const PointBlocks& unasked, const std::string& name,
                           const InventoryConfig& config, const ProgressSink& progress) {
  const PointBlocks cloud = polled(unasked, progress);
  InventoryResult result;
  const Extent extent = extent_of(cloud);
  result.points = extent.points;
  if (extent.points == 0) {
    result.remarks.emplace_back("The cloud holds no points.");
    return result;
  }
  CutSurface surface(extent);
  cloud([&](std::span<const Eigen::Vector3d> points) {
    for (const Eigen::Vector3d& point : points)
      surface.add(point);
  });
  const double thickness_m = surface.thickness();
  if (thickness_m > kThickest)
    throw InputError(
        name, "",
        fmt::format("expected one thin cut, up to {:.1f} m thick: the cloud is {:.1f} m "
                    "thick. Leave out --slice",
                    kThickest, thickness_m));
  result.ground.config = config.ground;
  result.ground.terrain = surface.as_ground();
  result.origin = {std::round(extent.low.x()), std::round(extent.low.y()),
                   result.ground.terrain.z0};
  SliceThinner thinner(std::min(kThin, config.stems.thin_m));
  cloud([&](std::span<const Eigen::Vector3d> points) {
    for (const Eigen::Vector3d& point : points)
      thinner.add(point.x() - result.origin.x(), point.y() - result.origin.y(), kBreastHeight);
  });
  result.slices = thinner.take();
  const std::vector<SliceStem> stems =
      measure_slice(result.slices, search_of(config.stems, InventoryExtent::kBasic), progress);
  for (const SliceStem& slice : stems) {
    result.stems.push_back(slice.stem);
    result.trees.push_back(tree_of(result, slice.stem, static_cast<int>(result.stems.size())));
    Tree& tree = result.trees.back();
    tree.quality = slice.rings_apart_m > 0.0 ? "two_rings" : quality_of(tree, slice.stem.arc_deg);
  }
  result.area_m2 = area_of(result.slices);
  result.sheets = SheetCollector(result.stems, result.slices, most_doubtful(result.stems)).take();
  remark(stems, thickness_m, result);
  return result;
}

}  // namespace understory
