#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/map/keyframe_clouds.h"
#include "understory/map/local_map.h"
#include "understory/util/binary_io.h"
#include "understory/util/config.h"
#include "understory/util/time.h"

namespace understory {

struct KeyframeConfig {
  // P4 (37): a scan becomes a keyframe when |theta * (X_L^-1 X_k)| reaches `distance_m`, where
  // theta weighs a rotation of `rotation_as_metre_deg` like one metre. In the paper 0.2 m and 20.
  double distance_m = 1.0;
  double rotation_as_metre_deg = 30.0;
};
void describe(ConfigTable& table, KeyframeConfig& config);

// Weighted distance between two poses, P4 (37) with the right difference (Errata), metres.
[[nodiscard]] double keyframe_distance(const Pose& world_from_last, const Pose& world_from_current,
                                       const KeyframeConfig& config);

struct Keyframe {
  TimeNs stamp = 0;
  Pose world_from_body;     // best estimate so far
  Pose previous_from_this;  // as the odometry measured it; identity for the first
  Matrix6d covariance = Matrix6d::Zero();  // of previous_from_this, right perturbation
};

// The thinned clouds of all keyframes: on disk, the last used ones in memory. Not thread-safe.
class KeyframePoints {
 public:
  KeyframePoints(const std::filesystem::path& file, std::size_t keep, std::size_t cached);
  void append(TimeNs stamp, const Points& points);
  void flush() { clouds_.flush(); }
  [[nodiscard]] std::shared_ptr<const Points> get(std::size_t keyframe);

 private:
  struct Entry {
    std::shared_ptr<const Points> points;
    std::uint64_t used = 0;
  };
  void remember(std::size_t keyframe, std::shared_ptr<const Points> points);

  KeyframeClouds clouds_;
  std::size_t cached_;
  std::uint64_t uses_ = 0;
  std::unordered_map<std::size_t, Entry> cache_;
};

}  // namespace understory
