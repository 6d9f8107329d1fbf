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
#include "understory/util/log.h"
#include "understory/util/time.h"
#include "understory/util/timing.h"

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
  Pose world_from_body;                    // best estimate so far
  Pose previous_from_this;                 // as the odometry measured it; identity for the first
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

// The second graph of P4 F2: keyframes, and the local map made of them. Scans are positioned in the
// world frame of these keyframes; when a loop closure moves them, `add` says by how much the
// present part of the world moved. Not thread-safe.
class KeyframeMap {
 public:
  struct Config {
    KeyframeConfig keyframe;
    LocalMapConfig local_map;
    // Noise of the odometry between keyframes: grows with the square root of the distance.
    double edge_rotation_deg_per_sqrt_m = 0.02;
    double edge_translation_m_per_sqrt_m = 0.01;
  };
  static void describe(ConfigTable& table, Config& config);

  // Files go to `folder`; a resumed run calls `load` next, which keeps them, any other `start`.
  KeyframeMap(const Config& config, const std::filesystem::path& folder, StageTimes& times,
              Log& log);
  void start();

  // Whether a scan at this pose is to become a keyframe (37); true for the first.
  [[nodiscard]] bool wants(const Pose& world_from_body) const;
  // Adds a keyframe and updates the local map. Returns the motion of the world, if it moved, that
  // has been applied to the new keyframe as well.
  [[nodiscard]] std::optional<Pose> add(TimeNs stamp, const Pose& world_from_body,
                                        const Points& points_in_body);
  // Begins anew after the scans could not be matched any more: the next keyframe is joined to the
  // last one by a prediction only, and the local map starts empty.
  void start_segment();
  // Moves everything, e.g. to level the world.
  void move_world(const Pose& new_world_from_old_world);

  [[nodiscard]] const std::vector<NdtMapPtr>& local_map() const { return snapshot_; }
  [[nodiscard]] const std::vector<Keyframe>& keyframes() const { return keyframes_; }
  // Makes what has been added so far safe on disk.
  void flush();
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  // One keyframe that went into the local map; `forget` as in LocalMap::insert.
  struct Insertion {
    std::uint64_t keyframe = 0;
    std::uint64_t forget = 0;
  };
  void update_local_map(std::size_t keyframe);
  void rebuild_local_map();
  void insert_all();

  Config config_;
  std::filesystem::path folder_;
  StageTimes& times_;
  Log& log_;
  std::unique_ptr<KeyframePoints> points_;
  std::vector<Keyframe> keyframes_;
  std::size_t segment_start_ = 0;  // first keyframe of the present segment
  LocalMap local_map_;
  std::vector<Insertion> inserted_;  // since the local map was empty, in order: builds it again
  std::vector<NdtMapPtr> snapshot_;
};

}  // namespace understory
