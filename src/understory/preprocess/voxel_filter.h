#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "understory/preprocess/body_cloud.h"
#include "understory/util/config/config.h"

namespace understory {

// Which point stands for a voxel.
enum class VoxelPoint {
  kMean,           // mean of the points of the voxel, P4 section 3.1.1
  kNearestToMean,  // the measured point nearest to that mean
  kFirst,          // the first point that fell into the voxel
};

// A grid that leaves one point a voxel. Ranges are measured from the sensor.
struct VoxelFilterConfig {
  double voxel_size_m = 0.4;
  double range_min_m = 0.5;
  double range_max_m = 120.0;
  VoxelPoint point = VoxelPoint::kMean;
  int min_points = 1;  // voxels with fewer are left out
};
void describe(ConfigTable& table, VoxelFilterConfig& config);

// One point a voxel, in the order in which the voxels were first met. Keeps its hash table between
// calls, so that a call costs no allocation beyond its result. Not thread-safe: one per thread.
class VoxelFilter {
 public:
  // Ranges are measured from the lidar where the cloud has them. What is carried is left out unless
  // it is asked for.
  [[nodiscard]] BodyCloud filter(const BodyCloud& cloud, const VoxelFilterConfig& config,
                                 bool carried_too = false);
  // Each kind of feature by itself, edges first. Those of kNone and what is carried are left out,
  // or come with the others for a map.
  [[nodiscard]] BodyCloud filter_features(const BodyCloud& cloud, const VoxelFilterConfig& config,
                                          bool for_map);
  // Without range limits; points only. `keep` returns indices instead: the point of each voxel that
  // VoxelPoint names (kMean counts as kNearestToMean).
  [[nodiscard]] Points filter(const Points& points, double voxel_size_m);
  [[nodiscard]] std::vector<std::uint32_t> keep(const Points& points, double voxel_size_m,
                                                VoxelPoint point = VoxelPoint::kFirst);

 private:
  struct Voxel {
    float origin[3];  // the first point of the voxel
    float sum[3];     // from there
    float intensity;  // sum
    float range;      // sum
    float best;       // squared distance of the chosen point from the mean
    std::uint32_t count;
    std::uint32_t first;  // index of the first point
    std::uint32_t chosen;
  };
  struct Slot {
    std::uint64_t key;
    std::uint32_t epoch;
    std::uint32_t voxel;
  };
  static constexpr std::uint32_t kNone = 0xffffffffU;
  void start(std::size_t points);
  std::uint32_t find_or_add(std::uint64_t key, std::uint64_t hash, std::uint32_t index,
                            const Eigen::Vector3f& point);
  void grow();
  template <typename InRange, typename Note>
  void sort_into_voxels(const Points& points, double voxel_size_m, const InRange& in_range,
                        const Note& note);
  void choose_nearest_to_mean(const Points& points);

  std::vector<Slot> slots_;
  std::vector<Voxel> voxels_;
  std::vector<std::uint64_t> keys_;  // of the voxels
  std::vector<std::uint32_t> voxel_of_point_;
  std::uint32_t epoch_ = 0;
  std::uint64_t mask_ = 0;
};

// At most `limit` of the indices 0..n-1, spread evenly over them with a random phase per interval
// (stratified sampling), sorted. The same seed gives the same choice.
[[nodiscard]] std::vector<std::uint32_t> decimate(std::size_t n, std::size_t limit,
                                                  std::uint64_t seed);

}  // namespace understory
