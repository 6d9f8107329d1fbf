#include "understory/map/map_pieces.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/map/piece_search.h"
#include "understory/map/searched_map.h"

namespace understory {
namespace {

// Two straight walks of 20 m along x, a keyframe each metre. The second truly begins at (5, 3),
// heading left, and lies elsewhere by its guess.
constexpr std::size_t kLong = 20;
const Pose kTrueStart(so3_exp({0.0, 0.0, 1.57}), {5.0, 3.0, 0.2});
const Pose kGuess(so3_exp({0.0, 0.0, -0.4}), {22.0, -1.0, 0.0});

struct TwoWalks {
  std::vector<Pose> poses;
  std::vector<Pose> truth;
  std::vector<PoseEdge> odometry;
  MapPieces pieces{{0, kLong}, 2 * kLong};

  TwoWalks() {
    for (std::size_t k = 0; k < 2 * kLong; ++k) {
      const Pose step(Eigen::Quaterniond::Identity(), {static_cast<double>(k % kLong), 0.0, 0.0});
      poses.push_back(k < kLong ? step : kGuess * step);
      truth.push_back(k < kLong ? step : kTrueStart * step);
    }
    for (std::size_t k = 1; k < 2 * kLong; ++k) {
      const double sd = k == kLong ? 10.0 : 0.01;
      odometry.push_back({static_cast<int>(k) - 1, static_cast<int>(k),
                          poses[k - 1].inverse() * poses[k], sd * sd * Matrix6d::Identity()});
    }
  }
  // A loop that fits the truth, moved by so much.
  [[nodiscard]] LoopAttempt loop(std::size_t from, std::size_t to, double off_m = 0.0) const {
    LoopAttempt attempt;
    attempt.from = static_cast<int>(from);
    attempt.to = static_cast<int>(to);
    attempt.verified = true;
    const Pose moved(Eigen::Quaterniond::Identity(), {off_m, 0.0, 0.0});
    attempt.edge = {attempt.from, attempt.to, truth[from].inverse() * moved * truth[to],
                    1e-4 * Matrix6d::Identity()};
    return attempt;
  }
  [[nodiscard]] JoinedPieces joined(const std::vector<LoopAttempt>& attempts) const {
    return join_pieces(pieces, odometry, attempts, {});
  }
};

TEST(MapPieces, KnowWhichKeyframesAreTheirs) {
  MapPieces pieces({0, 4, 9}, 12);
  EXPECT_EQ(pieces.piece_of(3), 0U);
  EXPECT_EQ(pieces.piece_of(4), 1U);
  EXPECT_EQ(pieces.piece_of(11), 2U);
  EXPECT_EQ(pieces.end(1), 9U);
  EXPECT_EQ(pieces.end(2), 12U);
  EXPECT_EQ(pieces.groups(), 3U);
  EXPECT_EQ(pieces.last_group_start(), 9U);
  pieces.join(2, 0);
  EXPECT_TRUE(pieces.connected(1, 10));
  EXPECT_FALSE(pieces.connected(1, 5));
  EXPECT_EQ(pieces.last_group_start(), 9U);
  pieces.join(1, 2);
  EXPECT_EQ(pieces.groups(), 1U);
  EXPECT_EQ(pieces.last_group_start(), 0U);
}

TEST(JoinPieces, TwoLoopsThatAgreeJoin) {
  const TwoWalks walks;
  const auto joined = walks.joined({walks.loop(8, 22), walks.loop(5, 27)});
  EXPECT_EQ(joined.pieces.groups(), 1U);
  ASSERT_EQ(joined.joins.size(), 1U);
  EXPECT_EQ(joined.joins.front(), 1U);
}

TEST(JoinPieces, OneLoopAloneIsNotBelieved) {
  const TwoWalks walks;
  EXPECT_EQ(walks.joined({walks.loop(8, 22)}).pieces.groups(), 2U);
  // Nor two of nearly one place, which may err alike.
  EXPECT_EQ(walks.joined({walks.loop(8, 22), walks.loop(7, 24)}).pieces.groups(), 2U);
}

TEST(JoinPieces, LoopsThatContradictEachOtherDoNot) {
  const TwoWalks walks;
  EXPECT_EQ(walks.joined({walks.loop(8, 22), walks.loop(5, 27, 1.5)}).pieces.groups(), 2U);
  // A third one decides.
  const auto joined = walks.joined({walks.loop(8, 22), walks.loop(5, 27, 1.5), walks.loop(6, 33)});
  EXPECT_EQ(joined.pieces.groups(), 1U);
}

TEST(JoinPieces, LoopsOfOtherPiecesSayNothing) {
  const TwoWalks walks;
  MapPieces three({0, 10, kLong}, 2 * kLong);
  const std::vector<LoopAttempt> attempts = {walks.loop(8, 22), walks.loop(15, 27)};
  EXPECT_EQ(join_pieces(three, walks.odometry, attempts, {}).pieces.groups(), 3U);
}

TEST(LayTogether, MovesTheNewerPieceAsAWhole) {
  const TwoWalks walks;
  const std::vector<LoopAttempt> attempts = {walks.loop(8, 22), walks.loop(5, 27)};
  std::vector<Pose> poses = walks.poses;
  lay_together(walks.pieces, walks.joined(attempts), attempts, poses);
  for (std::size_t k = 0; k < poses.size(); ++k)
    EXPECT_LT(right_difference(poses[k], walks.truth[k]).norm(), 1e-9) << k;
}

TEST(GraphProblem, HoldsTheLoopsOfPiecesThatAreTogether) {
  const TwoWalks walks;
  const std::vector<LoopAttempt> attempts = {walks.loop(8, 22), walks.loop(0, 12),
                                             walks.loop(5, 27)};
  PoseGraphProblem bare;
  bare.world_from_keyframe = walks.poses;
  bare.odometry = walks.odometry;
  EXPECT_EQ(graph_problem(bare, walks.pieces, attempts).loops.size(), 1U);
  const PoseGraphProblem whole = graph_problem(bare, walks.joined(attempts).pieces, attempts);
  EXPECT_EQ(whole.loops.size(), 3U);
  // Solved from where the loops put the piece, the guess pulls on nothing.
  PoseGraphProblem solved = whole;
  lay_together(walks.pieces, walks.joined(attempts), attempts, solved.world_from_keyframe);
  const PoseGraphResult result = optimise_pose_graph(solved, {});
  ASSERT_TRUE(result.converged) << result.reason;
  for (std::size_t k = 0; k < 2 * kLong; ++k) {
    EXPECT_LT((result.world_from_keyframe[k].translation() - walks.truth[k].translation()).norm(),
              1e-5)
        << k;
  }
}

TEST(PlacesToTry, AreThoseOfPiecesThatAreApartTheNearestFirst) {
  const TwoWalks walks;
  PieceSearchConfig config;
  config.spacing_m = 8.0;
  config.max_candidates = 2;
  const auto first = places_to_try(walks.poses, walks.pieces, {}, 30, config);
  ASSERT_EQ(first.size(), 2U);
  EXPECT_EQ(first[0].older, 19U);
  EXPECT_EQ(first[1].older, 16U);
  EXPECT_EQ(first[0].newer, 30U);
  // What was tried, and what lies within half a spacing of it, waits for the others.
  LoopAttempt tried;
  tried.from = 19;
  tried.to = 28;
  const auto next = places_to_try(walks.poses, walks.pieces, {tried}, 31, config);
  ASSERT_EQ(next.size(), 2U);
  EXPECT_EQ(next[0].older, 8U);
  EXPECT_EQ(next[1].older, 0U);
  // A piece must have some length, and one that is joined has nothing left to look for.
  EXPECT_TRUE(places_to_try(walks.poses, walks.pieces, {}, 22, config).empty());
  MapPieces joined = walks.pieces;
  joined.join(0, 1);
  EXPECT_TRUE(places_to_try(walks.poses, joined, {}, 30, config).empty());
}

TEST(AllPlacesToTry, ArePairsOfAllPlacesTheNearestFirst) {
  const TwoWalks walks;
  const auto pairs = all_places_to_try(walks.poses, walks.pieces, 1, {});
  EXPECT_EQ(pairs.size(), 16U);
  EXPECT_EQ(pairs.front().older, 19U);
  EXPECT_EQ(pairs.front().newer, 20U);
}

}  // namespace
}  // namespace understory
