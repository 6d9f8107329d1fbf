#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "understory/geometry/voxel_index.h"

namespace understory::internal {

// Of arrays that grow by doubling: what they take over what they hold, in the mean.
inline constexpr double kArraySlack = 1.5;
// Bytes of a VoxelIndex for each of its keys: slots of 16, a quarter to half of them in use.
inline constexpr double kIndexBytes = 48.0;

// Which cells of a block are near one along an axis, as bits x + 4 y + 16 z of the block.
struct NearAlongAxis {
  static constexpr int kFarthest = 4;        // a neighbourhood ends in the blocks beside its own
  std::uint64_t of[3][kFarthest + 1][4][3];  // axis, reach, cell, block: before, the same, after

  constexpr NearAlongAxis() : of{} {
    for (int reach = 0; reach <= kFarthest; ++reach) {
      for (int cell = 0; cell < 4; ++cell) {
        for (int block = 0; block < 3; ++block)
          add(reach, cell, block);
      }
    }
  }

 private:
  constexpr void add(int reach, int cell, int block) {
    for (int bit = 0; bit < 64; ++bit) {
      const int along[3] = {bit & 3, bit >> 2 & 3, bit >> 4};
      for (int axis = 0; axis < 3; ++axis) {
        const int steps = 4 * (block - 1) + along[axis] - cell;
        if (steps >= -reach && steps <= reach)
          of[axis][reach][cell][block] |= std::uint64_t{1} << bit;
      }
    }
  }
};
inline constexpr NearAlongAxis kNearAlongAxis;

// Cells of a grid in blocks of 4 x 4 x 4, a bit each. They tell which cells there are, which
// changed, and what lies near, without a question to each neighbour. A neighbourhood is a cube of
// cells, `reach` (0 to 4) to each side. What is near comes in an order that depends on places
// alone.
class CellBlocks {
 public:
  using Place = std::array<int, 3>;

  // The cell at a place has this number from now on.
  void set(const Place& at, std::uint32_t cell);
  void erase(const Place& at);
  // Until forget_changes().
  void mark_changed(const Place& at);
  void forget_changes();
  // About; by the blocks that there are.
  [[nodiscard]] double bytes() const {
    return static_cast<double>(blocks_.size()) * (kArraySlack * sizeof(Block) + kIndexBytes);
  }

  // Calls act(cell, x, y, z) for each cell near a place, x to z being its steps from it. Quickest
  // where there are cells in the place's own block.
  template <typename Act>
  void for_each_near(const Place& at, int reach, const Act& act) const;
  // Calls act(cell) for each cell for which reach_of(cell) is above zero and near which, so far,
  // something changed.
  template <typename ReachOf, typename Act>
  void for_each_affected(const ReachOf& reach_of, const Act& act);

 private:
  static constexpr int kShift = 2;
  static constexpr int kEdge = 1 << kShift;

  struct Block {
    Place at{};                 // in blocks
    std::uint64_t present = 0;  // bit x + 4 y + 16 z
    std::uint64_t changed = 0;
    std::uint32_t visit = 0;                 // the last one, see touched()
    std::array<std::uint32_t, 27> beside{};  // number of the block `step` from here, or kNone
    std::array<std::uint32_t, 64> cell{};
  };

  [[nodiscard]] static std::uint64_t key_of(const Place& block) {
    return voxel_key(block[0], block[1], block[2]);
  }
  [[nodiscard]] static Place block_of(const Place& at) {
    return {at[0] >> kShift, at[1] >> kShift, at[2] >> kShift};
  }
  [[nodiscard]] static int bit_of(const Place& at) {
    return (at[0] & (kEdge - 1)) | (at[1] & (kEdge - 1)) << 2 | (at[2] & (kEdge - 1)) << 4;
  }
  // The block `step` (0 to 26) from another.
  [[nodiscard]] static Place neighbour(const Place& block, std::size_t step) {
    const int s = static_cast<int>(step);
    return {block[0] + s % 3 - 1, block[1] + s / 3 % 3 - 1, block[2] + s / 9 - 1};
  }
  // Which cells of the block `step` from its own are near a cell.
  [[nodiscard]] static std::uint64_t near_mask(const Place& at, std::size_t step, int reach) {
    const auto& [x, y, z] = kNearAlongAxis.of;
    return x[reach][at[0] & 3][step % 3] & y[reach][at[1] & 3][step / 3 % 3] &
           z[reach][at[2] & 3][step / 9];
  }
  Block& find_or_add(const Place& block);
  void remove(std::uint32_t number);
  // Has the blocks beside one know its number.
  void link_neighbours(std::uint32_t number);
  // Blocks with a change in them or beside them.
  [[nodiscard]] const std::vector<std::uint32_t>& touched();

  static constexpr std::uint32_t kNone = VoxelIndex::kNone;

  std::vector<Block> blocks_;
  VoxelIndex index_;
  std::vector<Place> changed_;  // blocks
  std::vector<std::uint32_t> touched_;
  std::uint32_t visit_ = 0;
};

template <typename Act>
void CellBlocks::for_each_near(const Place& at, int reach, const Act& act) const {
  const Place block_at = block_of(at);
  const std::uint32_t own = index_.find(key_of(block_at));
  for (std::size_t step = 0; step < 27; ++step) {
    const std::uint64_t near = near_mask(at, step, reach);
    if (near == 0) continue;
    const std::uint32_t number =
        own == kNone ? index_.find(key_of(neighbour(block_at, step))) : blocks_[own].beside[step];
    if (number == kNone) continue;
    const Block& block = blocks_[number];
    for (std::uint64_t left = near & block.present; left != 0; left &= left - 1) {
      const int bit = std::countr_zero(left);
      act(block.cell[static_cast<std::size_t>(bit)], (block.at[0] << kShift) + (bit & 3) - at[0],
          (block.at[1] << kShift) + (bit >> 2 & 3) - at[1],
          (block.at[2] << kShift) + (bit >> 4) - at[2]);
    }
  }
}

template <typename ReachOf, typename Act>
void CellBlocks::for_each_affected(const ReachOf& reach_of, const Act& act) {
  for (const std::uint32_t number : touched()) {
    const Block& block = blocks_[number];
    std::array<std::uint64_t, 27> changed{};
    for (std::size_t step = 0; step < 27; ++step) {
      const std::uint32_t other = block.beside[step];
      changed[step] = other == kNone ? 0 : blocks_[other].changed;
    }
    for (std::uint64_t left = block.present; left != 0; left &= left - 1) {
      const int bit = std::countr_zero(left);
      const std::uint32_t cell = block.cell[static_cast<std::size_t>(bit)];
      const int reach = reach_of(cell);
      if (reach == 0) continue;
      const Place within = {bit & 3, bit >> 2 & 3, bit >> 4};
      for (std::size_t step = 0; step < 27; ++step) {
        if ((changed[step] & near_mask(within, step, reach)) == 0) continue;
        act(cell);
        break;
      }
    }
  }
}

}  // namespace understory::internal
