#include "understory/graph/loops/loop_agreement.h"

#include <algorithm>
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

// The set that begins with one loop, or none where it cannot be larger than `to_beat`.
std::vector<std::size_t> LoopAgreement::set_from(std::size_t seed, std::size_t to_beat) const {
  const std::size_t n = loops_.size();
  std::vector<char> is_left(n, 1);
  std::size_t left = n - 1 - against_[seed].size();
  if (left + 1 <= to_beat) return {};
  is_left[seed] = 0;
  for (const std::size_t k : against_[seed])
    is_left[k] = 0;
  // How many of those left each of them contradicts, and all of these together.
  std::vector<std::size_t> contradicts(n, 0);
  std::size_t contradictions = 0;
  for (std::size_t k = 0; k < n; ++k) {
    if (is_left[k] == 0) continue;
    for (const std::size_t m : against_[k])
      contradicts[k] += is_left[m] != 0 ? 1 : 0;
    contradictions += contradicts[k];
  }
  std::vector<std::size_t> set{seed};
  const auto drop = [&](std::size_t k) {
    is_left[k] = 0;
    --left;
    contradictions -= contradicts[k];
    for (const std::size_t m : against_[k]) {
      if (is_left[m] == 0) continue;
      --contradicts[m];
      --contradictions;
    }
  };
  while (left > 0 && set.size() + left > to_beat) {
    std::size_t chosen = n;
    for (std::size_t k = 0; k < n; ++k) {
      if (is_left[k] == 0) continue;
      // Those left all agree: each of them is chosen in turn.
      if (contradictions == 0) set.push_back(k);
      if (chosen == n || contradicts[k] < contradicts[chosen]) chosen = k;
    }
    if (contradictions == 0) return set;
    set.push_back(chosen);
    const std::vector<std::size_t> opponents = against_[chosen];
    drop(chosen);
    for (const std::size_t k : opponents) {
      if (is_left[k] != 0) drop(k);
    }
  }
  return left == 0 ? set : std::vector<std::size_t>{};
}

std::vector<std::size_t> LoopAgreement::largest_set() const {
  std::vector<std::size_t> best;
  for (std::size_t seed = 0; seed < loops_.size(); ++seed) {
    std::vector<std::size_t> set = set_from(seed, best.size());
    if (set.size() > best.size()) best = std::move(set);
  }
  return best;
}

}  // namespace understory
