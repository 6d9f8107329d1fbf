#include "understory/evaluation/map_entropy.h"

#include <Eigen/Core>
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

constexpr std::size_t kBlock = 32;  // cubes whose sums are added in order
constexpr std::size_t kLanes = 8;   // sums that go on side by side

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

// The points around a cube, coordinate by coordinate, so that the compiler works through several at
// once. Relative to a point of the cube: single precision is fine enough.
struct Around {
  Vector3d origin = Vector3d::Zero();
  std::vector<float> x, y, z;

  void clear() {
    for (std::vector<float>* axis : {&x, &y, &z})
      axis->clear();
  }
  void add(const Vector3d& place) {
    x.push_back(static_cast<float>(place.x() - origin.x()));
    y.push_back(static_cast<float>(place.y() - origin.y()));
    z.push_back(static_cast<float>(place.z() - origin.z()));
  }
};

// Covariance of the points nearer to one than the radius; returns how many they are. `near`: room
// for these.
int covariance_around(const Vector3d& centre, const Around& around, double radius_m, Around& near,
                      Matrix3d& covariance) {
  const Eigen::Vector3f c = (centre - around.origin).cast<float>();
  const auto radius2 = static_cast<float>(radius_m * radius_m);
  for (std::vector<float>* axis : {&near.x, &near.y, &near.z})
    axis->resize(around.x.size() + kLanes);
  std::size_t count = 0;
  for (std::size_t i = 0; i < around.x.size(); ++i) {
    const float dx = around.x[i] - c.x();
    const float dy = around.y[i] - c.y();
    const float dz = around.z[i] - c.z();
    near.x[count] = dx;
    near.y[count] = dy;
    near.z[count] = dz;
    count += dx * dx + dy * dy + dz * dz < radius2 ? 1 : 0;
  }
  for (std::size_t i = count; i < count + kLanes; ++i)
    near.x[i] = near.y[i] = near.z[i] = 0.0F;
  // Lanes that are added up at the end: the same order wherever the memory lies.
  std::array<std::array<float, kLanes>, 9> sums{};
  for (std::size_t i = 0; i < count; i += kLanes) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const float x = near.x[i + lane];
      const float y = near.y[i + lane];
      const float z = near.z[i + lane];
      sums[0][lane] += x;
      sums[1][lane] += y;
      sums[2][lane] += z;
      sums[3][lane] += x * x;
      sums[4][lane] += x * y;
      sums[5][lane] += x * z;
      sums[6][lane] += y * y;
      sums[7][lane] += y * z;
      sums[8][lane] += z * z;
    }
  }
  std::array<double, 9> mean_of{};
  for (std::size_t k = 0; k < 9; ++k) {
    for (const float lane : sums[k])
      mean_of[k] += static_cast<double>(lane);
    mean_of[k] /= static_cast<double>(count);
  }
  const Vector3d mean(mean_of[0], mean_of[1], mean_of[2]);
  covariance << mean_of[3], mean_of[4], mean_of[5], mean_of[4], mean_of[6], mean_of[7], mean_of[5],
      mean_of[7], mean_of[8];
  covariance -= mean * mean.transpose();
  return static_cast<int>(count);
}

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

  [[nodiscard]] std::size_t size() const { return first_.size() - 1; }

  // Calls visit(centres, around) for each cube of a range: the points in it, and those of it and of
  // the 26 cubes around it.
  template <typename Visit>
  void visit(std::size_t first, std::size_t end, Around& around, const Visit& visit) const {
    for (std::size_t cube = first; cube < end; ++cube) {
      gather(cube, around);
      for (std::size_t k = first_[cube]; k < first_[cube + 1]; ++k) {
        if (of_neighbour_[k] == 0) visit(places_[k], around);
      }
    }
  }

 private:
  static Vector3d place_of(const MapPoint& point) { return {point.x, point.y, point.z}; }
  [[nodiscard]] std::uint64_t key_of(const Vector3d& place, const std::array<int, 3>& step) const {
    return voxel_key(voxel_floor(place.x() / side_m_) + step[0],
                     voxel_floor(place.y() / side_m_) + step[1],
                     voxel_floor(place.z() / side_m_) + step[2]);
  }

  void gather(std::size_t cube, Around& around) const {
    around.clear();
    around.origin = places_[first_[cube]];
    for (int step = 0; step < 27; ++step) {
      const std::uint32_t at =
          index_.find(key_of(around.origin, {step % 3 - 1, step / 3 % 3 - 1, step / 9 - 1}));
      if (at == VoxelIndex::kNone) continue;
      for (std::size_t i = first_[at]; i < first_[at + 1]; ++i)
        around.add(places_[i]);
    }
  }

  double side_m_;
  std::uint64_t last_key_ = 0;
  VoxelIndex index_;
  std::vector<std::size_t> first_;  // of each cube, and the end
  std::vector<Vector3d> places_;
  std::vector<char> of_neighbour_;
};

void add_entropy(const Vector3d& centre, const Around& around, const MapEntropyConfig& config,
                 Around& work, Sums& sums) {
  Matrix3d covariance;
  if (covariance_around(centre, around, config.radius_m, work, covariance) <
      config.fewest_neighbours)
    return;
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
    : config_(config), tiles_(folder, {config.tile_m, config.thin_m, config.radius_m}) {}

void MapEntropyMeter::add(const Vector3d& point) {
  tiles_.add({point.x(), point.y(), point.z()});
}

MapEntropy MapEntropyMeter::measure() {
  MapEntropy result;
  result.points = tiles_.points_added();
  Sums all;
  tiles_.for_each([&](MapTiles::TileIndex, const std::vector<MapPoint>& in_tile) {
    const Cubes cubes(in_tile, config_.radius_m);
    const std::size_t blocks = (cubes.size() + kBlock - 1) / kBlock;
    all += ordered_sum(blocks, 1, Sums(), [&](Sums& sums, std::size_t block) {
      Around around;
      Around near;
      cubes.visit(block * kBlock, std::min(cubes.size(), (block + 1) * kBlock), around,
                  [&](const Vector3d& centre, const Around& points) {
                    add_entropy(centre, points, config_, near, sums);
                  });
    });
  });
  result.points_used = all.used;
  const double none = std::numeric_limits<double>::quiet_NaN();
  const auto n = static_cast<double>(all.used);
  result.mean_entropy_nats = all.used > 0 ? all.entropy / n : none;
  result.mean_plane_variance_m2 = all.used > 0 ? all.thickness / n : none;
  return result;
}

}  // namespace understory
