#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "understory/sensor/scan.h"
#include "understory/util/config/config.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// Which returns near the lidar come from what carries it: a cabin, a boom, wheels, a walker's head.
struct CarriedReturnsConfig {
  double reach_m = 3.0;  // from the lidar; 0: none
  // A place beside the lidar is carried that had returns in this share of the scans, 0..1.
  double share = 0.8;
};
void describe(ConfigTable& table, CarriedReturnsConfig& config);

// Finds the returns that go along with the lidar. They say that it stands still, and to a scan with
// few other things near by they say so louder than the world does. The space around the lidar is
// divided into voxels of 0.2 m in its own frame. A voxel counts as carried if it has had returns
// from the first scan on, in nearly all of the last 30 scans. It does so until the lidar has moved
// and the place is empty. Level surfaces never count: ground looks the same from everywhere. One
// scan after another; not thread-safe.
class CarriedReturns {
 public:
  explicit CarriedReturns(const CarriedReturnsConfig& config);

  // Takes a scan into account (lidar frame, as measured). `up_in_lidar`: unit vector.
  void learn(const Scan& scan, const Eigen::Vector3d& up_in_lidar);
  // One entry a point of a scan: 1 if it is carried. Empty where none is, and where more than half
  // of the points would be: then what is near is the world, such as a tunnel. By the scans learnt.
  [[nodiscard]] std::vector<std::uint8_t> mark(const Scan& scan) const;

  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  // Sums are taken from the voxel's centre, in metres.
  struct Voxel {
    std::uint32_t last = 0;    // scan that hit it last, from 1; 0: none yet
    std::uint32_t judged = 0;  // scan at which `ground` was found; 0: never
    float share = 0.0F;        // of the scans up to `last`
    float n = 0.0F;            // points
    float sum[3] = {};         // x, y, z
    float products[6] = {};    // xx, xy, xz, yy, yz, zz
    std::uint16_t ground = 0;
    std::uint16_t carried = 0;
  };
  static constexpr std::uint32_t kOutside = UINT32_MAX;

  [[nodiscard]] std::uint32_t voxel_of(const ScanPoint& point) const;
  void add(const ScanPoint& point, std::uint32_t voxel);
  // Half of its sums: what was there before counts for less.
  static void halve_sums(Voxel& voxel);
  // Its share as of the scan before `scan`, if no scan has hit it since `last`.
  [[nodiscard]] float share_before(const Voxel& voxel, std::uint32_t scan) const;
  [[nodiscard]] bool is_above_others(std::uint32_t voxel, const Eigen::Vector3d& up) const;
  [[nodiscard]] Eigen::Vector3d centre_of(std::uint32_t voxel) const;  // from a corner
  [[nodiscard]] bool is_level(std::uint32_t voxel, const Eigen::Vector3d& up) const;

  CarriedReturnsConfig config_;
  int edge_ = 0;  // voxels along each side
  std::uint32_t scans_ = 0;
  std::vector<Voxel> voxels_;
  std::vector<std::uint32_t> hit_;      // workspace
  std::vector<std::uint32_t> staying_;  // workspace: those of the scan whose share suffices
};

}  // namespace understory
