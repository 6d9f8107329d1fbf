#pragma once

#include <atomic>
#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <vector>

#include "understory/graph/loops/loop_agreement.h"
#include "understory/graph/loops/loop_closure.h"
#include "understory/graph/loops/loop_search.h"
#include "understory/graph/pose_graph.h"
#include "understory/map/keyframes/keyframe.h"
#include "understory/map/keyframes/keyframe_points.h"
#include "understory/map/local_map.h"
#include "understory/map/loop_attempt.h"
#include "understory/map/map_pieces.h"
#include "understory/map/piece_search.h"
#include "understory/map/searched_map.h"
#include "understory/registration/matcher.h"
#include "understory/util/config/config.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"
#include "understory/util/timing.h"

namespace understory {

// Loop closure of the dense front end: search, verification and pose graph.
struct LoopCloserConfig {
  bool enabled = true;
  LoopSearchConfig search;
  LoopClosureConfig verification;
  PoseGraphConfig graph;
  PieceSearchConfig pieces;
  int submap_keyframes = 22;    // on each side of a candidate, that make the map it is matched to
  int source_keyframes = 4;     // on each side of the query, that are matched
  double voxel_size_m = 0.2;    // thins both
  int handover_keyframes = 30;  // results are taken over that many keyframes after the search began
  double min_correction_m = 0.03;  // smaller ones wait for the next
  double min_correction_deg = 0.1;
};
void describe(ConfigTable& table, LoopCloserConfig& config);

// What a finished search hands back.
struct LoopOutcome {
  std::size_t keyframes = 0;  // that were known when it began
  std::vector<LoopAttempt> attempts;
  std::vector<Pose> world_from_keyframe;  // of all those, if a loop was verified; else empty
  std::vector<char> decided;              // of the loops of the graph then; empty: as before
  std::optional<LocalMap> local_map;      // made of them around the last one, if it accumulates
  std::vector<LocalMapInsertion> inserted;
  // Where it is left to whoever takes the outcome over: the first keyframe that it may be made of.
  std::optional<std::size_t> map_begins_at;
};

// The map that scans are matched to at present, in the world frame, and the keyframes in it.
struct PresentMap {
  const MatchTarget& target;
  std::vector<std::size_t> keyframes;
};

// Looks for loops beside the scan loop, one search at a time in the background. A search begins at
// most every `search.interval_s` of recording. Its result is taken over at a keyframe that is fixed
// in advance, so that results do not depend on how fast the machine is. P2-7; P4 section 3.1.1 in
// its own way: close_in_present.
class LoopCloser {
 public:
  // `leave_map`: outcomes come without a local map, which would be one more beside the present one.
  LoopCloser(const LoopCloserConfig& config, const LocalMapConfig& local_map,
             bool leave_map = false);
  ~LoopCloser();
  LoopCloser(const LoopCloser&) = delete;
  LoopCloser& operator=(const LoopCloser&) = delete;

  // Begins a search for the newest keyframe if one is due and none is running. `points` must stay
  // alive until its outcome has been taken. `piece_starts`, here and below: the first keyframe of
  // each piece of the map. Loops are looked for among the pieces that are together with the newest
  // keyframe's, and its place anew in those that are not (map_pieces.h).
  void consider(const std::vector<Keyframe>& keyframes,
                const std::vector<std::uint64_t>& piece_starts, KeyframePoints& points);
  // `search.method` paper: all three steps of P4 (38) for the newest keyframe if they are due, at
  // once, so that there is never one running. `present` does without that keyframe. Nothing if not
  // due, or by another method.
  [[nodiscard]] std::optional<LoopOutcome> close_in_present(
      const std::vector<Keyframe>& keyframes, const std::vector<std::uint64_t>& piece_starts,
      KeyframePoints& points, const PresentMap& present);
  // The outcome of the running search, nothing if none is running or due. It is due at a fixed
  // number of keyframes, and then waited for; `wait`: due now; `when_found`: due when it is there.
  // Waiting polls `progress`.
  [[nodiscard]] std::optional<LoopOutcome> take(std::size_t keyframes, bool wait, bool when_found,
                                                const ProgressSink& progress = {});

  // Looks from all places of each piece that is still apart, while no search is running, and lays
  // pieces that are found together. Whether any were. Polls `progress`.
  [[nodiscard]] bool join_left(std::vector<Keyframe>& keyframes,
                               const std::vector<std::uint64_t>& piece_starts,
                               KeyframePoints& points, const ProgressSink& progress = {});

  [[nodiscard]] const std::vector<LoopAttempt>& attempts() const { return attempts_; }
  // CPU time of all searches so far, that which is running included.
  [[nodiscard]] double search_cpu_seconds() const { return work_.cpu_seconds(); }
  // Which pieces are together by the attempts so far.
  [[nodiscard]] MapPieces pieces_of(const std::vector<Keyframe>& keyframes,
                                    const std::vector<std::uint64_t>& piece_starts) const;
  // Which of the attempts are loops of the graph: verified, and within pieces that are together.
  [[nodiscard]] std::vector<char> counted(const MapPieces& pieces) const;
  // The graph of the keyframes, with those loops.
  [[nodiscard]] PoseGraphProblem problem_of(const std::vector<Keyframe>& keyframes,
                                            const std::vector<std::uint64_t>& piece_starts) const;
  // That graph optimised, with no regard to what was decided before; without any loop, no poses.
  [[nodiscard]] PoseGraphResult optimise(const std::vector<Keyframe>& keyframes,
                                         const std::vector<std::uint64_t>& piece_starts) const;

  // Without the attempts, which only grow.
  void save(BinaryWriter& writer) const;
  // Begins the search again that was running when the state was saved.
  void load(BinaryReader& reader, std::vector<LoopAttempt> attempts,
            const std::vector<Keyframe>& keyframes, const std::vector<std::uint64_t>& piece_starts,
            KeyframePoints& points);

 private:
  struct Running {
    std::uint64_t keyframes;  // known to it
    std::future<LoopOutcome> outcome;
  };
  void begin(const std::vector<Keyframe>& keyframes, const std::vector<std::uint64_t>& piece_starts,
             KeyframePoints& points);
  [[nodiscard]] SearchedMap searched(const std::vector<Keyframe>& keyframes,
                                     const std::vector<std::uint64_t>& piece_starts,
                                     KeyframePoints& points) const;
  [[nodiscard]] bool due(const std::vector<Keyframe>& keyframes);

  void keep(LoopOutcome& outcome);

  LoopCloserConfig config_;
  LocalMapConfig local_map_config_;
  bool leave_map_;
  std::vector<LoopAttempt> attempts_;
  // Of the first loops of the graph, at the last handover: 1 where it was used.
  std::vector<char> decided_;
  // Of the running search while there is one; kept from one to the next.
  std::unique_ptr<LoopAgreement> agreement_;
  SideWork work_;
  TimeNs last_search_ = kNoSearchYet;
  std::atomic<bool> abandoned_ = false;  // nobody waits for what the running search finds
  std::optional<Running> running_;
};

}  // namespace understory
