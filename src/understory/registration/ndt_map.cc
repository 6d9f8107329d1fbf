#include "understory/registration/ndt_map.h"

#include <algorithm>

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
  std::vector<std::uint8_t> leans;  // its distribution rests on its neighbours too
  std::vector<NdtCell> cells;       // as of the last snapshot
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
    if (moments.size() * 2 > slots.size()) rehash(slots.size() * 2);
    return cell;
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
  state_->cells.clear();
  state_->rehash(std::size_t{1} << 12);
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
  std::size_t kept = 0;
  s.cells.resize(s.moments.size());
  for (std::size_t c = 0; c < s.moments.size(); ++c) {
    const std::array<int, 3>& at = s.coordinates[c];
    const Eigen::Vector3d middle =
        size * (Eigen::Vector3d(at[0], at[1], at[2]) + Eigen::Vector3d::Constant(0.5));
    if ((middle - center).squaredNorm() > radius_m * radius_m) continue;
    s.moments[kept] = s.moments[c];
    s.coordinates[kept] = s.coordinates[c];
    s.dirty[kept] = s.dirty[c];
    s.leans[kept] = s.leans[c];
    s.cells[kept] = s.cells[c];
    ++kept;
  }
  if (kept == s.moments.size()) return;
  s.moments.resize(kept);
  s.coordinates.resize(kept);
  s.dirty.resize(kept);
  s.leans.resize(kept);
  s.cells.resize(kept);
  std::size_t table = std::size_t{1} << 12;
  while (table < 2 * kept)
    table *= 2;
  s.rehash(table);
}

NdtMapPtr NdtMapBuilder::snapshot() {
  State& s = *state_;
  s.cells.resize(s.moments.size());
  parallel_for(s.moments.size(), 512, [&](std::size_t c) {
    if (s.moments[c].n < s.config.min_points) return;
    if (s.dirty[c] == 0 && s.leans[c] == 0) return;
    s.leans[c] = 0;
    s.cells[c] = internal::make_cell(s.moments[c], s.config, [&](int reach) {
      s.leans[c] = 1;
      return s.around(c, reach);
    });
  });
  std::fill(s.dirty.begin(), s.dirty.end(), std::uint8_t{0});

  auto map = std::make_shared<NdtMap>();
  map->cell_size_ = s.config.cell_size_m;
  for (std::size_t c = 0; c < s.moments.size(); ++c) {
    if (s.moments[c].n < s.config.min_points) continue;
    map->cells_.push_back(s.cells[c]);
    map->coordinates_.push_back(s.coordinates[c]);
  }
  std::size_t table = 16;
  while (table < 2 * map->cells_.size())
    table *= 2;
  map->slots_.assign(table, NdtMap::Slot{});
  map->mask_ = table - 1;
  for (std::uint32_t c = 0; c < map->cells_.size(); ++c) {
    const std::array<int, 3>& at = map->coordinates_[c];
    const std::uint64_t key = voxel_key(at[0], at[1], at[2]);
    std::uint64_t i = voxel_hash(key) & map->mask_;
    while (map->slots_[i].cell_plus_1 != 0)
      i = (i + 1) & map->mask_;
    map->slots_[i] = {key, c + 1};
  }
  return map;
}

NdtMapPtr build_ndt_map(std::span<const PlacedCloud> clouds, const NdtMapConfig& config) {
  NdtMapBuilder builder(config);
  for (const PlacedCloud& cloud : clouds)
    builder.insert(*cloud.points_in_source, cloud.map_from_source);
  return builder.snapshot();
}

}  // namespace understory
