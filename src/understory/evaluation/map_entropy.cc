#include "understory/evaluation/map_entropy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "understory/geometry/symmetric_eigen.h"
#include "understory/geometry/voxel_index.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr std::size_t kBlock = 256;  // points whose sums are added in order

struct Sums {
  std::uint64_t used = 0;
  double entropy = 0.0;
  double thickness = 0.0;

  Sums& operator+=(const Sums& other) {
    used += other.used;
    entropy += other.entropy;
    thickness += other.thickness;
    return *this;
  }
};

// The points of a tile, those of one cube of the radius after another.
class Cubes {
 public:
  Cubes(const std::vector<MapPoint>& points, double side_m) : side_m_(side_m) {
    std::vector<std::pair<std::uint64_t, std::uint32_t>> order;
    order.reserve(points.size());
    for (std::size_t k = 0; k < points.size(); ++k)
      order.emplace_back(key_of(place_of(points[k]), {0, 0, 0}), static_cast<std::uint32_t>(k));
    std::sort(order.begin(), order.end());
    for (const auto& [key, k] : order) {
      if (first_.empty() || key != last_key_) {
        index_.set(key, static_cast<std::uint32_t>(first_.size()));
        first_.push_back(places_.size());
        last_key_ = key;
      }
      places_.push_back(place_of(points[k]));
      of_neighbour_.push_back(points[k].of_neighbour ? 1 : 0);
    }
    first_.push_back(places_.size());
  }

  [[nodiscard]] std::size_t size() const { return places_.size(); }
  [[nodiscard]] bool counts(std::size_t k) const { return of_neighbour_[k] == 0; }

  // Covariance of the points around one, itself included; returns how many they are.
  int covariance_around(std::size_t k, double radius_m, Matrix3d& covariance) const {
    const Vector3d& centre = places_[k];
    Vector3d sum = Vector3d::Zero();
    Matrix3d squares = Matrix3d::Zero();
    int count = 0;
    for (int cube = 0; cube < 27; ++cube) {
      const std::uint32_t at =
          index_.find(key_of(centre, {cube % 3 - 1, cube / 3 % 3 - 1, cube / 9 - 1}));
      if (at == VoxelIndex::kNone) continue;
      for (std::size_t i = first_[at]; i < first_[at + 1]; ++i) {
        const Vector3d d = places_[i] - centre;
        if (d.squaredNorm() >= radius_m * radius_m) continue;
        ++count;
        sum += d;
        squares += d * d.transpose();
      }
    }
    const Vector3d mean = sum / count;
    covariance = squares / count - mean * mean.transpose();
    return count;
  }

 private:
  static Vector3d place_of(const MapPoint& point) { return {point.x, point.y, point.z}; }
  [[nodiscard]] std::uint64_t key_of(const Vector3d& place, const std::array<int, 3>& step) const {
    return voxel_key(voxel_floor(place.x() / side_m_) + step[0],
                     voxel_floor(place.y() / side_m_) + step[1],
                     voxel_floor(place.z() / side_m_) + step[2]);
  }

  double side_m_;
  std::uint64_t last_key_ = 0;
  VoxelIndex index_;
  std::vector<std::size_t> first_;  // of each cube, and the end
  std::vector<Vector3d> places_;
  std::vector<char> of_neighbour_;
};

void add_entropy(const Cubes& cubes, std::size_t k, const MapEntropyConfig& config, Sums& sums) {
  if (!cubes.counts(k)) return;
  Matrix3d covariance;
  if (cubes.covariance_around(k, config.radius_m, covariance) < config.fewest_neighbours) return;
  const Vector3d variances = fast_symmetric_eigen(covariance).values.cwiseMax(0.0);
  ++sums.used;
  sums.thickness += variances(0);
  for (int axis = 0; axis < 3; ++axis)
    sums.entropy += 0.5 * std::log(2.0 * std::numbers::pi * std::numbers::e *
                                   (variances(axis) + config.least_sd_m * config.least_sd_m));
}

}  // namespace

MapEntropyMeter::MapEntropyMeter(const std::filesystem::path& folder,
                                 const MapEntropyConfig& config)
    : config_(config), tiles_(folder, {config.tile_m, 0.0, config.radius_m}) {}

void MapEntropyMeter::add(const Vector3d& point) {
  tiles_.add({point.x(), point.y(), point.z()});
}

MapEntropy MapEntropyMeter::measure() {
  MapEntropy result;
  result.points = tiles_.points_added();
  Sums all;
  tiles_.for_each([&](MapTiles::TileIndex, const std::vector<MapPoint>& points) {
    const Cubes cubes(points, config_.radius_m);
    all += ordered_sum(cubes.size(), kBlock, Sums(),
                       [&](Sums& sums, std::size_t k) { add_entropy(cubes, k, config_, sums); });
  });
  result.points_used = all.used;
  const double none = std::numeric_limits<double>::quiet_NaN();
  const auto n = static_cast<double>(all.used);
  result.mean_entropy_nats = all.used > 0 ? all.entropy / n : none;
  result.mean_plane_variance_m2 = all.used > 0 ? all.thickness / n : none;
  return result;
}

}  // namespace understory
