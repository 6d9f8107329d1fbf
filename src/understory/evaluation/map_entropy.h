#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>

#include "understory/map/clouds/map_tiles.h"

namespace understory {

// Settings of the mean map entropy.
struct MapEntropyConfig {
  double radius_m = 0.3;  // neighbours of a point are nearer than this
  // Points without so many neighbours, themselves included, have no entropy [chosen].
  int fewest_neighbours = 10;
  // Standard deviation that is added to each axis, metres. The logarithm of a flat surface's
  // covariance stays finite, and steps of the file's coordinates do not count [chosen: 1 mm].
  double least_sd_m = 0.001;
  // One point (the first) is left in each cube of this edge, so that maps of other densities
  // compare; 0: all count.
  double thin_m = 0.0;
  double tile_m = 10.0;  // points are sorted into tiles on disk
};

// How crisp a cloud is, without a truth.
struct MapEntropy {
  std::uint64_t points = 0;
  std::uint64_t points_used = 0;   // that have neighbours enough
  double mean_entropy_nats = 0.0;  // NaN where no point has
  // Mean of the smallest eigenvalues: how thick surfaces are. NaN as above.
  double mean_plane_variance_m2 = 0.0;
};

// Mean map entropy (Droeschel and Behnke 2018): the mean over the points of
// 0.5 ln det(2 pi e S), with S the covariance of a point's neighbours. A blurred map has a larger
// one. Only maps of one place, scanned from one path, compare. Points are handed over one after
// another, in any frame with metres, and sorted into tiles in `folder`, which is removed at the
// end. Memory is that of a few tiles. Deterministic for any number of threads. Not thread-safe.
class MapEntropyMeter {
 public:
  MapEntropyMeter(const std::filesystem::path& folder, const MapEntropyConfig& config);
  // `point` relative to a place near the map, so that single precision is fine enough.
  void add(const Eigen::Vector3d& point);
  // Once, after all points.
  [[nodiscard]] MapEntropy measure();

 private:
  MapEntropyConfig config_;
  MapTiles tiles_;
};

}  // namespace understory
