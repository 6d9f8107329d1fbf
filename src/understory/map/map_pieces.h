#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/graph/pose_graph.h"
#include "understory/map/loop_attempt.h"

namespace understory {

// The pieces that a map of keyframes consists of: the position was lost between one and the next.
// Pieces are together once a place of one was found in the other. Pieces and keyframes are counted
// from 0.
class MapPieces {
 public:
  // All apart. `starts`: the first keyframe of each piece, ascending from 0.
  MapPieces(std::vector<std::uint64_t> starts, std::size_t keyframes);

  [[nodiscard]] std::size_t count() const { return starts_.size(); }
  [[nodiscard]] std::size_t piece_of(std::size_t keyframe) const;
  [[nodiscard]] std::size_t begin(std::size_t piece) const { return starts_[piece]; }
  [[nodiscard]] std::size_t end(std::size_t piece) const;  // one behind its last keyframe
  // Of all pieces together the first stands for them.
  [[nodiscard]] std::size_t group_of(std::size_t piece) const { return group_[piece]; }
  [[nodiscard]] bool together(std::size_t a, std::size_t b) const { return group_[a] == group_[b]; }
  // Whether the pieces of two keyframes are together.
  [[nodiscard]] bool connected(std::size_t keyframe, std::size_t other) const {
    return together(piece_of(keyframe), piece_of(other));
  }
  [[nodiscard]] std::size_t groups() const;
  // The first keyframe of those pieces at the end that are all together.
  [[nodiscard]] std::size_t last_group_start() const;
  void join(std::size_t a, std::size_t b);

 private:
  std::vector<std::uint64_t> starts_;
  std::size_t keyframes_;
  std::vector<std::size_t> group_;
};

// What joins two pieces: the number of an attempt between them.
using PieceJoin = std::size_t;

// When verified loops from piece to piece are believed.
struct JoinConfig {
  double min_apart_m = 3.0;  // of way between the newer places of two loops
  PoseGraphConfig graph;     // when two loops agree
};

// Which pieces are together after these attempts. Two verified loops join two pieces if they agree
// over the odometry within either piece, and their newer places lie `min_apart_m` of way apart. One
// alone is not believed: a place that looks alike would join what is far apart. `odometry`: the
// edges between neighbouring keyframes, one from each to the next.
struct JoinedPieces {
  MapPieces pieces;
  std::vector<PieceJoin> joins;  // one for each two groups that came together, in that order
};
[[nodiscard]] JoinedPieces join_pieces(MapPieces apart, const std::vector<PoseEdge>& odometry,
                                       const std::vector<LoopAttempt>& attempts,
                                       const JoinConfig& config);

// Moves groups that are together now and were apart in `before`, each as a whole, so that the loop
// that joins them fits. The group of the oldest piece stays. World from keyframe.
void lay_together(MapPieces before, const JoinedPieces& now,
                  const std::vector<LoopAttempt>& attempts, std::vector<Pose>& world_from_keyframe);

}  // namespace understory
