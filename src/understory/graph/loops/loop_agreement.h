#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/graph/pose_graph.h"

namespace understory {

// Which loops of a growing pose graph agree in pairs over the odometry between them (Mangelson et
// al. 2018), kept up as keyframes and loops come: a new loop is compared with those before it, and
// no pair is looked at twice. What it says is a function of the problem alone, however that grew.
// Not thread-safe.
class LoopAgreement {
 public:
  explicit LoopAgreement(const PoseGraphConfig& config);

  // Takes up what the problem has beyond what is known. Begins anew where an edge that is known has
  // changed. Linear in the loops for each new one, while those that contradict others fall into
  // small parts.
  void update(const PoseGraphProblem& problem);

  // Of the largest set of loops found that all agree with each other. From each loop in turn the
  // set grows greedily, by the one that agrees with most of those left. Ties go to the lower
  // number. One entry for each loop.
  [[nodiscard]] const std::vector<char>& used() const { return used_; }
  // Pairs of loops compared so far.
  [[nodiscard]] std::size_t compared() const { return compared_; }

 private:
  // Odometry chained from the first keyframe: poses, and the sums of variances up to each, which
  // give the covariance of any stretch between two.
  struct Chain {
    std::vector<Pose> first_from_keyframe;
    std::vector<Matrix6d> covariance;  // of first_from_keyframe, right perturbation
    std::vector<char> reached;
  };
  struct Stretch {
    Pose a_from_b;
    Matrix6d covariance;  // right perturbation
  };
  [[nodiscard]] bool continues(const PoseGraphProblem& problem) const;
  void extend_chain(const PoseGraphProblem& problem);
  void add_loop(const PoseEdge& loop);
  [[nodiscard]] Stretch stretch(int a, int b) const;
  [[nodiscard]] bool agree(const PoseEdge& i, const PoseEdge& j) const;
  [[nodiscard]] std::vector<std::size_t> largest_set() const;
  // Loops that contradict others, in parts that contradict no other part.
  [[nodiscard]] std::vector<std::vector<std::size_t>> contested() const;
  struct Scratch {
    std::vector<char> is_left;             // 1: neither chosen nor dropped yet
    std::vector<std::size_t> contradicts;  // how many of those
  };
  [[nodiscard]] std::vector<std::size_t> set_within(const std::vector<std::size_t>& part,
                                                    std::optional<std::size_t> seed,
                                                    std::size_t at_least, Scratch& scratch) const;

  PoseGraphConfig config_;
  double limit_;
  Chain chain_;
  std::vector<PoseEdge> odometry_;
  std::vector<PoseEdge> loops_;
  std::vector<std::vector<std::size_t>> against_;  // for each loop those that it contradicts
  std::vector<char> used_;
  std::size_t compared_ = 0;
};

}  // namespace understory
