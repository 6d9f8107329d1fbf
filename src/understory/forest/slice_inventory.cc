#include "understory/forest/slice_inventory.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_set>

#include "understory/forest/forest_constants.h"
#include "understory/forest/stems/slice_stems.h"
#include "understory/forest/stems/slice_thinner.h"
#include "understory/forest/stems/stem_axis.h"

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

// A level plane for the drawings.
Raster plane_below(const Extent& extent) {
  Raster plane;
  plane.cell_m = std::max(1.0, (extent.high - extent.low).head<2>().maxCoeff() / kMostCells);
  plane.x0 = std::floor(extent.low.x()) - plane.cell_m;
  plane.y0 = std::floor(extent.low.y()) - plane.cell_m;
  plane.z0 = 0.5 * (extent.low.z() + extent.high.z()) - kBreastHeight;
  plane.columns = static_cast<int>((extent.high.x() - plane.x0) / plane.cell_m) + 2;
  plane.rows = static_cast<int>((extent.high.y() - plane.y0) / plane.cell_m) + 2;
  plane.values.assign(
      static_cast<std::size_t>(plane.columns) * static_cast<std::size_t>(plane.rows), 0.0F);
  return plane;
}

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
  tree.z = result.ground.terrain.z0 + kBreastHeight;
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

InventoryResult take_slice(const PointBlocks& unasked, const InventoryConfig& config,
                           const ProgressSink& progress) {
  const PointBlocks cloud = polled(unasked, progress);
  InventoryResult result;
  const Extent extent = extent_of(cloud);
  result.points = extent.points;
  if (extent.points == 0) {
    result.remarks.emplace_back("The cloud holds no points.");
    return result;
  }
  result.ground.config = config.ground;
  result.ground.terrain = plane_below(extent);
  result.origin = {std::round(extent.low.x()), std::round(extent.low.y()),
                   result.ground.terrain.z0};
  SliceThinner thinner(std::min(kThin, config.stems.thin_m));
  cloud([&](std::span<const Eigen::Vector3d> points) {
    for (const Eigen::Vector3d& point : points)
      thinner.add(point.x() - result.origin.x(), point.y() - result.origin.y(), kBreastHeight);
  });
  result.slices = thinner.take();
  const std::vector<SliceStem> stems = measure_slice(result.slices, config.stems, progress);
  for (const SliceStem& slice : stems) {
    result.stems.push_back(slice.stem);
    result.trees.push_back(tree_of(result, slice.stem, static_cast<int>(result.stems.size())));
  }
  result.area_m2 = area_of(result.slices);
  remark(stems, extent.high.z() - extent.low.z(), result);
  return result;
}

}  // namespace understory
