#include "understory/map/searched_map.h"

#include <algorithm>
#include <utility>

#include "understory/map/map_constants.h"
#include "understory/preprocess/voxel_filter.h"

namespace understory {

std::vector<PoseEdge> odometry_of(const std::vector<Keyframe>& keyframes) {
  std::vector<PoseEdge> odometry;
  for (std::size_t i = 1; i < keyframes.size(); ++i) {
    odometry.push_back({static_cast<int>(i) - 1, static_cast<int>(i),
                        keyframes[i].previous_from_this, keyframes[i].covariance});
  }
  return odometry;
}

MapPieces pieces_among(const std::vector<std::uint64_t>& starts, std::size_t keyframes) {
  std::vector<std::uint64_t> known;
  for (const std::uint64_t start : starts) {
    if (known.empty() || start < keyframes) known.push_back(start);
  }
  return MapPieces(std::move(known), keyframes);
}

bool counts(const LoopAttempt& attempt, const MapPieces& pieces) {
  return pieces.connected(static_cast<std::size_t>(attempt.from),
                          static_cast<std::size_t>(attempt.to));
}

PoseGraphProblem graph_problem(PoseGraphProblem problem, const MapPieces& pieces,
                               const std::vector<LoopAttempt>& attempts) {
  for (std::size_t piece = 1; piece < pieces.count(); ++piece) {
    const std::size_t first = pieces.begin(piece);
    // The edge that leads to its first keyframe.
    if (pieces.together(piece - 1, piece) && first < problem.world_from_keyframe.size())
      problem.odometry[first - 1].covariance *= map_constants::searched_map::kGuessIsWorthless;
  }
  problem.loops.clear();
  for (const LoopAttempt& attempt : attempts) {
    if (attempt.verified && counts(attempt, pieces)) problem.loops.push_back(attempt.edge);
  }
  return problem;
}

void add_points_seen_from(const SearchedMap& map, std::size_t keyframe, std::size_t from,
                          Points& all) {
  const auto& poses = map.problem.world_from_keyframe;
  const Pose here_from_there = poses[from].inverse() * poses[keyframe];
  const Eigen::Matrix3f rotation = here_from_there.rotation_matrix().cast<float>();
  const Eigen::Vector3f translation = here_from_there.translation().cast<float>();
  for (const Eigen::Vector3f& p : map.points->get(keyframe)->points)
    all.push_back(rotation * p + translation);
}

Points points_around(const SearchedMap& map, std::size_t keyframe, int reach, double voxel_size_m) {
  const auto r = static_cast<std::size_t>(reach);
  const std::size_t piece = map.pieces.piece_of(keyframe);
  const std::size_t first = std::max(map.pieces.begin(piece), keyframe > r ? keyframe - r : 0);
  const std::size_t last = std::min(map.pieces.end(piece) - 1, keyframe + r);
  Points all;
  for (std::size_t i = first; i <= last; ++i)
    add_points_seen_from(map, i, keyframe, all);
  return VoxelFilter().filter(all, voxel_size_m);
}

LoopAttempt attempt_of(std::size_t older, std::size_t newer, const Pose& estimated,
                       const LoopVerification& verified) {
  LoopAttempt attempt;
  attempt.from = static_cast<int>(older);
  attempt.to = static_cast<int>(newer);
  attempt.verified = verified.accepted;
  attempt.reason = verified.reason;
  attempt.correction_m = (estimated.inverse() * verified.target_from_source).translation().norm();
  attempt.edge = {attempt.from, attempt.to, verified.target_from_source, verified.covariance};
  return attempt;
}

}  // namespace understory
