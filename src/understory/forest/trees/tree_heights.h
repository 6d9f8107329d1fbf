#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "understory/forest/ground/height_column.h"
#include "understory/forest/stems/stem_detector.h"

namespace understory {

// Place of a stem at a height; the lean near the ground is not carried far up, trees straighten.
[[nodiscard]] Eigen::Vector2d stem_place_at(const StemFit& stem, double height_m);

// What a cloud holds around each stem, nearer to it than to any other, by metres above the ground.
class TreeColumns {
 public:
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);

  // `stems` outlive this; their frame is that of `add`. `ground_m`: height of the ground at each.
  TreeColumns(const std::vector<StemFit>& stems, std::vector<double> ground_m);
  // A point `height_m` >= 0 above the ground below it. Its height counts from the ground at the
  // stem: on a slope, a crown reaches out over ground that lies lower. Returns the number of the
  // stem that the point counts for, kNone if it is near none.
  std::size_t add(const Eigen::Vector3d& point, double height_m);

  // Height of a tree's top above the ground. The top is the highest point that hangs together with
  // its stem, with gaps of at most 3 m. It is nearer to its stem than to any other. Ghosts of other
  // pulses are left aside (see HeightColumn). NaN where nothing is seen above the stem's slices.
  // NaN also where the points end as if cut off just above them: that is no tree top. With
  // `low_tops` the cloud is known to show all heights. A thin tree may then end lower, where the
  // points end that hang together with its stem. Their gaps are of half a metre at most.
  // The crown of a thicker neighbour may reach over the tree. Then its top is where the points
  // near its own axis end.
  [[nodiscard]] double top(std::size_t stem, double slices_end_m, bool low_tops = false) const;
  // The same, with what reaches over the tree.
  [[nodiscard]] double top_with_neighbours(std::size_t stem, double slices_end_m,
                                           bool low_tops = false) const;
  [[nodiscard]] double ground_m(std::size_t stem) const { return ground_m_[stem]; }
  // Points in so many decimetres below a height; of each decimetre 255 stand for more.
  [[nodiscard]] int points_below(std::size_t stem, double height_m, int decimetres) const;
  // Points in so many decimetres above the one that holds a height, likewise. Of a tree that a
  // neighbour reaches over, only those near its axis count.
  [[nodiscard]] int points_above(std::size_t stem, double height_m, int decimetres,
                                 bool overtopped = false) const;

 private:
  // Points of each decimetre above the ground.
  using Counts = std::array<std::uint8_t, 10 * HeightColumn::kMetres>;
  struct Column : HeightColumn {
    std::array<float, kMetres> highest_m{};  // within each metre
    Counts decimetres{};                     // points of each
    Counts core{};                           // those near the axis
  };
  [[nodiscard]] double high_top(std::size_t stem, double slices_end_m) const;
  [[nodiscard]] double low_top(std::size_t stem) const;
  // Height at which the points near the axis end, from the slices up.
  [[nodiscard]] double core_end(std::size_t stem, double slices_end_m) const;
  [[nodiscard]] bool has_thicker_neighbour(std::size_t stem) const;
  // Points of the decimetres [begin, end).
  [[nodiscard]] static int points_within(const Counts& counts, int begin, int end);

  const std::vector<StemFit>& stems_;
  std::vector<double> ground_m_;
  // Stems by the squares that they or their reach come to at any height.
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> near_;
  std::vector<Column> columns_;
};

}  // namespace understory
