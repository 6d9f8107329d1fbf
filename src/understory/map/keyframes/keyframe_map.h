#pragma once

#include <cstdint>
#include <filesystem>
#include <future>
#include <memory>
#include <optional>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/map/keyframes/first_keyframes.h"
#include "understory/map/keyframes/keyframe.h"
#include "understory/map/keyframes/keyframe_history.h"
#include "understory/map/keyframes/keyframe_points.h"
#include "understory/map/keyframes/returning_keyframes.h"
#include "understory/map/local_map.h"
#include "understory/map/loop_closer.h"
#include "understory/map/map_constants.h"
#include "understory/map/range_check.h"
#include "understory/util/config/config.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"
#include "understory/util/time.h"
#include "understory/util/timing.h"

namespace understory {

// When a scan becomes a keyframe, and how its points are thinned.
struct KeyframeConfig {
  // P4 (37): a scan becomes a keyframe when |theta * (X_L^-1 X_k)| reaches `distance_m`, where
  // theta weighs a rotation of `rotation_as_metre_deg` like one metre. In the paper 0.2 m and 20.
  double distance_m = 0.5;
  double rotation_as_metre_deg = 30.0;
  // Edge of the voxels that thin a keyframe's points. Finer than a scan is thinned to be matched:
  // the local map's cells have to tell a stem's near side from its flanks. 0: all points, as in the
  // paper.
  double voxel_size_m = 0.1;
  // A scan becomes a keyframe, too, when it finds less than this share of what scans usually find
  // again in the map. It sees what the rings of the others left out. 0: never.
  double below_found_share = 0.0;
  // The same where a match's fitness (RegistrationResult::fitness_m2) exceeds this. 0: never.
  double above_fitness_m2 = 0.0;
  // But none becomes a keyframe whose match has a larger fitness than this, P2 section 2.3. 0: all
  // may.
  double max_fitness_m2 = 0.0;
};
void describe(ConfigTable& table, KeyframeConfig& config);

// A scan that was matched to the local map, as it is offered to become a keyframe.
struct KeyframeOffer {
  Pose world_from_body;
  // Of the pose in the local map, right perturbation, rotation first: large in the directions that
  // the match left open.
  Matrix6d covariance = Matrix6d::Zero();
  double found_share = 1.0;  // of what scans usually find again in the map
  double fitness_m2 = 0.0;   // of its match, mean squared distance
  // Satellites hold its place in the world: it may come back into the map, ReturningKeyframes.
  bool held = false;
};

// Weighted distance between two poses, P4 (37) with the right difference (Errata), metres.
[[nodiscard]] double keyframe_distance(const Pose& world_from_last, const Pose& world_from_current,
                                       const KeyframeConfig& config);

// The second graph of P4 F2: keyframes, and the local map made of them. Scans are positioned in the
// world frame of these keyframes. When a loop closure moves them, `add` says by how much the
// present part of the world moved. Not thread-safe.
class KeyframeMap {
 public:
  struct Config {
    KeyframeConfig keyframe;
    LocalMapConfig local_map;
    LoopCloserConfig loop_closure;
    FirstKeyframesConfig first_keyframes;
    RangeCheckConfig range_check;
    // Noise of the odometry between keyframes: that of any edge (P4: that of a match, (36)), and
    // what grows with the square root of the distance.
    double edge_rotation_deg = 0.0;
    double edge_translation_m = 0.0;
    double edge_rotation_deg_per_sqrt_m = 0.02;
    double edge_translation_m_per_sqrt_m = 0.01;
    // By the limit of the memory of the run, no settings of their own. They say which keyframes'
    // points stay in memory. They also say whether the local map of a found loop is made only when
    // the present one is gone.
    std::size_t cached_keyframes = map_constants::keyframe_map::kCachedKeyframes;
    bool one_local_map = false;
  };
  static void describe(ConfigTable& table, Config& config);

  // Files go to `folder`; a resumed run calls `load` next, which keeps them, any other `start`.
  KeyframeMap(const Config& config, const std::filesystem::path& folder, StageTimes& times,
              Log& log);
  // Begins with an empty map.
  void start();

  // Whether a scan is to become a keyframe, P4 (37), P2 section 2.3; true for the first.
  [[nodiscard]] bool wants(const KeyframeOffer& offer) const;
  // Adds a keyframe and updates the local map. Its edge to the last keyframe has the noise of the
  // odometry on the way and that of its pose. Returns the motion of the world, if it moved, that
  // has been applied to the new keyframe as well.
  [[nodiscard]] std::optional<Pose> add(TimeNs stamp, const KeyframeOffer& offer,
                                        const FeaturePoints& points_in_body);
  // Begins anew after the scans could not be matched any more. The next keyframe is joined to the
  // last one by a prediction only, and the local map starts empty.
  void start_segment();
  // Ends the recording: waits for what is running, optimises, positions the first keyframes of each
  // segment again, and frees what only scans needed. There is no local map any more. Polls
  // `progress`.
  void finish(const ProgressSink& progress = {});
  // Of the finished map: whether its clouds tell of ranges that are all too long or too short.
  //   lidar_in_body: where the beams begin, metres
  // Polls `progress`.
  [[nodiscard]] RangeCheck check_ranges(const Eigen::Vector3d& lidar_in_body,
                                        const ProgressSink& progress = {}) const;
  // Of the finished map: its graph at its poses, and which of the graph's loops it accepted.
  [[nodiscard]] PoseGraphProblem graph() const {
    return loops_.problem_of(keyframes_, segment_starts_);
  }
  [[nodiscard]] std::vector<char> graph_loops_used() const;
  // Of the finished map: new poses of all keyframes.
  void set_poses(const std::vector<Pose>& world_from_keyframe);
  // Levels the piece that is being mapped: `turn` is a rotation about the origin of the world. The
  // first piece turns about it. A later one turns about its first keyframe, or without any about
  // the body. The pieces before stay where they are, as they were levelled themselves.
  // `world_from_body`: of the body, turned already. Gives what moves the present after that turn,
  // if anything does.
  // A running search is waited for, and what it found moves the present, too.
  [[nodiscard]] std::optional<Pose> level(const Pose& turn, const Pose& world_from_body);

  // Null while it is empty.
  [[nodiscard]] const MatchTargetPtr& local_map() const { return snapshot_; }
  // Of the local map, metres; smaller than `local_map.radius_m` where that takes too much memory.
  [[nodiscard]] double local_map_radius_m() const { return local_map_.radius_m(); }
  // Frees what can be read again from the disk. No result depends on it.
  void free_cache() { points_->forget(); }
  [[nodiscard]] const std::vector<Keyframe>& keyframes() const { return keyframes_; }
  [[nodiscard]] const std::vector<LoopAttempt>& loops() const { return loops_.attempts(); }
  // The pieces of the map, and which are together by the loops found so far.
  [[nodiscard]] MapPieces pieces() const;
  // Of the finished map: which are together by the loops that the graph accepts.
  [[nodiscard]] MapPieces finished_pieces() const;
  // Which of the verified loops the graph accepts; of the size of loops().
  [[nodiscard]] const std::vector<char>& loops_used() const { return loops_used_; }
  // CPU time of the searches for loops, which run beside the scan loop.
  [[nodiscard]] double search_cpu_seconds() const { return loops_.search_cpu_seconds(); }
  // --realtime: outcomes are taken over as soon as they are there.
  void take_loops_when_found() { takes_loops_when_found_ = true; }
  // Waits until what has been added so far is on the disk.
  void sync();
  // The files in the folder that `save` counts on, as far as it does.
  [[nodiscard]] std::vector<CountedFile> files() const;
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  void refine_first_keyframes_of_segments(const ProgressSink& progress);
  [[nodiscard]] std::size_t segment_start() const { return segment_starts_.back(); }
  [[nodiscard]] std::size_t local_map_start() const;
  void update_local_map(std::size_t keyframe);
  void insert(std::size_t keyframe);
  void insert(std::size_t keyframe, bool forget);
  void give_back();
  void take_local_map(LoopOutcome& outcome);
  void tell_of_radius();
  void take_snapshot();
  void level_from(std::size_t first, const Pose& new_world_from_old_world);
  void rebuild_local_map();
  [[nodiscard]] Matrix6d edge_covariance(const Pose& previous_from_this) const;
  [[nodiscard]] std::optional<Pose> close_in_present();
  void tell_of_joined_pieces();
  [[nodiscard]] std::optional<Pose> take_over(LoopOutcome outcome);
  void insert_all();

  Config config_;
  std::filesystem::path folder_;
  StageTimes& times_;
  Log& log_;
  std::unique_ptr<KeyframePoints> points_;
  std::unique_ptr<KeyframeHistory> history_;
  std::size_t joined_ = 0;  // pieces of which it was said that they are joined to others
  bool moved_ = false;      // poses that are in the history already
  std::vector<Keyframe> keyframes_;
  std::vector<std::uint64_t> segment_starts_ = {0};  // first keyframe of each segment
  LocalMap local_map_;
  std::vector<LocalMapInsertion>
      inserted_;  // since the local map was empty, in order: builds it again
  ReturningKeyframes returning_;
  MatchTargetPtr snapshot_;
  bool takes_loops_when_found_ = false;
  bool told_of_radius_ = false;
  std::vector<char> loops_used_;
  LoopCloser loops_;
  // What give_back() has begun.
  std::future<void> giving_back_;
};

}  // namespace understory
