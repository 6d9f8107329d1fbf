#include "understory/simulation/scene/box_tree.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "understory/util/error.h"

namespace understory {
namespace {

using Box = Eigen::AlignedBox3f;

constexpr int kBins = 16;           // of which the best border between two parts is chosen
constexpr float kSteps = 65000.0F;  // across a tree, below 2^16 with room for rounding
constexpr float kSlack = 0.05F;     // steps by which planes lie further out than they need to
constexpr float kLeafCost = 0.7F;   // of a leaf, nodes cost 1
constexpr int kHalvesBelow = 24;    // levels after which parts are cut in the middle

float half_area(const Box& box) {
  if (box.isEmpty()) return 0.0F;
  const Eigen::Vector3f size = box.sizes();
  return size.x() * size.y() + size.y() * size.z() + size.z() * size.x();
}

// A tree of two children a node, from the root down.
class Halves {
 public:
  struct Part {
    Box box;
    std::uint32_t first = 0;  // child, the other follows; or box number
    bool leaf = false;
  };

  explicit Halves(std::span<const Box> boxes) : boxes_(boxes), numbers_(boxes.size()) {
    std::iota(numbers_.begin(), numbers_.end(), 0U);
    middles_.reserve(boxes.size());
    for (const Box& box : boxes)
      middles_.push_back(box.isEmpty() ? Eigen::Vector3f::Zero().eval() : box.center());
    parts_.reserve(2 * boxes.size());
    parts_.emplace_back();
    divide(0, 0, numbers_.size(), 0);
  }

  [[nodiscard]] const Part& part(std::uint32_t number) const { return parts_[number]; }
  [[nodiscard]] std::size_t size() const { return parts_.size(); }

 private:
  void divide(std::uint32_t part, std::size_t begin, std::size_t end, int level) {
    Box all;
    Box middles;
    for (std::size_t i = begin; i < end; ++i) {
      all.extend(boxes_[numbers_[i]]);
      middles.extend(middles_[numbers_[i]]);
    }
    parts_[part].box = all;
    if (end - begin == 1) {
      parts_[part].leaf = true;
      parts_[part].first = numbers_[begin];
      return;
    }
    const std::size_t border = level < kHalvesBelow ? best_border(begin, end, middles) : begin;
    const bool cut = border > begin && border < end;
    const std::size_t middle = cut ? border : halve(begin, end, middles);
    const auto child = static_cast<std::uint32_t>(parts_.size());
    parts_[part].first = child;
    parts_.resize(parts_.size() + 2);
    divide(child, begin, middle, level + 1);
    divide(child + 1, middle, end, level + 1);
  }

  std::size_t halve(std::size_t begin, std::size_t end, const Box& middles) {
    Eigen::Index axis = 0;
    middles.sizes().maxCoeff(&axis);
    const std::size_t middle = begin + (end - begin) / 2;
    const auto at = [&](std::size_t i) {
      return numbers_.begin() + static_cast<std::ptrdiff_t>(i);
    };
    std::nth_element(at(begin), at(middle), at(end), [&](std::uint32_t a, std::uint32_t b) {
      return std::pair(middles_[a][axis], a) < std::pair(middles_[b][axis], b);
    });
    return middle;
  }

  // Where the sum of area times number of boxes is least; `begin` if there is nothing to cut.
  std::size_t best_border(std::size_t begin, std::size_t end, const Box& middles) {
    float least = std::numeric_limits<float>::infinity();
    Eigen::Index axis = -1;
    int border = 0;
    for (Eigen::Index k = 0; k < 3; ++k) {
      if (!(middles.sizes()[k] > 0.0F)) continue;
      const auto [cost, bin] = best_bin(begin, end, middles, k);
      if (cost >= least) continue;
      least = cost;
      axis = k;
      border = bin;
    }
    if (axis < 0) return begin;
    const auto from = numbers_.begin() + static_cast<std::ptrdiff_t>(begin);
    const auto to = numbers_.begin() + static_cast<std::ptrdiff_t>(end);
    const auto cut = std::partition(
        from, to, [&](std::uint32_t i) { return bin_of(i, middles, axis) < border; });
    return begin + static_cast<std::size_t>(cut - from);
  }

  [[nodiscard]] int bin_of(std::uint32_t i, const Box& middles, Eigen::Index axis) const {
    const float share = (middles_[i][axis] - middles.min()[axis]) / middles.sizes()[axis];
    return std::clamp(static_cast<int>(share * kBins), 0, kBins - 1);
  }

  // Least cost and the first bin of the upper part.
  [[nodiscard]] std::pair<float, int> best_bin(std::size_t begin, std::size_t end,
                                               const Box& middles, Eigen::Index axis) const {
    std::array<Box, kBins> bins;
    std::array<int, kBins> counts{};
    for (std::size_t i = begin; i < end; ++i) {
      const auto bin = static_cast<std::size_t>(bin_of(numbers_[i], middles, axis));
      bins[bin].extend(boxes_[numbers_[i]]);
      ++counts[bin];
    }
    std::array<float, kBins> above{};
    Box box;
    int count = 0;
    for (std::size_t i = kBins - 1; i > 0; --i) {
      box.extend(bins[i]);
      count += counts[i];
      above[i] = half_area(box) * static_cast<float>(count);
    }
    std::pair<float, int> best(std::numeric_limits<float>::infinity(), 0);
    box.setEmpty();
    count = 0;
    for (std::size_t i = 1; i < kBins; ++i) {
      box.extend(bins[i - 1]);
      count += counts[i - 1];
      const float cost = half_area(box) * static_cast<float>(count) + above[i];
      if (cost < best.first) best = {cost, static_cast<int>(i)};
    }
    return best;
  }

  std::span<const Box> boxes_;
  std::vector<std::uint32_t> numbers_;
  std::vector<Eigen::Vector3f> middles_;
  std::vector<Part> parts_;
};

// Which parts become the children of which nodes. Of all ways to join the halves to nodes of eight
// it is the one whose areas have the least sum. After Ylitie, Karras, Laine, Efficient incoherent
// ray traversal on GPUs through compressed wide BVHs (2017), section 3.1.
class Joined {
 public:
  explicit Joined(const Halves& halves) : halves_(halves), ways_(halves.size()) {
    for (std::size_t i = ways_.size(); i-- > 0;)  // parts after those that they are part of
      weigh(static_cast<std::uint32_t>(i));
  }

  // The children of the node that a part becomes.
  [[nodiscard]] std::vector<std::uint32_t> children(std::uint32_t part) const {
    std::vector<std::uint32_t> found;
    if (halves_.part(part).leaf) {
      found.push_back(part);
    } else {
      split(part, kLanes, found);
    }
    return found;
  }

 private:
  // By the number of slots that a part may take, less one: its cost, and how many of them its first
  // half gets. 0: it takes one, as a node.
  struct Ways {
    std::array<float, kLanes> cost;
    std::array<std::uint8_t, kLanes> first;
  };

  void weigh(std::uint32_t number) {
    const Halves::Part& part = halves_.part(number);
    Ways& ways = ways_[number];
    ways.first.fill(0);
    const float area = half_area(part.box);
    if (part.leaf) {
      ways.cost.fill(kLeafCost * area);
      return;
    }
    for (std::size_t slots = kLanes; slots > 1; --slots) {
      ways.cost[slots - 1] = std::numeric_limits<float>::infinity();
      for (std::size_t first = 1; first < slots; ++first) {
        const float cost =
            ways_[part.first].cost[first - 1] + ways_[part.first + 1].cost[slots - first - 1];
        if (cost >= ways.cost[slots - 1]) continue;
        ways.cost[slots - 1] = cost;
        ways.first[slots - 1] = static_cast<std::uint8_t>(first);
      }
    }
    ways.cost[0] = area + ways.cost[kLanes - 1];
    for (std::size_t slots = 1; slots < kLanes; ++slots) {
      if (ways.cost[slots] < ways.cost[0]) continue;
      if (slots == kLanes - 1) break;  // what makes the node itself
      ways.cost[slots] = ways.cost[0];
      ways.first[slots] = 0;
    }
  }

  void split(std::uint32_t part, std::size_t slots, std::vector<std::uint32_t>& found) const {
    const std::size_t first = ways_[part].first[slots - 1];
    if (first == 0) {
      found.push_back(part);
      return;
    }
    split(halves_.part(part).first, first, found);
    split(halves_.part(part).first + 1, slots - first, found);
  }

  const Halves& halves_;
  std::vector<Ways> ways_;
};

}  // namespace

BoxTree::BoxTree(std::span<const Box> boxes) {
  if (boxes.empty()) return;
  const Halves halves(boxes);
  const Joined joined(halves);
  struct Open {
    std::uint32_t part;
    std::uint32_t node;
    std::size_t level;
  };
  nodes_.emplace_back();
  std::vector<Open> open = {{0, 0, 1}};
  while (!open.empty()) {
    const Open now = open.back();
    open.pop_back();
    UNDERSTORY_CHECK(now.level <= kDeepest);
    const std::vector<std::uint32_t> parts = joined.children(now.part);
    nodes_[now.node].child.fill(kFree);
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const Halves::Part& part = halves.part(parts[i]);
      if (part.leaf) {
        nodes_[now.node].child[i] = kLeaf | static_cast<std::uint32_t>(order_.size());
        order_.push_back(part.first);
      } else {
        const auto node = static_cast<std::uint32_t>(nodes_.size());
        nodes_[now.node].child[i] = node;
        nodes_.emplace_back();
        open.push_back({parts[i], node, now.level + 1});
      }
    }
  }
  refit(boxes);
}

void BoxTree::refit(std::span<const Box> boxes) {
  if (nodes_.empty()) return;
  UNDERSTORY_CHECK(boxes.size() == order_.size());
  box_.setEmpty();
  for (const Box& box : boxes)
    box_.extend(box);
  if (box_.isEmpty()) box_ = Box(Eigen::Vector3f::Zero());
  constexpr float kLeast = 1e-6F;  // metres: a step must not vanish
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    const float step = std::max(box_.sizes()[a], kLeast) / kSteps;
    frame_.step[axis] = frame_.step[axis + 4] = step;
    frame_.base[axis] = frame_.base[axis + 4] = box_.min()[a] - step;
  }
  std::vector<Box> around(nodes_.size());
  for (std::size_t i = nodes_.size(); i-- > 0;) {
    Node& node = nodes_[i];
    for (std::size_t k = 0; k < kLanes; ++k) {
      const std::uint32_t child = node.child[k];
      const Box box = child == kFree         ? Box()
                      : (child & kLeaf) != 0 ? boxes[order_[child & ~kLeaf]]
                                             : around[child];
      around[i].extend(box);
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<std::size_t>(axis);
        const float low = (box.min()[axis] - frame_.base[a]) / frame_.step[a];
        const float high = (box.max()[axis] - frame_.base[a]) / frame_.step[a];
        const bool none = box.isEmpty();
        node.planes[a][k] = none ? 65535 : static_cast<std::uint16_t>(std::floor(low - kSlack));
        node.planes[a + 3][k] = none ? 0 : static_cast<std::uint16_t>(std::ceil(high + kSlack));
      }
    }
  }
}

std::array<Box, kLanes> BoxTree::first_boxes() const {
  std::array<Box, kLanes> boxes;
  if (nodes_.empty()) return boxes;
  const Node& root = nodes_.front();
  for (std::size_t k = 0; k < kLanes; ++k) {
    if (root.child[k] == kFree) continue;
    Eigen::Vector3f low;
    Eigen::Vector3f high;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<std::size_t>(axis);
      low[axis] = frame_.base[a] + frame_.step[a] * root.planes[a][k];
      high[axis] = frame_.base[a] + frame_.step[a] * root.planes[a + 3][k];
    }
    boxes[k] = Box(low, high);
  }
  return boxes;
}

}  // namespace understory
