#include "understory/forest/trees/tree_owners.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <queue>
#include <utility>

#include "understory/forest/forest_constants.h"

namespace understory {
namespace {

using namespace forest_constants::tree_owners;

// Numbers of a cube along x, y and the height.
struct Cube {
  std::int64_t x = 0;
  std::int64_t y = 0;
  std::int64_t z = 0;
};

constexpr std::int64_t kMiddle = 1 << 20;  // 21 bits each

// Whether the number of a cube there has room.
bool holds(const Eigen::Vector2d& place) {
  return place.cwiseAbs().maxCoeff() < kVoxel * static_cast<double>(kMiddle - 1);
}

std::uint64_t packed(const Cube& cube) {
  const auto part = [](std::int64_t value) {
    return static_cast<std::uint64_t>(value + kMiddle) & 0x1fffff;
  };
  return part(cube.z) << 42 | part(cube.y) << 21 | part(cube.x);
}

Cube unpacked(std::uint64_t key) {
  const auto part = [&](int shift) {
    return static_cast<std::int64_t>(key >> shift & 0x1fffff) - kMiddle;
  };
  return {part(0), part(21), part(42)};
}

std::int64_t number_of(double value, double size) {
  return static_cast<std::int64_t>(std::floor(value / size));
}

Cube cube_at(const Eigen::Vector2d& place, double height_m) {
  return {number_of(place.x(), kVoxel), number_of(place.y(), kVoxel), number_of(height_m, kVoxel)};
}

std::int64_t coarse(std::int64_t number, std::int64_t by) {
  return number >= 0 ? number / by : -((by - 1 - number) / by);
}

// The way to a cube so far.
struct Reached {
  float cost = std::numeric_limits<float>::infinity();
  std::int32_t owner = TreeOwners::kNobody;
};

// How high a tree is.
double top_of(const OwnerTree& tree) {
  return std::isfinite(tree.height_m) ? tree.height_m : kUsualHeight;
}

// Whether a tree is near enough to a cube.
bool may_own(const std::vector<OwnerTree>& trees, std::int32_t owner, std::uint64_t key,
             double size_m) {
  const OwnerTree& tree = trees[static_cast<std::size_t>(owner)];
  const Cube cube = unpacked(key);
  const auto middle = [&](std::int64_t number) {
    return (static_cast<double>(number) + 0.5) * size_m;
  };
  const double height = middle(cube.z);
  const double top = top_of(tree);
  if (std::isfinite(tree.height_m) && height > top + kOverTop) return false;
  const double reach = height < kUndergrowth
                           ? tree.radius_m + kStemReach
                           : std::clamp(kCrownShare * top + kCrownOffset, kLeastReach, kMostReach);
  return (centre_at(tree, height) - Eigen::Vector2d(middle(cube.x), middle(cube.y))).squaredNorm() <
         reach * reach;
}

// Cubes of one size and the cheapest ways to them.
class WayGrid {
 public:
  // `cubes`: sorted, each once.
  WayGrid(std::vector<std::uint64_t> cubes, double size_m, const std::vector<OwnerTree>& trees)
      : cubes_(std::move(cubes)), reached_(cubes_.size()), size_m_(size_m), trees_(trees) {}

  void seed(std::size_t i, const Reached& reached) {
    if (reached.cost >= reached_[i].cost) return;
    reached_[i] = reached;
    open_.push({reached.cost, i});
  }
  [[nodiscard]] const std::vector<Reached>& reached() const { return reached_; }
  [[nodiscard]] std::size_t index_of(std::uint64_t cube) const {
    const auto at = std::lower_bound(cubes_.begin(), cubes_.end(), cube);
    return at != cubes_.end() && *at == cube ? static_cast<std::size_t>(at - cubes_.begin())
                                             : cubes_.size();
  }

  void spread(const ProgressSink& progress) {
    std::size_t popped = 0;
    while (!open_.empty()) {
      const auto [cost, i] = open_.top();
      open_.pop();
      if (cost > reached_[i].cost) continue;
      if ((++popped & 0xffff) == 0) progress.poll();
      visit_neighbours(i);
    }
  }

 private:
  // Cheapest first; of equal ones the first cube.
  struct Later {
    bool operator()(const std::pair<float, std::size_t>& a,
                    const std::pair<float, std::size_t>& b) const {
      return a > b;
    }
  };

  void visit_neighbours(std::size_t i) {
    const Cube here = unpacked(cubes_[i]);
    for (std::int64_t dz = -1; dz <= 1; ++dz) {
      for (std::int64_t dy = -1; dy <= 1; ++dy) {
        // Cubes of one row are neighbours in the list.
        const std::uint64_t first = packed({here.x - 1, here.y + dy, here.z + dz});
        auto at = std::lower_bound(cubes_.begin(), cubes_.end(), first);
        for (; at != cubes_.end() && *at <= first + 2; ++at)
          reach(i, static_cast<std::size_t>(at - cubes_.begin()), dz, dy,
                static_cast<std::int64_t>(*at - first) - 1);
      }
    }
  }

  void reach(std::size_t from, std::size_t to, std::int64_t dz, std::int64_t dy, std::int64_t dx) {
    const double side = kSideways * std::sqrt(static_cast<double>(dx * dx + dy * dy));
    const double rise = (dz < 0 ? kDownwards : 1.0) * static_cast<double>(std::abs(dz));
    const auto cost = reached_[from].cost + static_cast<float>(size_m_ * std::hypot(side, rise));
    if (cost >= reached_[to].cost || !may_own(trees_, reached_[from].owner, cubes_[to], size_m_))
      return;
    reached_[to] = {cost, reached_[from].owner};
    open_.push({cost, to});
  }

  std::vector<std::uint64_t> cubes_;
  std::vector<Reached> reached_;
  double size_m_;
  const std::vector<OwnerTree>& trees_;
  std::priority_queue<std::pair<float, std::size_t>, std::vector<std::pair<float, std::size_t>>,
                      Later>
      open_;
};

// The cubes at the measured part of each stem, and those at its axis above.
void seed_stems(const std::vector<OwnerTree>& trees, WayGrid& grid, std::size_t count) {
  for (std::size_t t = 0; t < trees.size(); ++t) {
    const OwnerTree& tree = trees[t];
    const double reach = tree.radius_m + kSeedReach;
    const double end = std::max(tree.seen_to_m, top_of(tree)) + kVoxel;
    for (double height = 0.5 * kVoxel; height < end; height += kVoxel) {
      const double above_stem = kAxisCost * std::max(0.0, height - tree.seen_to_m);
      const Eigen::Vector2d centre = centre_at(tree, height);
      for (double y = centre.y() - reach; y < centre.y() + reach + kVoxel; y += kVoxel) {
        for (double x = centre.x() - reach; x < centre.x() + reach + kVoxel; x += kVoxel) {
          const double off = (Eigen::Vector2d(x, y) - centre).norm();
          const std::size_t i = grid.index_of(packed(cube_at({x, y}, height)));
          if (i < count && off < reach)
            grid.seed(i, {static_cast<float>(off + above_stem), static_cast<std::int32_t>(t)});
        }
      }
    }
  }
}

// Cubes that no way leads to get the owner of the larger cube that they lie in, if a way through
// larger cubes leads there.
void bridge(const std::vector<std::uint64_t>& cubes, std::int64_t by,
            const std::vector<OwnerTree>& trees, const ProgressSink& progress,
            std::vector<Reached>& reached) {
  const auto larger = [&](std::uint64_t cube) {
    const Cube small = unpacked(cube);
    return packed({coarse(small.x, by), coarse(small.y, by), coarse(small.z, by)});
  };
  std::vector<std::uint64_t> all;
  all.reserve(cubes.size());
  for (const std::uint64_t cube : cubes)
    all.push_back(larger(cube));
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  WayGrid grid(std::move(all), kVoxel * static_cast<double>(by), trees);
  for (std::size_t i = 0; i < cubes.size(); ++i) {
    if (reached[i].owner != TreeOwners::kNobody)
      grid.seed(grid.index_of(larger(cubes[i])), reached[i]);
  }
  grid.spread(progress);
  for (std::size_t i = 0; i < cubes.size(); ++i) {
    if (reached[i].owner != TreeOwners::kNobody) continue;
    const Reached& way = grid.reached()[grid.index_of(larger(cubes[i]))];
    if (way.owner != TreeOwners::kNobody && may_own(trees, way.owner, cubes[i], kVoxel))
      reached[i] = way;
  }
}

}  // namespace

Eigen::Vector2d centre_at(const OwnerTree& tree, double height_m) {
  const double last = static_cast<double>(tree.centres.size()) - 1.0;
  const double at = std::clamp(10.0 * height_m, 0.0, last);
  return tree.centres[static_cast<std::size_t>(std::lround(at))];
}

void TreeOwners::add(const Eigen::Vector2d& place, double height_m) {
  if (!holds(place)) return;
  cubes_.push_back(packed(cube_at(place, height_m)));
  if (cubes_.size() < limit_) return;
  compact();
  limit_ = std::max(limit_, 2 * cubes_.size());
}

void TreeOwners::compact() {
  std::sort(cubes_.begin(), cubes_.end());
  cubes_.erase(std::unique(cubes_.begin(), cubes_.end()), cubes_.end());
}

void TreeOwners::find(const std::vector<OwnerTree>& trees, const ProgressSink& progress) {
  compact();
  WayGrid grid(cubes_, kVoxel, trees);
  seed_stems(trees, grid, cubes_.size());
  grid.spread(progress);
  std::vector<Reached> reached = grid.reached();
  for (const std::int64_t by : kBridges)
    bridge(cubes_, by, trees, progress, reached);
  owners_.clear();
  for (const Reached& way : reached)
    owners_.push_back(way.owner);
}

Eigen::Vector2d TreeOwners::corner_of(const Eigen::Vector2d& place) {
  return {kVoxel * std::floor(place.x() / kVoxel), kVoxel * std::floor(place.y() / kVoxel)};
}

namespace {

Eigen::Vector2d corner_of_cube(std::uint64_t key) {
  const Cube cube = unpacked(key);
  return {kVoxel * static_cast<double>(cube.x), kVoxel * static_cast<double>(cube.y)};
}

}  // namespace

std::vector<std::uint64_t> TreeOwners::take_cubes() {
  compact();
  owners_.clear();
  return std::exchange(cubes_, {});
}

void TreeOwners::add_cubes(const std::vector<std::uint64_t>& cubes, const GroundArea& area) {
  for (const std::uint64_t cube : cubes) {
    if (area.contains(corner_of_cube(cube))) cubes_.push_back(cube);
  }
}

std::pair<std::vector<std::uint64_t>, std::vector<std::int32_t>> TreeOwners::owned_in(
    const GroundArea& area) const {
  std::pair<std::vector<std::uint64_t>, std::vector<std::int32_t>> owned;
  for (std::size_t i = 0; i < cubes_.size(); ++i) {
    if (!area.contains(corner_of_cube(cubes_[i]))) continue;
    owned.first.push_back(cubes_[i]);
    owned.second.push_back(owners_[i]);
  }
  return owned;
}

TreeOwners TreeOwners::of_cubes(std::vector<std::uint64_t> cubes,
                                std::vector<std::int32_t> owners) {
  TreeOwners result;
  result.cubes_ = std::move(cubes);
  result.owners_ = std::move(owners);
  return result;
}

std::int32_t TreeOwners::owner(const Eigen::Vector2d& place, double height_m) const {
  if (!holds(place)) return kNobody;
  const std::uint64_t cube = packed(cube_at(place, height_m));
  const auto at = std::lower_bound(cubes_.begin(), cubes_.end(), cube);
  if (at == cubes_.end() || *at != cube) return kNobody;
  return owners_[static_cast<std::size_t>(at - cubes_.begin())];
}

TreeOwners::Voxel TreeOwners::voxel(std::size_t i) const {
  const Cube cube = unpacked(cubes_[i]);
  const auto middle = [](std::int64_t number) {
    return (static_cast<double>(number) + 0.5) * kVoxel;
  };
  return {{middle(cube.x), middle(cube.y)}, middle(cube.z), owners_[i]};
}

}  // namespace understory
