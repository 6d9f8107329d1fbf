#include "understory/preprocess/voxel_filter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "understory/geometry/voxel_key.h"
#include "understory/util/error.h"
#include "understory/util/random.h"

namespace understory {
namespace {

constexpr std::size_t kKeysAhead = 64;

// Keys of up to kKeysAhead points. Loops of their own, so that the compiler makes vectors of them.
void find_keys(const Eigen::Vector3f* points, std::size_t count, float scale,
               std::array<std::uint64_t, kKeysAhead>& keys) {
  std::array<std::array<int, kKeysAhead>, 3> cells;
  const float* coordinates = points->data();
  for (std::size_t i = 0; i < count; ++i) {
    cells[0][i] = voxel_floor(coordinates[3 * i] * scale);
    cells[1][i] = voxel_floor(coordinates[3 * i + 1] * scale);
    cells[2][i] = voxel_floor(coordinates[3 * i + 2] * scale);
  }
  for (std::size_t i = 0; i < count; ++i)
    keys[i] = voxel_key(cells[0][i], cells[1][i], cells[2][i]);
}

constexpr auto take_all = [](std::uint32_t) { return true; };
constexpr auto take_no_note = [](const auto&, std::uint32_t) {};

// Without its feature.
void append_point(const BodyCloud& from, std::size_t i, BodyCloud& to) {
  to.points.push_back(from.points[i]);
  to.intensity.push_back(from.intensity[i]);
  to.range.push_back(from.range[i]);
  to.ring.push_back(from.ring[i]);
  to.t_ns.push_back(from.t_ns[i]);
}

}  // namespace

void describe(ConfigTable& table, VoxelFilterConfig& config) {
  table.add("voxel_size_m", config.voxel_size_m, {0.01, 10.0}, "m",
            "edge of the voxels; each gives one point");
  table.add("range_min_m", config.range_min_m, {0.0, 100.0}, "m",
            "points nearer to the lidar are left out");
  table.add("range_max_m", config.range_max_m, {1.0, 1000.0}, "m",
            "points farther from the lidar are left out");
  table.add_enum("point", config.point,
                 {{"mean", VoxelPoint::kMean},
                  {"nearest_to_mean", VoxelPoint::kNearestToMean},
                  {"first", VoxelPoint::kFirst}},
                 "which point stands for a voxel");
  table.add("min_points", config.min_points, {1, 100}, "", "voxels with fewer points are left out");
}

void VoxelFilter::start(std::size_t points) {
  voxels_.clear();
  keys_.clear();
  voxel_of_point_.assign(points, kNone);
  if (slots_.empty()) {
    slots_.assign(std::size_t{1} << 15, Slot{0, 0, 0});
    mask_ = slots_.size() - 1;
    epoch_ = 0;
  }
  // A slot is free unless it carries the current epoch: no clearing between calls.
  if (++epoch_ == 0) {
    std::fill(slots_.begin(), slots_.end(), Slot{0, 0, 0});
    epoch_ = 1;
  }
}

void VoxelFilter::grow() {
  slots_.assign(slots_.size() * 2, Slot{0, 0, 0});
  mask_ = slots_.size() - 1;
  epoch_ = 1;
  for (std::uint32_t v = 0; v < keys_.size(); ++v) {
    std::uint64_t at = voxel_hash(keys_[v]) & mask_;
    while (slots_[at].epoch == epoch_)
      at = (at + 1) & mask_;
    slots_[at] = {keys_[v], epoch_, v};
  }
}

inline std::uint32_t VoxelFilter::find_or_add(std::uint64_t key, std::uint64_t hash,
                                              std::uint32_t index, const Eigen::Vector3f& point) {
  std::uint64_t at = hash & mask_;
  while (slots_[at].epoch == epoch_) {
    if (slots_[at].key == key) return slots_[at].voxel;
    at = (at + 1) & mask_;
  }
  const auto voxel = static_cast<std::uint32_t>(voxels_.size());
  slots_[at] = {key, epoch_, voxel};
  voxels_.push_back(
      {{point.x(), point.y(), point.z()}, {0.0F, 0.0F, 0.0F}, 0.0F, 0.0F, 0.0F, 0, index, index});
  keys_.push_back(key);
  if (voxels_.size() * 2 > slots_.size()) grow();
  return voxel;
}

// `note(voxel, index)` is told of each point that fell into a voxel.
template <typename InRange, typename Note>
void VoxelFilter::sort_into_voxels(const Points& points, double voxel_size_m,
                                   const InRange& in_range, const Note& note) {
  UNDERSTORY_CHECK(voxel_size_m > 0.0);
  start(points.size());
  const auto scale = static_cast<float>(1.0 / voxel_size_m);
  // Keys a block ahead, so that the memory of the slots is asked for before it is needed.
  std::array<std::uint64_t, kKeysAhead> keys;
  std::array<std::uint64_t, kKeysAhead> hashes;
  for (std::size_t begin = 0; begin < points.size(); begin += kKeysAhead) {
    const std::size_t end = std::min(points.size(), begin + kKeysAhead);
    find_keys(points.data() + begin, end - begin, scale, keys);
    for (std::size_t i = begin; i < end; ++i) {
      hashes[i - begin] = voxel_hash(keys[i - begin]);
      __builtin_prefetch(slots_.data() + (hashes[i - begin] & mask_));
    }
    // Found first and added to then: the memory of the voxels is asked for in between.
    for (std::size_t i = begin; i < end; ++i) {
      const auto index = static_cast<std::uint32_t>(i);
      if (!in_range(index)) continue;
      voxel_of_point_[i] = find_or_add(keys[i - begin], hashes[i - begin], index, points[i]);
      __builtin_prefetch(voxels_.data() + voxel_of_point_[i]);
    }
    for (std::size_t i = begin; i < end; ++i) {
      if (voxel_of_point_[i] == kNone) continue;
      Voxel& voxel = voxels_[voxel_of_point_[i]];
      voxel.sum[0] += points[i].x() - voxel.origin[0];
      voxel.sum[1] += points[i].y() - voxel.origin[1];
      voxel.sum[2] += points[i].z() - voxel.origin[2];
      ++voxel.count;
      note(voxel, static_cast<std::uint32_t>(i));
    }
  }
}

void VoxelFilter::choose_nearest_to_mean(const Points& points) {
  for (Voxel& voxel : voxels_)
    voxel.best = std::numeric_limits<float>::infinity();
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    if (voxel_of_point_[i] == kNone) continue;
    Voxel& voxel = voxels_[voxel_of_point_[i]];
    const Eigen::Vector3f mean =
        points[voxel.first] +
        Eigen::Map<const Eigen::Vector3f>(voxel.sum) / static_cast<float>(voxel.count);
    const float distance = (points[i] - mean).squaredNorm();
    if (distance < voxel.best) {
      voxel.best = distance;
      voxel.chosen = i;
    }
  }
}

BodyCloud VoxelFilter::filter(const BodyCloud& cloud, const VoxelFilterConfig& config,
                              bool carried_too) {
  const auto low = static_cast<float>(config.range_min_m);
  const auto high = static_cast<float>(config.range_max_m);
  const bool mean = config.point == VoxelPoint::kMean;
  sort_into_voxels(
      cloud.points, config.voxel_size_m,
      [&](std::uint32_t i) {
        return cloud.range[i] >= low && cloud.range[i] <= high &&
               (carried_too || !cloud.is_carried(i));
      },
      [&](Voxel& voxel, std::uint32_t i) {
        voxel.intensity += cloud.intensity[i];
        voxel.range += cloud.range[i];
      });
  if (config.point == VoxelPoint::kNearestToMean) choose_nearest_to_mean(cloud.points);
  BodyCloud thinned;
  thinned.stamp = cloud.stamp;
  thinned.resize(voxels_.size());
  std::size_t n = 0;
  for (const Voxel& voxel : voxels_) {
    if (voxel.count < static_cast<std::uint32_t>(config.min_points)) continue;
    const float share = 1.0F / static_cast<float>(voxel.count);
    const std::uint32_t from = voxel.chosen;
    thinned.points[n] = mean ? Eigen::Vector3f(cloud.points[from] +
                                               share * Eigen::Map<const Eigen::Vector3f>(voxel.sum))
                             : cloud.points[from];
    thinned.intensity[n] = mean ? share * voxel.intensity : cloud.intensity[from];
    thinned.range[n] = mean ? share * voxel.range : cloud.range[from];
    thinned.ring[n] = cloud.ring[from];
    thinned.t_ns[n] = cloud.t_ns[from];
    ++n;
  }
  thinned.resize(n);
  return thinned;
}

BodyCloud VoxelFilter::filter_features(const BodyCloud& cloud, const VoxelFilterConfig& config,
                                       bool for_map) {
  UNDERSTORY_CHECK(cloud.feature.size() == cloud.size());
  BodyCloud filtered;
  filtered.stamp = cloud.stamp;
  for (const PointFeature kind :
       {PointFeature::kEdge, PointFeature::kPlane, PointFeature::kGround, PointFeature::kNone}) {
    if (kind == PointFeature::kNone && !for_map) break;
    BodyCloud part;
    part.stamp = cloud.stamp;
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      if (cloud.feature[i] == kind && (for_map || !cloud.is_carried(i)))
        append_point(cloud, i, part);
    }
    const BodyCloud thinned = filter(part, config);
    for (std::size_t i = 0; i < thinned.size(); ++i)
      append_point(thinned, i, filtered);
    filtered.feature.resize(filtered.size(), kind);
  }
  return filtered;
}

Points VoxelFilter::filter(const Points& points, double voxel_size_m) {
  sort_into_voxels(points, voxel_size_m, take_all, take_no_note);
  Points thinned;
  thinned.reserve(voxels_.size());
  for (const Voxel& voxel : voxels_) {
    thinned.emplace_back(points[voxel.first] + Eigen::Map<const Eigen::Vector3f>(voxel.sum) /
                                                   static_cast<float>(voxel.count));
  }
  return thinned;
}

std::vector<std::uint32_t> VoxelFilter::keep(const Points& points, double voxel_size_m,
                                             VoxelPoint point) {
  sort_into_voxels(points, voxel_size_m, take_all, take_no_note);
  if (point != VoxelPoint::kFirst) choose_nearest_to_mean(points);
  std::vector<std::uint32_t> indices;
  indices.reserve(voxels_.size());
  for (const Voxel& voxel : voxels_)
    indices.push_back(voxel.chosen);
  return indices;
}

std::vector<std::uint32_t> decimate(std::size_t n, std::size_t limit, std::uint64_t seed) {
  std::vector<std::uint32_t> indices;
  if (n <= limit) {
    indices.resize(n);
    for (std::size_t i = 0; i < n; ++i)
      indices[i] = static_cast<std::uint32_t>(i);
    return indices;
  }
  indices.reserve(limit);
  Random random(seed);
  for (std::size_t i = 0; i < limit; ++i) {
    const std::size_t begin = i * n / limit;
    const std::size_t end = (i + 1) * n / limit;
    indices.push_back(static_cast<std::uint32_t>(begin + random.below(end - begin)));
  }
  return indices;
}

}  // namespace understory
