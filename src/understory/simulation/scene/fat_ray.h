#pragma once

#include <algorithm>
#include <bit>
#include <limits>
#include <tuple>

#include "understory/simulation/scene/box_tree.h"
#include "understory/simulation/scene/lanes.h"

namespace understory {

// Up to eight rays that go nearly the same way, in one frame. Directions need not be of unit
// length: a place along a ray is origin + range * direction in every frame.
struct RayLanes {
  Lanes3 origin;
  Lanes3 direction;
  bool one_origin = false;  // all begin at the same place
};

// All rays of a beam at once, for one tree of boxes. At each range they are within a box whose
// sides move at the speed of the fastest and of the slowest ray along each axis. A box of the tree
// is met only if at some range the two overlap, so no ray that meets it is lost.
class FatRay {
 public:
  // Only the rays of `active` count; at least one.
  FatRay(const RayLanes& rays, LaneMask active, const BoxTree::Frame& frame) {
    constexpr float kFar = std::numeric_limits<float>::infinity();
    const auto& [d, o] = std::tie(rays.direction, rays.origin);
    // Along x, y, z: of the first ray to pass a lower plane and of the last, for upper planes.
    const Lanes speed = extremes(d.x, d.y, d.z, active);
    const Lanes start =
        rays.one_origin ? first_lanes(o.x, o.y, o.z) : extremes(o.x, o.y, o.z, active);
    const Lanes per = Lanes(1.0F) / away_from_zero(speed);
    std::array<float, kLanes> slope;
    std::array<float, kLanes> shift;
    (Lanes::load(frame.step.data()) * per).store(slope.data());
    ((Lanes::load(frame.base.data()) - start) * per).store(shift.data());
    const unsigned down = (speed < Lanes(0.0F)).bits();
    for (unsigned axis = 0; axis < 3; ++axis) {
      const Plane lower = {axis, slope[axis], shift[axis]};
      const Plane upper = {axis + 3, slope[axis + 4], shift[axis + 4]};
      const bool all_down = (down >> axis & 1U) != 0;
      const bool some_down = (down >> (axis + 4) & 1U) != 0;
      // Rays pass the lower planes on their way up: before, they are not in the box.
      near_[axis] = all_down ? upper : lower;
      far_[axis] = all_down ? lower : upper;
      if (all_down == some_down) continue;
      far_[axis] = {axis, 0.0F, kFar};  // some go up, some down: they enter through both
      also_near_[spread_++] = upper;
    }
  }

  // Which boxes of a node are met in [near, far], as bits, and from which ranges on.
  template <class Node>
  unsigned meet(const Node& node, float near, float far, std::array<float, kLanes>& ranges) const {
    Lanes from = max(max(at(near_[0], node), at(near_[1], node)), at(near_[2], node));
    const Lanes to = min(min(at(far_[0], node), at(far_[1], node)), at(far_[2], node));
    for (std::size_t i = 0; i < spread_; ++i)
      from = max(from, at(also_near_[i], node));
    from = max(from, near);
    from.store(ranges.data());
    return (from <= min(to, far)).bits();
  }

 private:
  // Range at which a side of the beam passes a plane: number * slope + shift.
  struct Plane {
    unsigned row;  // of the planes of a node
    float slope;
    float shift;
  };
  template <class Node>
  static Lanes at(const Plane& plane, const Node& node) {
    return lanes_of(node.planes[plane.row].data()) * plane.slope + plane.shift;
  }

  static Lanes away_from_zero(Lanes speed) {
    const Lanes least(1e-12F);  // keeps what follows finite
    const Lanes none(0.0F);
    return select(none <= speed, max(speed, least), min(speed, none - least));
  }

  Plane near_[3];
  Plane far_[3];
  Plane also_near_[3];
  std::size_t spread_ = 0;  // axes along which rays go both ways
};

// The children of a root that a beam meets, as bits, and from which ranges on.
struct Entered {
  unsigned children = 0;
  std::array<float, kLanes> ranges;
};

// Goes through a tree along a beam, the nearer boxes first. It calls leaf(place in order(), range
// from which on it is met) for those that it meets between `near` and `far`. leaf may lower `far`.
// fetch(place) comes some time before and may bring near what leaf will need. What of the root is
// met may be known before.
template <class Fetch, class Leaf>
void walk(const BoxTree& tree, const FatRay& beam, float near, const float& far, Fetch&& fetch,
          Leaf&& leaf, const Entered* entered = nullptr) {
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
    alignas(32) std::array<float, kLanes> ranges;
    unsigned met;
    if (entered != nullptr) {
      met = entered->children;
      ranges = entered->ranges;
      entered = nullptr;
    } else {
      met = beam.meet(node, near, far, ranges);
    }
    met &= taken(node.child.data());
    const unsigned leaves = met & marked(node.child.data());
    met ^= leaves;
    for (unsigned rest = leaves; rest != 0; rest &= rest - 1)
      fetch(node.child[static_cast<std::size_t>(std::countr_zero(rest))] & ~BoxTree::kLeaf);
    // Those that wait, the nearest last.
    const std::size_t before = count;
    for (unsigned rest = met; rest != 0; rest &= rest - 1) {
      const auto i = static_cast<std::size_t>(std::countr_zero(rest));
      std::size_t place = count++;
      for (; place > before && waiting[place - 1].from < ranges[i]; --place)
        waiting[place] = waiting[place - 1];
      waiting[place] = {node.child[i], ranges[i]};
      tree.fetch(node.child[i]);
    }
    for (unsigned rest = leaves; rest != 0; rest &= rest - 1) {
      const auto i = static_cast<std::size_t>(std::countr_zero(rest));
      leaf(node.child[i] & ~BoxTree::kLeaf, ranges[i]);
    }
    while (count > 0 && waiting[count - 1].from > far)
      --count;
    if (count == 0) return;
    number = waiting[--count].node;
  }
}

}  // namespace understory
