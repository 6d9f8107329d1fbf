#include "understory/map/map_pieces.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "understory/util/error.h"

namespace understory {
namespace {

std::size_t older(const LoopAttempt& attempt) {
  return static_cast<std::size_t>(attempt.from);
}
std::size_t newer(const LoopAttempt& attempt) {
  return static_cast<std::size_t>(attempt.to);
}

double way_between(const std::vector<PoseEdge>& odometry, std::size_t a, std::size_t b) {
  double way = 0.0;
  for (std::size_t i = std::min(a, b); i < std::max(a, b); ++i)
    way += odometry[i].from_from_to.translation().norm();
  return way;
}

// Whether the circle over both loops and the odometry between their ends closes. No end of the
// circle crosses from piece to piece but by the loops.
bool agree(const std::vector<PoseEdge>& odometry, const PoseEdge& a, const PoseEdge& b,
           const PoseGraphConfig& config) {
  PoseGraphProblem problem;
  const std::size_t known = odometry.size() + 1;
  problem.world_from_keyframe.resize(known);
  problem.odometry = odometry;
  problem.loops = {a, b};
  const std::vector<char> used = consistent_loops(problem, config);
  return used[0] != 0 && used[1] != 0;
}

}  // namespace

MapPieces::MapPieces(std::vector<std::uint64_t> starts, std::size_t keyframes)
    : starts_(std::move(starts)), keyframes_(keyframes), group_(starts_.size()) {
  UNDERSTORY_CHECK(!starts_.empty() && starts_.front() == 0 && starts_.back() <= keyframes);
  std::iota(group_.begin(), group_.end(), std::size_t{0});
}

std::size_t MapPieces::piece_of(std::size_t keyframe) const {
  const auto next = std::upper_bound(starts_.begin(), starts_.end(), keyframe);
  return static_cast<std::size_t>(next - starts_.begin()) - 1;
}

std::size_t MapPieces::end(std::size_t piece) const {
  return piece + 1 < count() ? starts_[piece + 1] : keyframes_;
}

std::size_t MapPieces::groups() const {
  std::size_t groups = 0;
  for (std::size_t i = 0; i < group_.size(); ++i)
    groups += group_[i] == i ? 1 : 0;
  return groups;
}

std::size_t MapPieces::last_group_start() const {
  std::size_t first = count() - 1;
  while (first > 0 && together(first - 1, count() - 1))
    --first;
  return starts_[first];
}

void MapPieces::join(std::size_t a, std::size_t b) {
  const std::size_t kept = std::min(group_[a], group_[b]);
  const std::size_t given = std::max(group_[a], group_[b]);
  std::replace(group_.begin(), group_.end(), given, kept);
}

JoinedPieces join_pieces(MapPieces apart, const std::vector<PoseEdge>& odometry,
                         const std::vector<LoopAttempt>& attempts, const JoinConfig& config) {
  JoinedPieces joined{std::move(apart), {}};
  MapPieces& pieces = joined.pieces;
  if (pieces.count() < 2) return joined;
  const auto between = [&](const LoopAttempt& attempt) {
    return std::pair(pieces.piece_of(older(attempt)), pieces.piece_of(newer(attempt)));
  };
  for (std::size_t i = 0; i < attempts.size(); ++i) {
    const auto [a, b] = between(attempts[i]);
    if (!attempts[i].verified || pieces.together(a, b)) continue;
    for (std::size_t k = 0; k < i; ++k) {
      if (!attempts[k].verified || between(attempts[k]) != std::pair(a, b)) continue;
      if (way_between(odometry, newer(attempts[i]), newer(attempts[k])) < config.min_apart_m)
        continue;
      if (!agree(odometry, attempts[i].edge, attempts[k].edge, config.graph)) continue;
      pieces.join(a, b);
      joined.joins.push_back(i);
      break;
    }
  }
  return joined;
}

void lay_together(MapPieces before, const JoinedPieces& now,
                  const std::vector<LoopAttempt>& attempts,
                  std::vector<Pose>& world_from_keyframe) {
  for (const PieceJoin join : now.joins) {
    const LoopAttempt& attempt = attempts[join];
    const std::size_t a = before.piece_of(older(attempt));
    const std::size_t b = before.piece_of(newer(attempt));
    if (before.together(a, b)) continue;
    const Pose& from = world_from_keyframe[older(attempt)];
    const Pose& to = world_from_keyframe[newer(attempt)];
    const bool newer_moves = before.group_of(a) < before.group_of(b);
    const Pose moved = newer_moves ? from * attempt.edge.from_from_to * to.inverse()
                                   : to * attempt.edge.from_from_to.inverse() * from.inverse();
    const std::size_t group = before.group_of(newer_moves ? b : a);
    for (std::size_t piece = 0; piece < before.count(); ++piece) {
      if (before.group_of(piece) != group) continue;
      const std::size_t end = std::min(before.end(piece), world_from_keyframe.size());
      for (std::size_t k = before.begin(piece); k < end; ++k)
        world_from_keyframe[k] = moved * world_from_keyframe[k];
    }
    before.join(a, b);
  }
}

}  // namespace understory
