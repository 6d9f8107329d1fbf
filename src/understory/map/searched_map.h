#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/graph/loops/loop_closure.h"
#include "understory/graph/pose_graph.h"
#include "understory/map/keyframes/keyframe.h"
#include "understory/map/keyframes/keyframe_points.h"
#include "understory/map/loop_attempt.h"
#include "understory/map/map_pieces.h"

namespace understory {

// The map as a search for loops knows it, of its own, so that it can run beside the scan loop.
struct SearchedMap {
  PoseGraphProblem problem;
  MapPieces pieces;
  std::vector<LoopAttempt> attempts;  // so far; empty while there is one piece
  KeyframePoints* points = nullptr;   // not of its own
};

// The edges between neighbouring keyframes.
[[nodiscard]] std::vector<PoseEdge> odometry_of(const std::vector<Keyframe>& keyframes);
// All pieces that begin among the first `keyframes`, apart.
[[nodiscard]] MapPieces pieces_among(const std::vector<std::uint64_t>& starts,
                                     std::size_t keyframes);
// Whether a verified loop is one of the graph: its ends lie in pieces that are together.
[[nodiscard]] bool counts(const LoopAttempt& attempt, const MapPieces& pieces);
// `problem` (poses, odometry) with the loops that count. What was guessed of the way between two
// pieces that are together now counts for nothing.
[[nodiscard]] PoseGraphProblem graph_problem(PoseGraphProblem problem, const MapPieces& pieces,
                                             const std::vector<LoopAttempt>& attempts);

// Adds the points of a keyframe in the body frame of another.
void add_points_seen_from(const SearchedMap& map, std::size_t keyframe, std::size_t from,
                          Points& all);

// The clouds of up to `reach` keyframes of the same piece on each side of one, along the path. They
// are in its body frame, thinned by voxels of this edge.
[[nodiscard]] Points points_around(const SearchedMap& map, std::size_t keyframe, int reach,
                                   double voxel_size_m);

// What is kept of a loop that was tried. `estimated`: pose of the newer keyframe in the older one's
// frame at the time.
[[nodiscard]] LoopAttempt attempt_of(std::size_t older, std::size_t newer, const Pose& estimated,
                                     const LoopVerification& verified);

}  // namespace understory
