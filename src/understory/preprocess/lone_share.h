#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace understory {

// Which share of the returns around one stands alone, far enough away. Weather comes in patches:
// where a laser is too cold, where beams look into the sun, or where snow falls off a branch. Many
// of a beam's neighbours there see something that stands alone. Immutable, thread-safe.
class LoneShare {
 public:
  // One entry a return, the same number in each: its ring, its time within the scan, its range in
  // metres, and 1 where it stands alone. Any order. They must outlive it.
  LoneShare(const std::vector<std::uint16_t>& ring, const std::vector<std::uint32_t>& t_ns,
            const std::vector<float>& range, const std::vector<std::uint8_t>& alone);

  // Share of the returns around return `i` that stand alone, 0..1. Itself does not count. Of those
  // alone only the ones count that are not much nearer: one power of two below its own at least. A
  // flake close by says nothing about what is far behind it. Around are its ring and two on either
  // side. In time it is 10 columns of 180 before and after: 20 degrees of a revolution.
  [[nodiscard]] double around(std::size_t i) const;

 private:
  static constexpr int kColumns = 180;  // of a scan in time
  static constexpr int kOctaves = 9;    // of range; the first is up to 0.9 m
  struct Cell {
    std::uint32_t all = 0;
    std::uint32_t alone[kOctaves] = {};  // at least as far as the octave
  };
  [[nodiscard]] int row_of(std::size_t i) const { return row_of_ring_[ring_[i]]; }
  [[nodiscard]] int column_of(std::size_t i) const;
  [[nodiscard]] int octave_of(std::size_t i) const;

  std::span<const std::uint16_t> ring_;
  std::span<const std::uint32_t> t_ns_;
  std::span<const float> range_;
  std::span<const std::uint8_t> alone_;
  std::uint32_t first_ns_ = 0;
  float columns_a_ns_ = 0.0F;
  std::vector<std::uint16_t> ring_of_row_;  // those that occur, increasing
  std::vector<std::uint16_t> row_of_ring_;
  std::vector<Cell> before_;  // kColumns + 1 a row: sums over the columns before
};

}  // namespace understory
