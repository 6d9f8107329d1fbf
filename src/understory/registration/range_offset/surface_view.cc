#include "understory/registration/range_offset/surface_view.h"

#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "understory/geometry/symmetric_eigen.h"

namespace understory {

void describe(ConfigTable& table, SurfaceViewConfig& config) {
  table.add("cell_m", config.cell_m, {0.1, 10.0}, "m", "edge of the cells of flat patches");
  table.add("range_max_m", config.range_max_m, {1.0, 1000.0}, "m", "farther points are not used");
  table.add("min_points", config.min_points, {4, 100000}, "", "fewest points of a patch");
  table.add("max_thickness_m", config.max_thickness_m, {0.001, 10.0}, "m",
            "largest standard deviation of a patch along its normal");
  table.add("min_width", config.min_width, {0.0, 0.3}, "",
            "least width of a patch (middle standard deviation over the cell's edge); a narrower "
            "one is the trace of one ring");
}

namespace {

// Sums of the points of a cell, from the corner of the cell where its coordinates are smallest.
struct Sums {
  std::array<int, 3> at{};
  int count = 0;
  Eigen::Vector3f point = Eigen::Vector3f::Zero();
  Eigen::Vector3f ray = Eigen::Vector3f::Zero();
  Eigen::Matrix3f products = Eigen::Matrix3f::Zero();
};

std::array<int, 3> cell_of(const Eigen::Vector3f& point, float cells_per_m) {
  return {voxel_floor(point.x() * cells_per_m), voxel_floor(point.y() * cells_per_m),
          voxel_floor(point.z() * cells_per_m)};
}

class Cells {
 public:
  explicit Cells(const SurfaceViewConfig& config)
      : cell_m_(static_cast<float>(config.cell_m)),
        squared_range_(static_cast<float>(config.range_max_m * config.range_max_m)) {}

  void add(const ViewCloud& cloud, const Eigen::Vector3f& lidar_in_body) {
    const Eigen::Matrix3f rotation = cloud.view_from_body.rotation_matrix().cast<float>();
    const Eigen::Vector3f shift = cloud.view_from_body.translation().cast<float>();
    for (const Eigen::Vector3f& point : *cloud.points_in_body) {
      const Eigen::Vector3f beam = point - lidar_in_body;
      const float squared = beam.squaredNorm();
      if (!(squared > 0.0F && squared < squared_range_)) continue;
      add(rotation * point + shift, rotation * beam / std::sqrt(squared));
    }
  }

  [[nodiscard]] const std::vector<Sums>& all() const { return cells_; }

 private:
  void add(const Eigen::Vector3f& point, const Eigen::Vector3f& ray) {
    const std::array<int, 3> at = cell_of(point, 1.0F / cell_m_);
    const std::uint64_t key = voxel_key(at[0], at[1], at[2]);
    std::uint32_t found = index_.find(key);
    if (found == VoxelIndex::kNone) {
      found = static_cast<std::uint32_t>(cells_.size());
      index_.set(key, found);
      cells_.emplace_back().at = at;
    }
    Sums& sums = cells_[found];
    const Eigen::Vector3f in_cell =
        point - cell_m_ * Eigen::Vector3f(static_cast<float>(at[0]), static_cast<float>(at[1]),
                                          static_cast<float>(at[2]));
    ++sums.count;
    sums.point += in_cell;
    sums.ray += ray;
    sums.products += in_cell * in_cell.transpose();
  }

  float cell_m_;
  float squared_range_;
  std::vector<Sums> cells_;
  VoxelIndex index_;
};

// The patch of a cell; nothing if its points are few, or lie on no plane.
std::optional<FlatPatch> patch_of(const Sums& sums, const SurfaceViewConfig& config) {
  if (sums.count < config.min_points) return std::nullopt;
  const double share = 1.0 / sums.count;
  const Eigen::Vector3d mean = share * sums.point.cast<double>();
  const Eigen::Matrix3d covariance = share * sums.products.cast<double>() - mean * mean.transpose();
  const SymmetricEigen3 eigen = fast_symmetric_eigen(covariance);
  const double width = config.min_width * config.cell_m;
  if (eigen.values[0] > config.max_thickness_m * config.max_thickness_m ||
      eigen.values[1] < width * width) {
    return std::nullopt;
  }
  FlatPatch patch;
  patch.mean = mean + config.cell_m * Eigen::Vector3d(sums.at[0], sums.at[1], sums.at[2]);
  patch.normal = eigen.vectors.col(0);
  patch.ray = share * sums.ray.cast<double>();
  if (patch.normal.dot(patch.ray) > 0.0) patch.normal = -patch.normal;
  return patch;
}

}  // namespace

SurfaceView::SurfaceView(std::span<const ViewCloud> clouds, const Eigen::Vector3d& lidar_in_body,
                         const SurfaceViewConfig& config)
    : cell_m_(config.cell_m) {
  Cells cells(config);
  for (const ViewCloud& cloud : clouds)
    cells.add(cloud, lidar_in_body.cast<float>());
  for (const Sums& sums : cells.all()) {
    const std::optional<FlatPatch> patch = patch_of(sums, config);
    if (!patch) continue;
    index_.set(voxel_key(sums.at[0], sums.at[1], sums.at[2]),
               static_cast<std::uint32_t>(patches_.size()));
    patches_.push_back(*patch);
  }
}

const FlatPatch* SurfaceView::nearest(const Eigen::Vector3d& point_in_view) const {
  const std::array<int, 3> at = {voxel_floor(point_in_view.x() / cell_m_),
                                 voxel_floor(point_in_view.y() / cell_m_),
                                 voxel_floor(point_in_view.z() / cell_m_)};
  const FlatPatch* best = nullptr;
  double best_m2 = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 27; ++i) {
    const std::uint32_t found =
        index_.find(voxel_key(at[0] + i % 3 - 1, at[1] + i / 3 % 3 - 1, at[2] + i / 9 - 1));
    if (found == VoxelIndex::kNone) continue;
    const double squared = (patches_[found].mean - point_in_view).squaredNorm();
    if (squared >= best_m2) continue;
    best = &patches_[found];
    best_m2 = squared;
  }
  return best;
}

}  // namespace understory
