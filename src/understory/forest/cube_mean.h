#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace understory {

// The mean of the points in a small cube. Sums are whole numbers (4,096ths of the cube's edge), so
// that the order of points, and of parts that are added up, changes nothing.
class CubeMean {
 public:
  CubeMean() = default;
  // One point; `in_cubes`: its coordinates over the edge of a cube.
  explicit CubeMean(const Eigen::Array3d& in_cubes) : returns_(1) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double value = in_cubes[static_cast<Eigen::Index>(axis)];
      const double part = value - std::floor(value);
      sums_[axis] = std::min(kParts - 1, static_cast<std::uint32_t>(kParts * part));
    }
  }

  // Another part of the same cube.
  void add(const CubeMean& other) {
    const std::uint64_t all = std::uint64_t{returns_} + other.returns_;
    if (all <= kMostSummed) {
      for (std::size_t axis = 0; axis < 3; ++axis)
        sums_[axis] += other.sums_[axis];
    } else {  // a million points at one place: sums would overflow
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double mean = (part_of(axis) * returns_ + other.part_of(axis) * other.returns_) /
                            static_cast<double>(all);
        sums_[axis] = static_cast<std::uint32_t>(std::lround(mean * kMostSummed));
      }
    }
    returns_ = static_cast<std::uint32_t>(std::min<std::uint64_t>(all, 0xffffffffU));
  }

  [[nodiscard]] std::uint32_t returns() const { return returns_; }
  // Of the cube with this number along an axis, over its edge.
  [[nodiscard]] double in_cubes(std::size_t axis, std::int64_t number) const {
    return static_cast<double>(number) + (part_of(axis) + 0.5) / kParts;
  }

 private:
  static constexpr std::uint32_t kParts = 4096;
  static constexpr std::uint32_t kMostSummed = (1U << 20) - 1;

  [[nodiscard]] double part_of(std::size_t axis) const {
    return static_cast<double>(sums_[axis]) / std::min(std::max(returns_, 1U), kMostSummed);
  }

  std::array<std::uint32_t, 3> sums_{};
  std::uint32_t returns_ = 0;
};

}  // namespace understory
