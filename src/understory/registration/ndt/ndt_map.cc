#include "understory/registration/ndt/ndt_map.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <limits>

#include "understory/registration/cell_blocks.h"
#include "understory/registration/ndt/ndt_cell.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"

namespace understory {

using internal::CellBlocks;
using internal::CellMoments;
using internal::StoredMoments;

Eigen::Vector3d NdtMap::mean(std::size_t index) const {
  const std::array<int, 3>& at = coordinates_[index];
  return cell_size_ * (Eigen::Vector3d(at[0], at[1], at[2]) + Eigen::Vector3d::Constant(0.5)) +
         cells_[index].mean.cast<double>();
}

namespace {

std::uint64_t key_of(const std::array<int, 3>& cell) {
  return voxel_key(cell[0], cell[1], cell[2]);
}

// Calls `act` with the index of each flag that is set, in order; quick where few are.
template <typename Act>
void for_each_set(const std::vector<std::uint8_t>& flags, const Act& act) {
  for (std::size_t i = 0; i < flags.size(); i += 8) {
    const std::size_t count = std::min<std::size_t>(8, flags.size() - i);
    std::uint64_t eight = 0;
    std::memcpy(&eight, &flags[i], count);
    if (eight == 0) continue;
    for (std::size_t k = i; k < i + count; ++k) {
      if (flags[k] != 0) act(static_cast<std::uint32_t>(k));
    }
  }
}

}  // namespace

struct NdtMapBuilder::State {
  static constexpr std::uint32_t kNone = VoxelIndex::kNone;

  struct Located {
    std::array<int, 3> at;
    float from_center[3];
    Eigen::Vector3f ray;  // direction from the lidar, map axes
    std::uint32_t cell;
  };

  // Both of a cache line each: points fall into cells that lie scattered in memory.
  struct alignas(64) Gathered {
    StoredMoments moments;  // of all points
    float due = 0.0F;       // so many are taken into the distribution, see NdtMapConfig::growth
    std::uint32_t in_map = kNone;  // index in `map`, or kNone: too few points so far
  };
  struct alignas(64) Settled {
    StoredMoments moments;  // as the distribution takes them
    std::array<int, 3> at{};
  };
  static_assert(sizeof(Gathered) == 64 && sizeof(Settled) == 64);

  NdtMapConfig config;
  // Of each cell that has points.
  std::vector<Gathered> gathered;
  std::vector<Settled> settled;
  std::vector<std::uint8_t> dirty;  // it has changed since the last snapshot
  std::vector<std::uint8_t> leans;  // so far, in cells, its distribution rests on its neighbours
  VoxelIndex index;
  CellBlocks blocks;  // of those with a distribution; changed since the last snapshot

  std::shared_ptr<NdtMap> map;       // as of the last snapshot
  std::vector<std::uint32_t> owner;  // of each of its cells, the cell here
  std::vector<Located> located;      // workspace
  std::vector<std::uint32_t> due;    // workspace

  std::uint32_t find_or_add(const std::array<int, 3>& at) {
    const std::uint64_t key = key_of(at);
    const std::uint32_t found = index.find(key);
    if (found != kNone) return found;
    const auto cell = static_cast<std::uint32_t>(gathered.size());
    index.set(key, cell);
    gathered.emplace_back().due = static_cast<float>(config.min_points);
    settled.emplace_back().at = at;
    dirty.push_back(0);
    leans.push_back(0);
    return cell;
  }

  // The last cell takes the place of the one removed.
  void remove(std::uint32_t cell) {
    const std::array<int, 3> at = settled[cell].at;
    if (gathered[cell].in_map != kNone) {
      blocks.mark_changed(at);
      remove_from_map(gathered[cell].in_map);
    }
    if (settled[cell].moments.n > 0.0F) blocks.erase(at);
    index.erase(key_of(at));
    const auto last = static_cast<std::uint32_t>(gathered.size() - 1);
    if (cell != last) {
      gathered[cell] = gathered[last];
      settled[cell] = settled[last];
      dirty[cell] = dirty[last];
      leans[cell] = leans[last];
      index.set(key_of(settled[cell].at), cell);
      if (settled[cell].moments.n > 0.0F) blocks.set(settled[cell].at, cell);
      if (gathered[cell].in_map != kNone) owner[gathered[cell].in_map] = cell;
    }
    gathered.pop_back();
    settled.pop_back();
    dirty.pop_back();
    leans.pop_back();
  }

  void add_to_map(std::uint32_t cell) {
    const auto place = static_cast<std::uint32_t>(owner.size());
    gathered[cell].in_map = place;
    owner.push_back(cell);
    map->index_.set(key_of(settled[cell].at), place);
    map->cells_.emplace_back();
    map->coordinates_.push_back(settled[cell].at);
  }

  void remove_from_map(std::uint32_t place) {
    own_map();
    map->index_.erase(key_of(map->coordinates_[place]));
    const auto last = static_cast<std::uint32_t>(owner.size() - 1);
    if (place != last) {
      map->cells_[place] = map->cells_[last];
      map->coordinates_[place] = map->coordinates_[last];
      map->index_.set(key_of(map->coordinates_[place]), place);
      owner[place] = owner[last];
      gathered[owner[place]].in_map = place;
    }
    map->cells_.pop_back();
    map->coordinates_.pop_back();
    owner.pop_back();
  }

  // Takes a cell's points into its distribution.
  void settle(std::uint32_t cell) {
    Gathered& points = gathered[cell];
    if (settled[cell].moments.n == 0.0F) blocks.set(settled[cell].at, cell);
    blocks.mark_changed(settled[cell].at);
    settled[cell].moments = points.moments;
    const float n = points.moments.n;
    points.due = std::max(n + 1.0F, (1.0F + static_cast<float>(config.growth)) * n);
    dirty[cell] = 1;
  }

  // Makes `map` one that nobody else holds.
  void own_map() {
    if (map.use_count() > 1) {
      map = std::make_shared<NdtMap>(*map);
    } else {
      // What its other holders read is over.
      std::atomic_thread_fence(std::memory_order_acquire);
    }
  }

  [[nodiscard]] CellMoments around(std::size_t cell, int reach) const {
    CellMoments total;
    blocks.for_each_near(settled[cell].at, reach, [&](std::uint32_t near, int x, int y, int z) {
      total.add(settled[near].moments.wide(), config.cell_size_m * Eigen::Vector3d(x, y, z));
    });
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
  const NdtMapConfig config = state_->config;
  *state_ = State();
  state_->config = config;
  state_->map = std::make_shared<NdtMap>();
  state_->map->cell_size_ = config.cell_size_m;
  if (!config.viewpoint_in_source) return;
  std::vector<Eigen::Vector3d>& viewpoints = state_->map->viewpoints_in_source_;
  viewpoints = {*config.viewpoint_in_source};
  viewpoints.insert(viewpoints.end(), config.further_viewpoints_in_source.begin(),
                    config.further_viewpoints_in_source.end());
}

void NdtMapBuilder::insert(const NdtSource& source, const Pose& map_from_source) {
  const Points& points_in_source = source.points;
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
  std::vector<Eigen::Vector3f> viewpoints;
  for (const Eigen::Vector3d& place : s.map->viewpoints_in_source_)
    viewpoints.emplace_back(place.cast<float>());
  parallel_for(points_in_source.size(), 4096, [&](std::size_t i) {
    const Eigen::Vector3f p = r * points_in_source[i] + t;
    State::Located& to = s.located[i];
    if (rays) {
      const std::size_t lidar = std::min(source.lidar_of(i), viewpoints.size() - 1);
      to.ray = (r * (points_in_source[i] - viewpoints[lidar])).normalized();
    }
    for (int k = 0; k < 3; ++k) {
      const int whole = voxel_floor(p[k]);
      to.at[static_cast<std::size_t>(k)] = base[static_cast<std::size_t>(k)] + whole;
      to.from_center[k] = (p[k] - static_cast<float>(whole) - 0.5F) * edge;
    }
  });
  // Memory is asked for some points ahead: cells lie scattered, and the processor would wait.
  constexpr std::size_t kAhead = 12;
  const std::size_t count = s.located.size();
  for (std::size_t i = 0; i < count; ++i) {
    s.index.prefetch(key_of(s.located[std::min(i + kAhead, count - 1)].at));
    s.located[i].cell = s.find_or_add(s.located[i].at);
  }
  for (std::size_t i = 0; i < count; ++i) {
    __builtin_prefetch(&s.gathered[s.located[std::min(i + kAhead, count - 1)].cell], 1);
    const State::Located& point = s.located[i];
    State::Gathered& cell = s.gathered[point.cell];
    cell.moments.add(point.from_center[0], point.from_center[1], point.from_center[2]);
    if (rays) cell.moments.add_ray(point.ray.x(), point.ray.y(), point.ray.z());
    if (cell.moments.n < cell.due) continue;
    cell.due = std::numeric_limits<float>::infinity();  // once is enough
    s.due.push_back(point.cell);
  }
  for (const std::uint32_t cell : s.due)
    s.settle(cell);
  s.due.clear();
}

void NdtMapBuilder::remove_beyond(const Eigen::Vector3d& center, double radius_m) {
  State& s = *state_;
  const double size = s.config.cell_size_m;
  for (std::uint32_t c = 0; c < s.gathered.size();) {
    const std::array<int, 3>& at = s.settled[c].at;
    const Eigen::Vector3d middle =
        size * (Eigen::Vector3d(at[0], at[1], at[2]) + Eigen::Vector3d::Constant(0.5));
    if ((middle - center).squaredNorm() > radius_m * radius_m) {
      s.remove(c);  // another one is here now
    } else {
      ++c;
    }
  }
}

double NdtMapBuilder::bytes() const {
  const State& s = *state_;
  const auto cells = static_cast<double>(s.gathered.size());
  const auto in_map = static_cast<double>(s.owner.size());
  constexpr double kCell = sizeof(State::Gathered) + sizeof(State::Settled) + 2;
  constexpr double kInMap = sizeof(NdtCell) + sizeof(std::array<int, 3>) + sizeof(std::uint32_t);
  return internal::kArraySlack * (cells * kCell + in_map * kInMap) +
         internal::kIndexBytes * (cells + in_map) + s.blocks.bytes();
}

NdtMapPtr NdtMapBuilder::snapshot() {
  State& s = *state_;
  s.own_map();
  s.blocks.for_each_affected([&](std::uint32_t c) { return static_cast<int>(s.leans[c]); },
                             [&](std::uint32_t c) { s.dirty[c] = 1; });
  s.blocks.forget_changes();
  std::vector<std::uint32_t> changed;
  for_each_set(s.dirty, [&](std::uint32_t c) {
    s.dirty[c] = 0;
    changed.push_back(c);
    if (s.gathered[c].in_map == State::kNone) s.add_to_map(c);
  });
  parallel_for(changed.size(), 256, [&](std::size_t i) {
    const std::uint32_t c = changed[i];
    s.leans[c] = 0;
    const auto around = [&](int reach) {
      s.leans[c] = static_cast<std::uint8_t>(reach);
      return s.around(c, reach);
    };
    s.map->cells_[s.gathered[c].in_map] =
        internal::make_cell(s.settled[c].moments.wide(), s.config, around);
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
