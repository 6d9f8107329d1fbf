#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "understory/output/clouds/las_stream.h"

namespace understory {

// Points of a cloud by the cells of a grid. As many as may wait in memory are sorted together.
// Where there are more they go to a file of the system's that has no name. So nothing of it stays
// behind a killed process. Within a cell points keep the order in which they came. Not thread-safe.
class PointCells {
 public:
  // Cells of 2^bits steps. The file lies in the folder of `file` where one is needed. `in_memory`:
  // points that may wait.
  PointCells(std::filesystem::path file, int bits, std::uint64_t in_memory);
  ~PointCells();
  PointCells(const PointCells&) = delete;
  PointCells& operator=(const PointCells&) = delete;

  // Throws OutputError where the disk is full.
  void add(const LasPointSteps& point);
  // No more come; before the following are called. Throws OutputError.
  void settle();

  [[nodiscard]] int bits() const { return bits_; }
  // A cell from `low` on, in steps, and where its points lie.
  struct Cell {
    struct Block {
      std::uint64_t first = 0;  // in points from the beginning of the file, or of what is in memory
      std::uint64_t points = 0;
    };
    std::array<std::int64_t, 3> low{};
    std::uint64_t points = 0;
    std::vector<Block> blocks;
  };
  using Cells = std::vector<const Cell*>;
  [[nodiscard]] Cells all() const;
  [[nodiscard]] static std::uint64_t count(const Cells& cells);
  // Cell after cell, in the order of their places. Throws OutputError.
  void visit(const Cells& cells,
             const std::function<void(std::span<const LasPointSteps>)>& visitor) const;

 private:
  using Key = std::array<std::int32_t, 3>;
  // The waiting points by their cells, which get blocks from `first` on.
  [[nodiscard]] std::vector<std::uint32_t> sorted(std::uint64_t first);
  void move_to_disk();

  struct Spill;
  std::filesystem::path file_;
  int bits_;
  std::uint64_t in_memory_;
  std::vector<LasPointSteps> waiting_;
  std::map<Key, Cell> cells_;
  std::unique_ptr<Spill> spill_;
};

}  // namespace understory
