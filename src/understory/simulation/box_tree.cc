#include "understory/simulation/box_tree.h"

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

// Eight parts below a part: the largest is cut in two until there are as many.
std::vector<std::uint32_t> open_part(const Halves& halves, std::uint32_t part) {
  std::vector<std::uint32_t> children = {part};
  while (children.size() < kLanes) {
    std::size_t largest = children.size();
    float area = -1.0F;
    for (std::size_t i = 0; i < children.size(); ++i) {
      const Halves::Part& child = halves.part(children[i]);
      if (child.leaf || half_area(child.box) <= area) continue;
      area = half_area(child.box);
      largest = i;
    }
    if (largest == children.size()) break;
    const std::uint32_t first = halves.part(children[largest]).first;
    children[largest] = first;
    children.push_back(first + 1);
  }
  return children;
}

}  // namespace

BoxTree::BoxTree(std::span<const Box> boxes) {
  if (boxes.empty()) return;
  const Halves halves(boxes);
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
    const std::vector<std::uint32_t> parts = open_part(halves, now.part);
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
  frame_.step = box_.sizes().cwiseMax(kLeast) / kSteps;
  frame_.base = box_.min() - frame_.step;
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
        const float low = (box.min()[axis] - frame_.base[axis]) / frame_.step[axis];
        const float high = (box.max()[axis] - frame_.base[axis]) / frame_.step[axis];
        const bool none = box.isEmpty();
        node.planes[a][k] = none ? 65535 : static_cast<std::uint16_t>(std::floor(low - kSlack));
        node.planes[a + 3][k] = none ? 0 : static_cast<std::uint16_t>(std::ceil(high + kSlack));
      }
    }
  }
}

std::vector<Box> BoxTree::first_boxes() const {
  std::vector<Box> boxes;
  if (nodes_.empty()) return boxes;
  const Node& root = nodes_.front();
  for (std::size_t k = 0; k < kLanes; ++k) {
    if (root.child[k] == kFree) continue;
    Eigen::Vector3f low;
    Eigen::Vector3f high;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<std::size_t>(axis);
      low[axis] = frame_.base[axis] + frame_.step[axis] * root.planes[a][k];
      high[axis] = frame_.base[axis] + frame_.step[axis] * root.planes[a + 3][k];
    }
    boxes.emplace_back(low, high);
  }
  return boxes;
}

}  // namespace understory
