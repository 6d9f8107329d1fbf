#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>

#include "understory/geometry/pose.h"
#include "understory/util/files/record_file.h"
#include "understory/util/time.h"

namespace understory {

// How a scan's pose came about.
enum class ScanOutcome : std::uint8_t {
  kMatched,    // a lidar match went into the state
  kGated,      // the match made the velocity jump and was dropped (P2-8)
  kUnmatched,  // no usable match; the prediction stands in
};

// What the run remembers of each scan. Pose and velocity are in the frame of the last keyframe
// before it, so that they stay true when keyframes are moved.
struct ScanRecord {
  TimeNs stamp = 0;
  std::int32_t keyframe = 0;  // the last keyframe before the scan; for the first scan its own
  std::uint8_t becomes_keyframe = 0;
  ScanOutcome outcome = ScanOutcome::kMatched;
  std::uint8_t degenerate_directions = 0;
  std::uint16_t iterations = 0;
  std::array<double, 4> rotation{0, 0, 0, 1};  // x y z w
  std::array<double, 3> translation{};
  std::array<double, 3> velocity{};
  std::array<double, 3> gyro_bias{};
  std::array<double, 3> accel_bias{};
  std::array<double, 21> covariance{};  // upper triangle, row by row, rotation first, body frame
  float fitness_m2 = 0.0F;
  float inlier_ratio = 0.0F;
  float wall_ms = 0.0F;
  float cpu_ms = 0.0F;       // of all threads, without what looks for loops beside the scan loop
  std::uint32_t points = 0;  // of the scan as read
  std::uint32_t matched_points = 0;  // after the voxel filter
  std::uint64_t map_size = 0;        // of the local map it was matched to: MatchTarget::size

  [[nodiscard]] Pose keyframe_from_body() const;
  void set_pose(const Pose& keyframe_from_body);
  [[nodiscard]] Matrix6d pose_covariance() const;
  void set_covariance(const Matrix6d& covariance);
};

// Append-only file of ScanRecords, so that memory does not grow with the length of a run.
class Journal {
 public:
  // Begins anew.
  explicit Journal(const std::filesystem::path& path);
  // Goes on behind the scans that are `known`. Throws InputError where they are not there.
  Journal(const std::filesystem::path& path, const RecordCount& known);
  void append(const ScanRecord& record);
  // Waits until all scans are on the disk.
  void sync() { file_.sync(); }
  [[nodiscard]] std::uint64_t size() const { return file_.count().records; }
  [[nodiscard]] const RecordCount& count() const { return file_.count(); }
  // Throws InputError at the first scan that is damaged.
  void for_each(const std::function<void(const ScanRecord&)>& visit) const;

 private:
  RecordFile file_;
};

}  // namespace understory
