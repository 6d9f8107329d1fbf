#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "understory/graph/self_correction/correction_pairs.h"

namespace understory {

// Chooses the pair of views to be matched next by what the match is expected to tell.
//
// The error of the path is taken as a random walk. The relative position of views j < i is
// uncertain by the sum of the variances of the steps between. What two pairs ask about is
// correlated by the steps that they share. A match of a pair with noise r tells 1/2 ln(1 + v / r)
// nats. v is the variance that is left after the matches taken so far. It follows from Gaussian
// process regression over the path (P1 section 5 names it for the corrections themselves). Not
// thread-safe; deterministic.
class GainQueue {
 public:
  // `step_variance_m2[k]` is of the step from view k - 1 to k; `noise_m2[c]` of a match of pair c.
  GainQueue(std::vector<CorrectionPair> pairs, std::vector<double> noise_m2,
            const std::vector<double>& step_variance_m2);

  // The pair of the largest expected gain among those neither taken nor dropped; ties: the first.
  [[nodiscard]] std::optional<std::size_t> best() const;
  [[nodiscard]] double gain(std::size_t pair) const;         // nats
  [[nodiscard]] double variance_m2(std::size_t pair) const;  // v
  [[nodiscard]] const CorrectionPair& pair(std::size_t pair) const { return pairs_[pair]; }
  // The pair was matched: what it told is no longer expected of others.
  void take(std::size_t pair);
  // The match failed: the pair is not asked for again.
  void drop(std::size_t pair) { open_[pair] = 0; }

 private:
  [[nodiscard]] double shared_m2(std::size_t a, std::size_t b) const;

  std::vector<CorrectionPair> pairs_;
  std::vector<double> noise_m2_;
  std::vector<double> walked_m2_;  // variance from the first view to each
  std::vector<double> variance_m2_;
  std::vector<std::vector<double>> factor_;  // rows of the Cholesky factor, a column per pair taken
  std::vector<char> open_;
};

}  // namespace understory
