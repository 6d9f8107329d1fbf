#include "understory/graph/loops/loop_agreement.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <queue>
#include <set>
#include <utility>

#include "understory/geometry/symmetric_solver.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

bool same_edge(const PoseEdge& a, const PoseEdge& b) {
  return a.from == b.from && a.to == b.to &&
         a.from_from_to.translation() == b.from_from_to.translation() &&
         a.from_from_to.rotation().coeffs() == b.from_from_to.rotation().coeffs() &&
         a.covariance == b.covariance;
}

bool begins_with(const std::vector<PoseEdge>& all, const std::vector<PoseEdge>& known) {
  return all.size() >= known.size() &&
         std::equal(known.begin(), known.end(), all.begin(), same_edge);
}

}  // namespace

LoopAgreement::LoopAgreement(const PoseGraphConfig& config)
    : config_(config), limit_(chi_squared_6(config.consistency_probability)) {}

bool LoopAgreement::continues(const PoseGraphProblem& problem) const {
  return problem.world_from_keyframe.size() >= chain_.reached.size() &&
         begins_with(problem.odometry, odometry_) && begins_with(problem.loops, loops_);
}

void LoopAgreement::update(const PoseGraphProblem& problem) {
  if (!continues(problem)) {
    chain_ = {};
    odometry_.clear();
    loops_.clear();
    against_.clear();
    used_.clear();
  }
  extend_chain(problem);
  const std::size_t known = loops_.size();
  for (std::size_t i = known; i < problem.loops.size(); ++i)
    add_loop(problem.loops[i]);
  if (loops_.size() == known) return;
  used_.assign(loops_.size(), 0);
  for (const std::size_t i : largest_set())
    used_[i] = 1;
}

void LoopAgreement::extend_chain(const PoseGraphProblem& problem) {
  const std::size_t n = problem.world_from_keyframe.size();
  chain_.first_from_keyframe.resize(n);
  chain_.covariance.resize(n, Matrix6d::Zero());
  chain_.reached.resize(n, 0);
  if (n == 0) return;
  chain_.reached[0] = 1;
  for (std::size_t i = odometry_.size(); i < problem.odometry.size(); ++i) {
    const PoseEdge& edge = problem.odometry[i];
    odometry_.push_back(edge);
    const auto from = static_cast<std::size_t>(edge.from);
    const auto to = static_cast<std::size_t>(edge.to);
    if (chain_.reached[from] == 0 || chain_.reached[to] != 0) continue;
    chain_.first_from_keyframe[to] = chain_.first_from_keyframe[from] * edge.from_from_to;
    chain_.covariance[to] =
        compose_covariance(chain_.covariance[from], edge.from_from_to, edge.covariance);
    chain_.reached[to] = 1;
  }
}

void LoopAgreement::add_loop(const PoseEdge& loop) {
  const std::size_t n = loops_.size();
  std::vector<char> agrees(n);
  parallel_for(n, 256, [&](std::size_t i) { agrees[i] = agree(loops_[i], loop) ? 1 : 0; });
  compared_ += n;
  against_.emplace_back();
  for (std::size_t i = 0; i < n; ++i) {
    if (agrees[i] != 0) continue;
    against_[i].push_back(n);
    against_[n].push_back(i);
  }
  loops_.push_back(loop);
}

// Relative pose between two keyframes over the odometry, with the covariance of that stretch.
LoopAgreement::Stretch LoopAgreement::stretch(int a, int b) const {
  const double scale = config_.odometry_sigma_scale;
  const auto ia = static_cast<std::size_t>(std::min(a, b));
  const auto ib = static_cast<std::size_t>(std::max(a, b));
  Stretch s;
  s.a_from_b = chain_.first_from_keyframe[ia].inverse() * chain_.first_from_keyframe[ib];
  // What the chain's covariance grew by from a to b: cov(b) - (cov(a) carried over to b).
  const Matrix6d carried = compose_covariance(chain_.covariance[ia], s.a_from_b, Matrix6d::Zero());
  s.covariance = scale * scale * (chain_.covariance[ib] - carried);
  if (a > b) {
    s.covariance = inverse_covariance(s.a_from_b, s.covariance);
    s.a_from_b = s.a_from_b.inverse();
  }
  return s;
}

// Whether the circle loop i, odometry, loop j backwards, odometry closes.
bool LoopAgreement::agree(const PoseEdge& i, const PoseEdge& j) const {
  const Stretch there = stretch(i.to, j.to);
  const Stretch back = stretch(j.from, i.from);
  Pose circle = i.from_from_to;
  Matrix6d covariance = i.covariance;
  const auto append = [&](const Pose& pose, const Matrix6d& added) {
    covariance = compose_covariance(covariance, pose, added);
    circle = circle * pose;
  };
  append(there.a_from_b, there.covariance);
  append(j.from_from_to.inverse(), inverse_covariance(j.from_from_to, j.covariance));
  append(back.a_from_b, back.covariance);
  const Vector6d error = circle.log();
  covariance = 0.5 * (covariance + covariance.transpose()).eval();
  covariance.diagonal().array() += 1e-12;
  return error.dot(SymmetricSolver<6>(covariance).solve(error)) < limit_;
}

std::vector<std::vector<std::size_t>> LoopAgreement::contested() const {
  std::vector<std::vector<std::size_t>> parts;
  std::vector<char> seen(loops_.size(), 0);
  for (std::size_t first = 0; first < loops_.size(); ++first) {
    if (seen[first] != 0 || against_[first].empty()) continue;
    std::vector<std::size_t> part{first};
    seen[first] = 1;
    for (std::size_t at = 0; at < part.size(); ++at) {
      for (const std::size_t k : against_[part[at]]) {
        if (seen[k] == 0) part.push_back(k);
        seen[k] = 1;
      }
    }
    std::sort(part.begin(), part.end());
    parts.push_back(std::move(part));
  }
  return parts;
}

// The set within a part that begins with one loop, or, without a seed, with that which contradicts
// fewest. None where it cannot reach `at_least`. `scratch` is all zeros, of the size of loops_.
std::vector<std::size_t> LoopAgreement::set_within(const std::vector<std::size_t>& part,
                                                   std::optional<std::size_t> seed,
                                                   std::size_t at_least, Scratch& scratch) const {
  std::vector<std::size_t> set;
  std::size_t left = part.size();
  for (const std::size_t k : part)
    scratch.is_left[k] = 1;
  if (seed) {
    set.push_back(*seed);
    scratch.is_left[*seed] = 0;
    for (const std::size_t k : against_[*seed])
      scratch.is_left[k] = 0;
    left -= 1 + against_[*seed].size();
  }
  // Those left, by how many of those left they contradict; an entry that is out of date is passed
  // over. Loops that contradict none of those left are chosen at once, as that changes nothing.
  using Entry = std::pair<std::size_t, std::size_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> next;
  if (set.size() + left >= at_least) {
    for (const std::size_t k : part) {
      if (scratch.is_left[k] == 0) continue;
      std::size_t contradicts = 0;
      for (const std::size_t m : against_[k])
        contradicts += scratch.is_left[m] != 0 ? 1 : 0;
      scratch.contradicts[k] = contradicts;
      if (contradicts > 0) {
        next.emplace(contradicts, k);
        continue;
      }
      set.push_back(k);
      scratch.is_left[k] = 0;
      --left;
    }
  }
  const auto drop = [&](std::size_t k) {
    scratch.is_left[k] = 0;
    --left;
    for (const std::size_t m : against_[k]) {
      if (scratch.is_left[m] != 0) next.emplace(--scratch.contradicts[m], m);
    }
  };
  while (left > 0 && set.size() + left >= at_least && !next.empty()) {
    const auto [contradicts, k] = next.top();
    next.pop();
    if (scratch.is_left[k] == 0 || contradicts != scratch.contradicts[k]) continue;
    set.push_back(k);
    drop(k);
    for (const std::size_t m : against_[k]) {
      if (scratch.is_left[m] != 0) drop(m);
    }
  }
  for (const std::size_t k : part)
    scratch.is_left[k] = 0;
  return left == 0 ? set : std::vector<std::size_t>{};
}

// A part whose loops contradict those of no other part is worked out alone. What is chosen in one
// does not change what is chosen in another. A seed changes only its own part, so the largest set
// is made of the sets without a seed, but for one part.
std::vector<std::size_t> LoopAgreement::largest_set() const {
  constexpr auto kNone = std::numeric_limits<std::size_t>::max();
  const std::vector<std::vector<std::size_t>> parts = contested();
  Scratch scratch{std::vector<char>(loops_.size(), 0), std::vector<std::size_t>(loops_.size(), 0)};
  std::vector<std::size_t> set;
  std::size_t best_seed = kNone;  // of all seeds that gain most, the lowest
  for (std::size_t k = 0; k < loops_.size(); ++k) {
    if (!against_[k].empty()) continue;
    if (set.empty()) best_seed = k;
    set.push_back(k);
  }
  std::size_t most_gained = 0;
  std::size_t best_part = kNone;
  std::vector<std::vector<std::size_t>> chosen;
  std::vector<std::size_t> seeded;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    chosen.push_back(set_within(parts[p], std::nullopt, 0, scratch));
    const std::size_t alone = chosen.back().size();
    // Seeds that contradict the same loops lead to the same set.
    std::set<std::vector<std::size_t>> tried;
    for (const std::size_t seed : parts[p]) {
      const std::size_t at_least = alone + most_gained + (seed < best_seed ? 0 : 1);
      if (parts[p].size() - against_[seed].size() < at_least) continue;
      if (!tried.insert(against_[seed]).second) continue;
      std::vector<std::size_t> found = set_within(parts[p], seed, at_least, scratch);
      if (found.size() < at_least) continue;
      most_gained = found.size() - alone;
      best_seed = seed;
      best_part = p;
      seeded = std::move(found);
    }
  }
  if (best_part != kNone) chosen[best_part] = std::move(seeded);
  for (const std::vector<std::size_t>& part : chosen)
    set.insert(set.end(), part.begin(), part.end());
  return set;
}

}  // namespace understory
