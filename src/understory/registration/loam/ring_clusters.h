#pragma once

#include <cstdint>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/util/config/config.h"

namespace understory {

// Which objects of a scan are large enough to be matched again (Shan and Englot, LeGO-LOAM, 2018,
// section III.B). A leaf or a blade of grass is not seen in the next scan.
struct RingClustersConfig {
  int min_points = 30;  // of a cluster; 0: all points count
  // Two neighbours lie on one surface if it is seen at a larger angle. LeGO-LOAM has 60 degrees. At
  // 10 m two columns are 3.5 cm apart, and a range noise of 2 cm parts them at that.
  double angle_deg = 10.0;
};
void describe(ConfigTable& table, RingClustersConfig& config);

// Points of one revolution by ring and by azimuth.
class RangeImage {
 public:
  static constexpr std::uint32_t kNoPoint = UINT32_MAX;

  // `ring`: that of each point, in parallel. Points in metres from the lidar.
  RangeImage(const Points& points, const std::vector<std::uint16_t>& ring);
  [[nodiscard]] std::size_t rings() const { return rings_; }
  [[nodiscard]] std::size_t columns() const;
  // The point of a cell, ring * columns() + column: the one measured last. kNoPoint where none was
  // measured.
  [[nodiscard]] std::uint32_t at(std::size_t cell) const { return point_[cell]; }
  // The next lower, and the next higher ring with points; where there is none, the first, and the
  // last.
  [[nodiscard]] std::size_t ring_below(std::size_t ring) const { return below_[ring]; }
  [[nodiscard]] std::size_t ring_above(std::size_t ring) const { return above_[ring]; }
  // The cell of a point.
  [[nodiscard]] std::size_t cell_of(std::size_t point) const { return cell_[point]; }

 private:
  std::size_t rings_ = 0;
  std::vector<std::size_t> cell_;     // by point
  std::vector<std::uint32_t> point_;  // by cell
  std::vector<std::size_t> below_;
  std::vector<std::size_t> above_;
};

// 1 for each point that belongs to a cluster which counts. Neighbours are next to each other along
// a ring, or at one azimuth from a ring to the next one with points. They belong to one cluster if
// the line between them is seen at more than `angle_deg` (Bogoslavskyi and Stachniss, 2016). A
// cluster counts with `min_points` points, or with fewer if it stands upright over several rings,
// as a far stem does. Points with `left_out` belong to no cluster.
[[nodiscard]] std::vector<char> clustered_points(const Points& points, const RangeImage& image,
                                                 const std::vector<char>& left_out,
                                                 const RingClustersConfig& config);

}  // namespace understory
