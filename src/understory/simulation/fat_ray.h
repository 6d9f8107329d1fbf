#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "understory/simulation/box_tree.h"
#include "understory/simulation/lanes.h"

namespace understory {

// Up to eight rays that go nearly the same way, in one frame. Directions need not be of unit
// length: a place along a ray is origin + range * direction in every frame.
struct RayLanes {
  Lanes3 origin;
  Lanes3 direction;
};

// All rays of a beam at once, for one tree of boxes: at each range they are within a box whose
// sides move at the speed of the fastest and of the slowest ray along each axis. A box of the tree
// is met only if at some range the two overlap, so no ray that meets it is lost.
class FatRay {
 public:
  // Only the rays of `active` count; at least one.
  FatRay(const RayLanes& rays, LaneMask active, const BoxTree::Frame& frame) {
    constexpr float kFar = std::numeric_limits<float>::infinity();
    const Lanes* directions = &rays.direction.x;
    const Lanes* origins = &rays.origin.x;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<Eigen::Index>(axis);
      const float slow = smallest(select(active, directions[axis], kFar));
      const float fast = largest(select(active, directions[axis], -kFar));
      const float low = smallest(select(active, origins[axis], kFar));
      const float high = largest(select(active, origins[axis], -kFar));
      const Plane lower(axis, fast, high, frame.base[a], frame.step[a]);
      const Plane upper(axis + 3, slow, low, frame.base[a], frame.step[a]);
      // Rays pass the lower planes on their way up: before, they are not in the box.
      if (slow > 0.0F) {
        near_[axis] = lower;
        far_[axis] = upper;
      } else if (fast < 0.0F) {
        near_[axis] = upper;
        far_[axis] = lower;
      } else {  // some go up, some down: they enter through both
        near_[axis] = lower;
        far_[axis] = {axis, 0.0F, kFar};
        also_near_[spread_++] = upper;
      }
    }
  }

  // Ranges at which the children's boxes are entered and left; met where from <= to.
  void meet(const BoxTree::Node& node, Lanes& from, Lanes& to) const {
    from = max(max(at(near_[0], node), at(near_[1], node)), at(near_[2], node));
    to = min(min(at(far_[0], node), at(far_[1], node)), at(far_[2], node));
    for (std::size_t i = 0; i < spread_; ++i)
      from = max(from, at(also_near_[i], node));
  }

 private:
  // Range at which a side of the beam passes a plane: number * slope + shift.
  struct Plane {
    Plane() = default;
    Plane(std::size_t plane, float multiply, float add)
        : number(plane), slope(multiply), shift(add) {}
    Plane(std::size_t plane, float speed, float origin, float base, float step) : number(plane) {
      constexpr float kSlowest = 1e-12F;  // keeps what follows finite
      const float per =
          1.0F / (std::abs(speed) < kSlowest ? std::copysign(kSlowest, speed) : speed);
      slope = step * per;
      shift = (base - origin) * per;
    }
    std::size_t number;
    float slope;
    float shift;
  };
  static Lanes at(const Plane& plane, const BoxTree::Node& node) {
    return lanes_of(node.planes[plane.number].data()) * plane.slope + plane.shift;
  }

  Plane near_[3];
  Plane far_[3];
  Plane also_near_[3];
  std::size_t spread_ = 0;  // axes along which rays go both ways
};

// Goes through a tree along a beam, the nearer boxes first, and calls leaf(place in order()) for
// those that it meets between `near` and `far`; leaf may lower `far`.
template <class Leaf>
void walk(const BoxTree& tree, const FatRay& beam, float near, const float& far, Leaf&& leaf) {
  struct Waiting {
    std::uint32_t node;
    float from;
  };
  if (tree.empty()) return;
  std::array<Waiting, BoxTree::kDeepest * kLanes> waiting;
  std::size_t count = 0;
  std::uint32_t number = 0;
  for (;;) {
    const BoxTree::Node& node = tree.node(number);
    Lanes from;
    Lanes to;
    beam.meet(node, from, to);
    from = max(from, near);
    unsigned met = (from <= min(to, far)).bits() & taken(node.child.data());
    const unsigned leaves = met & marked(node.child.data());
    met ^= leaves;
    alignas(32) std::array<float, kLanes> ranges;
    from.store(ranges.data());
    for (unsigned rest = leaves; rest != 0; rest &= rest - 1) {
      const auto i = static_cast<std::size_t>(std::countr_zero(rest));
      leaf(node.child[i] & ~BoxTree::kLeaf, ranges[i]);
    }
    // Those that wait, the nearest last.
    const std::size_t before = count;
    for (unsigned rest = met; rest != 0; rest &= rest - 1) {
      const auto i = static_cast<std::size_t>(std::countr_zero(rest));
      std::size_t place = count++;
      for (; place > before && waiting[place - 1].from < ranges[i]; --place)
        waiting[place] = waiting[place - 1];
      waiting[place] = {node.child[i], ranges[i]};
    }
    while (count > 0 && waiting[count - 1].from > far)
      --count;
    if (count == 0) return;
    number = waiting[--count].node;
  }
}

}  // namespace understory
