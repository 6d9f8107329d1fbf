#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "understory/simulation/scene/lanes.h"

namespace understory {

// A tree of boxes, eight a node, for walks by beams (fat_ray.h). Planes are whole numbers of steps
// of the tree's own frame, rounded outwards, so that a node is two cache lines. Each leaf is one
// box. Its structure depends on the boxes alone. Immutable but for `refit`; reading is thread-safe.
class BoxTree {
 public:
  static constexpr std::uint32_t kLeaf = 0x80000000U;  // marks a child that is a leaf
  static constexpr std::uint32_t kFree = ~0U;          // a slot without a child
  static constexpr std::size_t kDeepest = 40;          // nodes from the root to a leaf

  struct alignas(64) Node {
    // Lower planes of x, y, z, then upper ones, child by child.
    std::array<std::array<std::uint16_t, kLanes>, 6> planes;
    std::array<std::uint32_t, kLanes> child;  // number of a node, or kLeaf | place in order()
  };
  static_assert(sizeof(Node) == 128);

  // Where the planes lie: base + number * step of x, y, z, 0, and once more.
  struct Frame {
    std::array<float, kLanes> base{};
    std::array<float, kLanes> step{};
  };

  BoxTree() = default;
  explicit BoxTree(std::span<const Eigen::AlignedBox3f> boxes);

  // Boxes moved, as many as before. Empty ones are met by chance or not at all.
  void refit(std::span<const Eigen::AlignedBox3f> boxes);

  [[nodiscard]] bool empty() const { return nodes_.empty(); }
  // The numbers of the boxes in the order of the leaves.
  [[nodiscard]] const std::vector<std::uint32_t>& order() const { return order_; }
  [[nodiscard]] const Node& node(std::uint32_t number) const { return nodes_[number]; }
  // Brings a node near the processor.
  void fetch(std::uint32_t number) const {
    __builtin_prefetch(&nodes_[number]);
    __builtin_prefetch(&nodes_[number].child);
  }
  [[nodiscard]] const Frame& frame() const { return frame_; }
  // Around all boxes, and around those below each child of the root (empty: a free slot).
  [[nodiscard]] const Eigen::AlignedBox3f& box() const { return box_; }
  [[nodiscard]] std::array<Eigen::AlignedBox3f, kLanes> first_boxes() const;

 private:
  std::vector<Node> nodes_;  // parents before their children
  std::vector<std::uint32_t> order_;
  Frame frame_;
  Eigen::AlignedBox3f box_;
};

}  // namespace understory
