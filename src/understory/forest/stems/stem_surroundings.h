#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "understory/forest/cube_mean.h"
#include "understory/forest/stems/stem_detector.h"

namespace understory {

// Gathers the points around each stem from the ground to the top, one per small cube (their mean,
// with the number of returns). A point near two stems belongs to the surroundings of both. The
// order of points changes nothing.
class StemSurroundings {
 public:
  // `ground_m`: height of the ground at each stem, in the frame of `add`. `stems` outlive this.
  StemSurroundings(const std::vector<StemFit>& stems, std::vector<double> ground_m);
  // A point in the frame of the stems: metres, z up, within 20 km of its origin.
  void add(const Eigen::Vector3d& point);
  // For each stem its points by height above the ground at the stem; empties this.
  [[nodiscard]] std::vector<std::vector<SlicePoint>> take();

 private:
  struct Entry {
    std::uint64_t cube = 0;  // of one stem
    std::uint32_t stem = 0;
    CubeMean mean;
  };
  void compact();

  const std::vector<StemFit>& stems_;
  std::vector<double> ground_m_;
  // Stems by the squares that their surroundings come to at any height.
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> near_;
  std::vector<Entry> entries_;
  std::size_t limit_;
};

}  // namespace understory
