#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/simulation/sensors/head_log.h"
#include "understory/simulation/sensors/scanner.h"
#include "understory/simulation/sensors/total_station.h"
#include "understory/simulation/world.h"
#include "understory/util/files/scratch_file.h"
#include "understory/util/time.h"

namespace understory {

// The truth about one scan.
struct ScanTruth {
  TimeNs stamp = 0;
  Pose world_from_body;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  // world
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();
};

// What a recording's truth has come to, scan by scan. The returns of stems go to a temporary file
// in blocks, so a long run takes no memory for them. Where no such file can be made or written they
// stay in memory. Not thread-safe.
class TruthLog {
 public:
  void add(const ScanTruth& scan, const std::vector<StemReturns>& stems);
  // A scan of the second lidar, of which only the pose is known.
  void add_pose(const ScanTruth& scan) { further_.push_back(scan); }
  [[nodiscard]] const std::vector<ScanTruth>& scans() const { return scans_; }
  // Of the scans of all lidars, in order of time.
  [[nodiscard]] std::vector<ScanTruth> poses() const;
  // Returns of stems in the i-th scan.
  [[nodiscard]] std::vector<StemReturns> stems(std::size_t i) const;
  // That the returns of stems take.
  [[nodiscard]] std::size_t bytes_in_memory() const;

 private:
  struct Packed {
    std::int32_t tree;
    std::uint16_t rings;
    std::uint16_t rings_with_3;
    std::uint32_t returns;
  };
  struct Block {
    std::vector<Packed> stems;  // empty once they are in the file
    ScratchFile::Part part;
  };
  static constexpr std::size_t kBlock = 1 << 16;
  void put_away(Block& block);
  [[nodiscard]] const std::vector<Packed>& read(std::size_t block) const;

  std::vector<ScanTruth> scans_;
  std::vector<ScanTruth> further_;  // of the second lidar
  // Of all scans, one after another. A small vector a scan, kept among large ones that come and go,
  // made the heap of a long run grow by 60 kB a scan.
  std::vector<Block> blocks_;
  std::optional<ScratchFile> scratch_;  // from the first full block on
  mutable std::size_t read_ = 0;        // block that was read last, if any was
  mutable std::vector<Packed> read_stems_;
  std::vector<std::size_t> stems_end_;  // of each scan
};

// Whether a file of the truth folder bears this name.
[[nodiscard]] bool is_truth_file(const std::string& name);

// Writes the truth folder (docs/method/simulation.md); what the total station and the harvester's
// head measured only where they did. Throws OutputError.
void write_truth_folder(const std::string& folder, const SimulatedWorld& world, TimeNs start,
                        const TruthLog& log, const std::vector<PrismSample>& prism,
                        const std::vector<HeadCutSample>& cuts);

}  // namespace understory
