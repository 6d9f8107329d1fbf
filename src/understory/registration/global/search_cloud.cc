#include "understory/registration/global/search_cloud.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "understory/geometry/rotation_between.h"
#include "understory/registration/global/global_constants.h"
#include "understory/registration/global/level_cloud.h"
#include "understory/registration/ndt/ndt_matcher.h"
#include "understory/util/median.h"

namespace understory {
namespace {

using namespace registration_constants::search_cloud;

// A thinned cloud that is fewer points, farther or flatter than any place that can be matched.
std::string trouble_with(const Points& points) {
  if (points.size() < kFewestPoints) {
    return "only " + std::to_string(points.size()) + " places of 0.2 m hold points, fewer than " +
           std::to_string(kFewestPoints);
  }
  std::vector<float> spans;
  const Eigen::Vector3f first = points.front();
  for (const Eigen::Vector3f& point : points)
    spans.push_back((point - first).norm());
  if (upper_median(std::move(spans)) > kWidest)
    return "half of its points lie kilometres apart: are the coordinates in millimetres?";
  return "";
}

Eigen::Vector3f middle_of(const Points& points) {
  std::vector<float> axis(points.size());
  Eigen::Vector3f middle;
  for (Eigen::Index k = 0; k < 3; ++k) {
    for (std::size_t i = 0; i < points.size(); ++i)
      axis[i] = points[i][k];
    middle[k] = upper_median(axis);
  }
  return middle;
}

// Every so-manieth point that `wanted` takes, at most `most`.
template <typename Wanted>
Points some_of(const SearchCloud& cloud, std::size_t most, const Wanted& wanted) {
  Points all;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    if (wanted(cloud.above_m[i])) all.push_back(cloud.points[i]);
  }
  if (all.size() <= most) return all;
  Points some;
  some.reserve(most);
  for (std::size_t i = 0; i < most; ++i)
    some.push_back(all[i * all.size() / most]);
  return some;
}

MatchTargetPtr ndt_target(const SearchCloud& cloud, const std::vector<double>& cell_sizes_m,
                          bool few_rings) {
  NdtMatcherConfig ndt;
  if (few_rings) {
    ndt.cells.min_points = kSparseCell;
    ndt.cells.volume_weight = 1.0;
    ndt.cells.few_rings = cloud.view != nullptr;
  }
  ndt.cell_sizes_m = cell_sizes_m;
  ndt.cells.sigma_floor_m = kThinnest;
  Viewpoint viewpoint;
  if (cloud.view) viewpoint.lidar_in_source = Eigen::Vector3d::Zero();
  const auto builder = make_matcher(ndt)->make_builder(viewpoint);
  builder->insert(cloud.points, Pose(), std::nullopt);
  return builder->snapshot();
}

std::uint64_t key_of(const Eigen::Vector3f& at) {
  constexpr auto kPerM = static_cast<float>(1.0 / kVoxel);
  return voxel_key(voxel_floor(at.x() * kPerM), voxel_floor(at.y() * kPerM),
                   voxel_floor(at.z() * kPerM));
}

}  // namespace

NearGrid::NearGrid(const Points& points) {
  if (points.empty()) return;
  Eigen::Vector3f high = points.front();
  low_ = high;
  for (const Eigen::Vector3f& point : points) {
    low_ = low_.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  const Eigen::Vector3f middle = middle_of(points);
  const Eigen::Vector3f reach(kHalfWidth, kHalfWidth, kHalfHeight);
  const Eigen::Vector3f rim = Eigen::Vector3f::Constant(2.0F * kNearEdge);
  low_ = low_.cwiseMax(middle - reach) - rim;
  high = high.cwiseMin(middle + reach) + rim;
  size_ = ((high - low_) / kNearEdge).cast<int>() + Eigen::Vector3i::Ones();
  const auto cells = static_cast<std::size_t>(size_.x()) * static_cast<std::size_t>(size_.y()) *
                     static_cast<std::size_t>(size_.z());
  bits_.resize(cells / 64 + 1);
  for (const Eigen::Vector3f& point : points) {
    for (int dz = -1; dz <= 1; ++dz) {
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const Eigen::Vector3f beside =
              point + kNearEdge * Eigen::Vector3i(dx, dy, dz).cast<float>();
          if (const auto bit = bit_of(beside)) bits_[*bit / 64] |= std::uint64_t{1} << (*bit % 64);
        }
      }
    }
  }
}

std::optional<std::size_t> NearGrid::bit_of(const Eigen::Vector3f& point) const {
  const Eigen::Vector3f at = (point - low_) / kNearEdge;
  if (!(at.minCoeff() >= 0.0F)) return std::nullopt;
  if (at.x() >= static_cast<float>(size_.x()) || at.y() >= static_cast<float>(size_.y()) ||
      at.z() >= static_cast<float>(size_.z()))
    return std::nullopt;
  const Eigen::Vector3i cell = at.cast<int>();
  return (static_cast<std::size_t>(cell.z()) * static_cast<std::size_t>(size_.y()) +
          static_cast<std::size_t>(cell.y())) *
             static_cast<std::size_t>(size_.x()) +
         static_cast<std::size_t>(cell.x());
}

bool NearGrid::near(const Eigen::Vector3f& point) const {
  const auto bit = bit_of(point);
  return bit && (bits_[*bit / 64] >> (*bit % 64) & 1U) != 0;
}

bool holds_points(const SearchCloud& cloud, const Eigen::Vector3f& at) {
  return cloud.voxels.find(key_of(at)) != VoxelIndex::kNone;
}

SearchCloud prepare_search(const Points& points) {
  SearchCloud cloud;
  cloud.points = voxel_means(points, kVoxel);
  cloud.trouble = trouble_with(cloud.points);
  if (!cloud.trouble.empty()) return cloud;
  const bool one_view = RangeView(points, Eigen::Vector3f::Zero()).is_one_view();
  const Eigen::Vector3d origin =
      one_view ? Eigen::Vector3d::Zero() : Eigen::Vector3d(middle_of(cloud.points).cast<double>());
  const UpEstimate up = estimate_up(cloud.points);
  cloud.up_weight = up.weight;
  const Eigen::Quaterniond turn = rotation_between(up.up, Eigen::Vector3d::UnitZ());
  cloud.level_from_cloud = Pose(turn, -(turn * origin));
  const Eigen::Matrix3f rotation = turn.toRotationMatrix().cast<float>();
  const Eigen::Vector3f middle = origin.cast<float>();
  double ranges = 0.0;
  for (Eigen::Vector3f& point : cloud.points) {
    point = rotation * (point - middle);
    ranges += static_cast<double>(point.norm());
  }
  cloud.range_m = ranges / static_cast<double>(cloud.points.size());
  const GroundGrid ground(cloud.points);
  cloud.above_m.reserve(cloud.points.size());
  for (const Eigen::Vector3f& point : cloud.points)
    cloud.above_m.push_back(point.z() - ground.at(point.x(), point.y()));
  cloud.plants = some_of(cloud, kPlants, [](float above) { return above > kAbove; });
  cloud.ground = some_of(cloud, kGround, [](float above) { return above < kOnGround; });
  cloud.uprights = find_uprights(cloud.points, cloud.above_m, kUprights);
  cloud.few_rings = points.size() < kFewRings;
  cloud.axes = upright_axes(cloud.uprights, cloud.points, cloud.above_m);
  cloud.ground_means = ground_means(cloud.points, cloud.above_m);
  for (const Eigen::Vector3f& point : cloud.points)
    cloud.voxels.set(key_of(point), 0);
  cloud.near = std::make_shared<const NearGrid>(cloud.points);
  if (one_view) {
    cloud.view = std::make_shared<const RangeView>(cloud.points, Eigen::Vector3f::Zero());
    for (Upright& upright : cloud.uprights)
      upright.at *= 1.0 + kBehind / std::max(upright.at.norm(), 1.0);
  }
  cloud.target = ndt_target(cloud, {kCoarseCell, kMiddleCell}, cloud.few_rings);
  // Small cells of a sparse scan hold too little for a distribution, and leave directions open.
  cloud.fine_target =
      cloud.few_rings ? cloud.target : ndt_target(cloud, {kMiddleCell, kFineCell}, false);
  return cloud;
}

}  // namespace understory
