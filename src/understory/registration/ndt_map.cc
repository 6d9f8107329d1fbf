#include "understory/registration/ndt_map.h"

#include <algorithm>
#include <atomic>

#include "understory/registration/ndt_cell.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"

namespace understory {

using internal::CellMoments;

void describe(ConfigTable& table, NdtMapConfig& config) {
  table.add("cell_size_m", config.cell_size_m, {0.05, 20.0}, "m",
            "edge of the cells of the normal distributions");
  table.add("min_points", config.min_points, {3, 1000}, "",
            "cells with fewer points are not matched");
  table.add("sigma_floor_m", config.sigma_floor_m, {0.001, 1.0}, "m",
            "no surface is taken to be thinner; noise of the lidar and of the map's poses");
  table.add("second_axis_weight", config.second_axis_weight, {0.0, 1.0}, "",
            "weight of a cell's second thinnest direction");
  table.add("volume_weight", config.volume_weight, {0.0, 1.0}, "",
            "weight of cells that are neither surface nor line");
}

Eigen::Vector3d NdtMap::mean(std::size_t index) const {
  const std::array<int, 3>& at = coordinates_[index];
  return cell_size_ * (Eigen::Vector3d(at[0], at[1], at[2]) + Eigen::Vector3d::Constant(0.5)) +
         cells_[index].mean.cast<double>();
}

void NdtMap::place(std::uint32_t index) {
  const std::array<int, 3>& at = coordinates_[index];
  const std::uint64_t key = voxel_key(at[0], at[1], at[2]);
  std::uint64_t i = voxel_hash(key) & mask_;
  while (slots_[i].cell_plus_1 != 0)
    i = (i + 1) & mask_;
  slots_[i] = {key, index + 1};
}

void NdtMap::rehash(std::size_t slots) {
  slots_.assign(slots, Slot{});
  mask_ = slots - 1;
  for (std::uint32_t c = 0; c < cells_.size(); ++c)
    place(c);
}

void NdtMap::add(const std::array<int, 3>& at, const NdtCell& cell) {
  cells_.push_back(cell);
  coordinates_.push_back(at);
  if (2 * cells_.size() > slots_.size()) {
    rehash(std::max<std::size_t>(16, 2 * slots_.size()));
  } else {
    place(static_cast<std::uint32_t>(cells_.size() - 1));
  }
}

struct NdtMapBuilder::State {
  struct Slot {
    std::uint64_t key = 0;
    std::uint32_t cell_plus_1 = 0;
  };
  struct Located {
    std::array<int, 3> at;
    float from_center[3];
    Eigen::Vector3f ray;  // direction from the lidar, map axes
  };

  NdtMapConfig config;
  std::vector<CellMoments> moments;
  std::vector<std::array<int, 3>> coordinates;
  std::vector<std::uint8_t> dirty;
  std::vector<std::uint8_t> leans;    // its distribution rests on its neighbours too
  std::vector<std::uint32_t> in_map;  // index in `map`, plus one; 0: too few points so far
  std::shared_ptr<NdtMap> map;        // as of the last snapshot
  std::vector<Slot> slots;
  std::uint64_t mask = 0;
  std::vector<Located> located;  // workspace

  [[nodiscard]] std::uint32_t find(const std::array<int, 3>& at) const {
    const std::uint64_t key = voxel_key(at[0], at[1], at[2]);
    for (std::uint64_t i = voxel_hash(key) & mask;; i = (i + 1) & mask) {
      if (slots[i].cell_plus_1 == 0 || slots[i].key == key) return slots[i].cell_plus_1;
    }
  }

  void place(std::uint64_t key, std::uint32_t cell_plus_1) {
    std::uint64_t i = voxel_hash(key) & mask;
    while (slots[i].cell_plus_1 != 0)
      i = (i + 1) & mask;
    slots[i] = {key, cell_plus_1};
  }

  void rehash(std::size_t size) {
    slots.assign(size, Slot{});
    mask = size - 1;
    for (std::uint32_t c = 0; c < coordinates.size(); ++c) {
      const std::array<int, 3>& at = coordinates[c];
      place(voxel_key(at[0], at[1], at[2]), c + 1);
    }
  }

  std::uint32_t find_or_add(const std::array<int, 3>& at) {
    const std::uint64_t key = voxel_key(at[0], at[1], at[2]);
    std::uint64_t i = voxel_hash(key) & mask;
    while (slots[i].cell_plus_1 != 0) {
      if (slots[i].key == key) return slots[i].cell_plus_1 - 1;
      i = (i + 1) & mask;
    }
    const auto cell = static_cast<std::uint32_t>(moments.size());
    slots[i] = {key, cell + 1};
    moments.emplace_back();
    coordinates.push_back(at);
    dirty.push_back(1);
    leans.push_back(0);
    in_map.push_back(0);
    if (moments.size() * 2 > slots.size()) rehash(slots.size() * 2);
    return cell;
  }

  // The map, to be written on: a new one if somebody else holds the last.
  NdtMap& own_map() {
    if (map.use_count() > 1) {
      map = std::make_shared<NdtMap>(*map);
    } else {
      // What its other holders read is over.
      std::atomic_thread_fence(std::memory_order_acquire);
    }
    return *map;
  }

  void start_map() {
    map = std::make_shared<NdtMap>();
    map->cell_size_ = config.cell_size_m;
    map->rehash(16);
  }

  [[nodiscard]] CellMoments around(std::size_t cell, int reach) const {
    CellMoments total;
    const std::array<int, 3>& at = coordinates[cell];
    for (int x = -reach; x <= reach; ++x) {
      for (int y = -reach; y <= reach; ++y) {
        for (int z = -reach; z <= reach; ++z) {
          const std::uint32_t found = find({at[0] + x, at[1] + y, at[2] + z});
          if (found != 0)
            total.add(moments[found - 1], config.cell_size_m * Eigen::Vector3d(x, y, z));
        }
      }
    }
    return total;
  }
};

NdtMapBuilder::NdtMapBuilder(const NdtMapConfig& config) : state_(std::make_unique<State>()) {
  UNDERSTORY_CHECK(config.cell_size_m > 0.0);
  state_->config = config;
  clear();
}
NdtMapBuilder::~NdtMapBuilder() = default;
NdtMapBuilder::NdtMapBuilder(NdtMapBuilder&&) noexcept = default;
NdtMapBuilder& NdtMapBuilder::operator=(NdtMapBuilder&&) noexcept = default;

void NdtMapBuilder::clear() {
  state_->moments.clear();
  state_->coordinates.clear();
  state_->dirty.clear();
  state_->leans.clear();
  state_->in_map.clear();
  state_->rehash(std::size_t{1} << 12);
  state_->start_map();
}

void NdtMapBuilder::insert(const Points& points_in_source, const Pose& map_from_source) {
  State& s = *state_;
  const double size = s.config.cell_size_m;
  // In cell units from a whole cell near the source, so that single precision is enough.
  const Eigen::Vector3d origin = (map_from_source.translation() / size).array().floor();
  const std::array<int, 3> base = {static_cast<int>(origin.x()), static_cast<int>(origin.y()),
                                   static_cast<int>(origin.z())};
  const Eigen::Matrix3f r = (map_from_source.rotation_matrix() / size).cast<float>();
  const Eigen::Vector3f t = (map_from_source.translation() / size - origin).cast<float>();
  const auto edge = static_cast<float>(size);
  s.located.resize(points_in_source.size());
  const bool rays = s.config.viewpoint_in_source.has_value();
  const Eigen::Vector3f viewpoint =
      rays ? Eigen::Vector3f(s.config.viewpoint_in_source->cast<float>()) : Eigen::Vector3f::Zero();
  parallel_for(points_in_source.size(), 4096, [&](std::size_t i) {
    const Eigen::Vector3f p = r * points_in_source[i] + t;
    State::Located& to = s.located[i];
    if (rays) to.ray = (r * (points_in_source[i] - viewpoint)).normalized();
    for (int k = 0; k < 3; ++k) {
      const int whole = voxel_floor(p[k]);
      to.at[static_cast<std::size_t>(k)] = base[static_cast<std::size_t>(k)] + whole;
      to.from_center[k] = (p[k] - static_cast<float>(whole) - 0.5F) * edge;
    }
  });
  for (const State::Located& point : s.located) {
    const std::uint32_t cell = s.find_or_add(point.at);
    s.moments[cell].add(point.from_center[0], point.from_center[1], point.from_center[2]);
    if (rays) s.moments[cell].add_ray(point.ray.x(), point.ray.y(), point.ray.z());
    s.dirty[cell] = 1;
  }
}

void NdtMapBuilder::remove_beyond(const Eigen::Vector3d& center, double radius_m) {
  State& s = *state_;
  const double size = s.config.cell_size_m;
  const std::shared_ptr<const NdtMap> before = s.map;
  std::size_t kept = 0;
  const std::size_t all = s.moments.size();
  const auto is_near = [&](std::size_t c) {
    const std::array<int, 3>& at = s.coordinates[c];
    const Eigen::Vector3d middle =
        size * (Eigen::Vector3d(at[0], at[1], at[2]) + Eigen::Vector3d::Constant(0.5));
    return (middle - center).squaredNorm() <= radius_m * radius_m;
  };
  while (kept < all && is_near(kept))
    ++kept;
  if (kept == all) return;
  kept = 0;
  s.start_map();
  for (std::size_t c = 0; c < all; ++c) {
    if (!is_near(c)) continue;
    const std::size_t to = kept++;
    s.moments[to] = s.moments[c];
    s.coordinates[to] = s.coordinates[c];
    s.dirty[to] = s.dirty[c];
    s.leans[to] = s.leans[c];
    s.in_map[to] = 0;
    if (s.in_map[c] == 0) continue;
    s.map->add(s.coordinates[to], before->cells()[s.in_map[c] - 1]);
    s.in_map[to] = static_cast<std::uint32_t>(s.map->size());
  }
  s.moments.resize(kept);
  s.coordinates.resize(kept);
  s.dirty.resize(kept);
  s.leans.resize(kept);
  s.in_map.resize(kept);
  std::size_t table = std::size_t{1} << 12;
  while (table < 2 * kept)
    table *= 2;
  s.rehash(table);
}

NdtMapPtr NdtMapBuilder::snapshot() {
  State& s = *state_;
  NdtMap& map = s.own_map();
  std::vector<std::uint32_t> changed;
  for (std::uint32_t c = 0; c < s.moments.size(); ++c) {
    if ((s.dirty[c] | s.leans[c]) == 0) continue;
    s.dirty[c] = 0;
    if (s.moments[c].n < s.config.min_points) continue;
    changed.push_back(c);
    if (s.in_map[c] != 0) continue;
    map.add(s.coordinates[c], {});
    s.in_map[c] = static_cast<std::uint32_t>(map.size());
  }
  parallel_for(changed.size(), 256, [&](std::size_t i) {
    const std::uint32_t c = changed[i];
    s.leans[c] = 0;
    map.cells_[s.in_map[c] - 1] = internal::make_cell(s.moments[c], s.config, [&](int reach) {
      s.leans[c] = 1;
      return s.around(c, reach);
    });
  });
  return s.map;
}

NdtMapPtr build_ndt_map(std::span<const PlacedCloud> clouds, const NdtMapConfig& config) {
  NdtMapBuilder builder(config);
  for (const PlacedCloud& cloud : clouds)
    builder.insert(*cloud.points_in_source, cloud.map_from_source);
  return builder.snapshot();
}

}  // namespace understory
