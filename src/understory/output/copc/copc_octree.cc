#include "understory/output/copc/copc_octree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <numeric>
#include <span>
#include <string>
#include <utility>

namespace understory {
namespace {

using namespace output_constants::copc;

using Place = CopcCube::Place;
using Indices = std::vector<std::uint32_t>;

CopcKey child_of(const CopcKey& key, unsigned octant) {
  CopcKey child{key.level + 1, {}};
  for (unsigned axis = 0; axis < 3; ++axis)
    child.at[axis] = 2 * key.at[axis] + static_cast<std::int32_t>((octant >> axis) & 1U);
  return child;
}

bool holds(const CopcKey& key, const Place& place) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (static_cast<std::int32_t>(place[axis] >> (CopcCube::kBits - key.level)) != key.at[axis])
      return false;
  return true;
}

unsigned octant_of(std::int32_t level, const Place& place) {
  const int shift = CopcCube::kBits - level - 1;
  return ((place[0] >> shift) & 1U) | ((place[1] >> shift) & 1U) << 1U |
         ((place[2] >> shift) & 1U) << 2U;
}

std::array<std::int64_t, 3> steps_of(const LasPointSteps& point) {
  return {point.x, point.y, point.z};
}

// The cells of a node that a point lies in already.
class TakenCells {
 public:
  TakenCells() : words_(std::size_t{1} << (3 * kSpacingBits - 6)) {}
  // Takes the cell of a place in a node of this level; false where another has it.
  bool take(std::int32_t level, const Place& place) {
    const int shift = std::max(0, CopcCube::kBits - level - kSpacingBits);
    constexpr std::size_t kInside = (std::size_t{1} << kSpacingBits) - 1;
    const auto along = [&](std::size_t axis) { return (place[axis] >> shift) & kInside; };
    const std::size_t cell = along(0) | along(1) << kSpacingBits | along(2) << (2 * kSpacingBits);
    std::uint64_t& word = words_[cell >> 6U];
    const std::uint64_t bit = std::uint64_t{1} << (cell & 63U);
    if ((word & bit) != 0) return false;
    word |= bit;
    return true;
  }
  void clear() { std::fill(words_.begin(), words_.end(), 0); }

 private:
  std::vector<std::uint64_t> words_;
};

// A node above the cubes that fit into memory.
struct OpenNode {
  CopcNode node;
  TakenCells taken;
};

class OctreeBuilder {
 public:
  OctreeBuilder(const CopcCube& cube, const CopcShape& shape, std::filesystem::path file,
                const ProgressSink& progress, const CopcNodes& nodes, std::uint64_t total)
      : cube_(cube),
        shape_(shape),
        file_(std::move(file)),
        stage_("writing " + file_.filename().string()),
        progress_(progress),
        nodes_(nodes),
        total_(static_cast<double>(total)) {}

  // The points of a node and below it, which are all in `cells`; others in them are passed over.
  void divide(const PointCells& store, const PointCells::Cells& cells, const CopcKey& key) {
    const std::uint64_t most = PointCells::count(cells);
    if (most == 0) return;
    if (most <= shape_.most_in_memory || key.level == cube_.deepest()) {
      take_into_memory(store, cells, key);
      return;
    }
    if (store.bits() > 0 && cube_.side_steps(key.level) < std::exp2(store.bits() + kFewCellsBits)) {
      divide_finer(store, cells, key);
      return;
    }
    open_.push_back(std::make_unique<OpenNode>(OpenNode{{key, {}}, {}}));
    for (unsigned octant = 0; octant < 8; ++octant) {
      const CopcKey child = child_of(key, octant);
      divide(store, cells_of(store, cells, child), child);
    }
    std::vector<CopcNode> closed;
    closed.push_back(std::move(open_.back()->node));
    open_.pop_back();
    if (!closed.front().points.empty()) nodes_(std::move(closed));
  }

 private:
  // Cells that reach into a node.
  [[nodiscard]] PointCells::Cells cells_of(const PointCells& store, const PointCells::Cells& cells,
                                           const CopcKey& key) const {
    const std::int64_t last = (std::int64_t{1} << store.bits()) - 1;
    const int shift = CopcCube::kBits - key.level;
    PointCells::Cells inside;
    for (const PointCells::Cell* cell : cells) {
      const Place low = cube_.place(cell->low);
      const Place high =
          cube_.place({cell->low[0] + last, cell->low[1] + last, cell->low[2] + last});
      bool reaches = true;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        reaches = reaches && static_cast<std::int32_t>(low[axis] >> shift) <= key.at[axis] &&
                  static_cast<std::int32_t>(high[axis] >> shift) >= key.at[axis];
      }
      if (reaches) inside.push_back(cell);
    }
    return inside;
  }

  void divide_finer(const PointCells& store, const PointCells::Cells& cells, const CopcKey& key) {
    PointCells finer(file_, std::max(0, store.bits() - kFinerBits), kWaitingFiner);
    store.visit(cells, [&](std::span<const LasPointSteps> points) {
      progress_.poll();
      for (const LasPointSteps& point : points)
        if (holds(key, cube_.place(steps_of(point)))) finer.add(point);
    });
    finer.settle();
    divide(finer, finer.all(), key);
  }

  void take_into_memory(const PointCells& store, const PointCells::Cells& cells,
                        const CopcKey& key) {
    points_.clear();
    places_.clear();
    const std::uint64_t most = std::min(PointCells::count(cells), shape_.most_in_memory);
    points_.reserve(most);
    places_.reserve(most);
    store.visit(cells, [&](std::span<const LasPointSteps> points) {
      progress_.poll();
      for (const LasPointSteps& point : points)
        take(point, key);
      progress_({stage_, done_ / 1e3, total_ / 1e3, "thousand points", ""});
    });
    if (points_.empty()) return;
    if (!open_.empty() && points_.size() < shape_.fewest_in_node) {
      std::vector<LasPointSteps>& above = open_.back()->node.points;
      above.insert(above.end(), points_.begin(), points_.end());
      return;
    }
    Indices indices(points_.size());
    std::iota(indices.begin(), indices.end(), 0U);
    grow(key, std::move(indices));
    pass_on();
  }

  void take(const LasPointSteps& point, const CopcKey& key) {
    const Place place = cube_.place(steps_of(point));
    if (!holds(key, place)) return;
    done_ += 1.0;
    for (const auto& open : open_) {
      if (!open->taken.take(open->node.key.level, place)) continue;
      open->node.points.push_back(point);
      return;
    }
    points_.push_back(point);
    places_.push_back(place);
  }

  // The node of a cube in memory and all below it.
  void grow(const CopcKey& key, Indices indices) {
    if (indices.size() <= shape_.most_in_leaf || key.level == cube_.deepest()) {
      hand_on(key, indices);
      return;
    }
    taken_.clear();
    Indices own;
    std::array<Indices, 8> halves;
    for (const std::uint32_t i : indices) {
      if (taken_.take(key.level, places_[i])) {
        own.push_back(i);
      } else {
        halves[octant_of(key.level, places_[i])].push_back(i);
      }
    }
    indices = {};
    for (Indices& half : halves) {
      if (half.size() >= shape_.fewest_in_node) continue;
      own.insert(own.end(), half.begin(), half.end());
      half = {};
    }
    std::sort(own.begin(), own.end());
    hand_on(key, own);
    for (unsigned octant = 0; octant < 8; ++octant) {
      if (halves[octant].empty()) continue;
      grow(child_of(key, octant), std::move(halves[octant]));
    }
  }

  void hand_on(const CopcKey& key, const Indices& indices) {
    CopcNode node{key, {}};
    node.points.reserve(indices.size());
    for (const std::uint32_t i : indices)
      node.points.push_back(points_[i]);
    grown_.push_back(std::move(node));
    grown_points_ += indices.size();
    if (grown_points_ >= kPassedOn) pass_on();
  }
  void pass_on() {
    progress_.poll();
    nodes_(std::exchange(grown_, {}));
    grown_points_ = 0;
  }

  const CopcCube& cube_;
  const CopcShape& shape_;
  std::filesystem::path file_;
  std::string stage_;
  const ProgressSink& progress_;
  const CopcNodes& nodes_;
  double total_;
  double done_ = 0.0;
  std::vector<std::unique_ptr<OpenNode>> open_;  // from the root down
  std::vector<LasPointSteps> points_;            // of the cube in memory
  std::vector<Place> places_;                    // of the same index
  TakenCells taken_;
  std::vector<CopcNode> grown_;
  std::size_t grown_points_ = 0;
};

}  // namespace

CopcCube::CopcCube(const std::array<std::int64_t, 3>& low, double side)
    : low_(low), side_(side), units_per_step_(std::exp2(kBits) / side), deepest_(0) {
  while (deepest_ < kBits && side_steps(deepest_) >= 1.0)
    ++deepest_;
}

double CopcCube::side_steps(std::int32_t level) const {
  return std::ldexp(side_, -level);
}

CopcCube::Place CopcCube::place(const std::array<std::int64_t, 3>& steps) const {
  constexpr double kLast = static_cast<double>((std::int64_t{1} << kBits) - 1);
  Place place;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double units = static_cast<double>(steps[axis] - low_[axis]) * units_per_step_;
    place[axis] = static_cast<std::uint32_t>(std::clamp(units, 0.0, kLast));
  }
  return place;
}

void build_copc_octree(const PointCells& cells, const CopcCube& cube, const CopcShape& shape,
                       const std::filesystem::path& file, const ProgressSink& progress,
                       const CopcNodes& nodes) {
  OctreeBuilder(cube, shape, file, progress, nodes, PointCells::count(cells.all()))
      .divide(cells, cells.all(), CopcKey{});
}

}  // namespace understory
