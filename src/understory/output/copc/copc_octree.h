#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "understory/output/copc/point_cells.h"
#include "understory/output/output_constants.h"
#include "understory/util/progress.h"

namespace understory {

// The place of a node in the octree, as COPC names it: its level, and its number along each axis of
// that level.
struct CopcKey {
  std::int32_t level = 0;
  std::array<std::int32_t, 3> at{};
};

// A node with the points that are shown from its level on.
struct CopcNode {
  CopcKey key;
  std::vector<LasPointSteps> points;
};

// The cube of the octree, its side divided into 2^30 units.
class CopcCube {
 public:
  static constexpr int kBits = 30;
  using Place = std::array<std::uint32_t, 3>;  // in units from the low corner

  // `low`, `side`: in steps, the side over 0.
  CopcCube(const std::array<std::int64_t, 3>& low, double side);

  [[nodiscard]] Place place(const std::array<std::int64_t, 3>& steps) const;
  [[nodiscard]] double side_steps(std::int32_t level) const;
  // The level whose nodes are smaller than a step.
  [[nodiscard]] std::int32_t deepest() const { return deepest_; }

 private:
  std::array<std::int64_t, 3> low_;
  double side_;
  double units_per_step_;
  std::int32_t deepest_;
};

// The numbers that shape an octree.
struct CopcShape {
  std::uint64_t most_in_memory = output_constants::copc::kMostInMemory;  // points of a cube there
  std::uint64_t most_in_leaf = output_constants::copc::kMostInLeaf;
  std::uint64_t fewest_in_node = output_constants::copc::kFewestInNode;  // else to the node above
};

// Hands nodes on, in the order in which they shall lie in the file.
using CopcNodes = std::function<void(std::vector<CopcNode>&&)>;

// Puts each point into one node of the octree over `cube`, in which all lie. It is the first one
// from the root down where no other point lies in its cell, the 128th part of the node's side.
// Every point lies in the cube of its node, and every node on the way to another holds points.
// Cubes with more points than go into memory are divided on the disk, beside `file`. Deterministic:
// the first point of a cell wins. Throws OutputError and Stopped.
void build_copc_octree(const PointCells& cells, const CopcCube& cube, const CopcShape& shape,
                       const std::filesystem::path& file, const ProgressSink& progress,
                       const CopcNodes& nodes);

}  // namespace understory
