#include "understory/georeference/trees/pattern_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "understory/georeference/georeference_constants.h"

namespace understory {
namespace {

using namespace georeference_constants::tree_match;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

// A tree of the target that a tree of the source may be, and how probably it is.
struct Partner {
  std::size_t index = 0;
  double square_m2 = 0.0;
  double weight = 0.0;
};

// The partners of one tree of the source.
class Partners {
 public:
  // False where the target does not reach.
  bool find(const PatternTree& tree, const Vector2d& at, const PatternGrid& target,
            const TreeLikeness& likeness) {
    list_.clear();
    const double density = target.density(at);
    if (density <= 0.0) return false;
    const double square = likeness.sd_m * likeness.sd_m;
    double sum = 0.0;
    target.near(at, kReachSds * likeness.sd_m, [&](std::size_t k, double square_m2) {
      const double weight = likeness.rank_ratio(tree.rank, target.trees()[k].rank) *
                            std::exp(-0.5 * square_m2 / square) / (2.0 * std::numbers::pi * square);
      list_.push_back({k, square_m2, likeness.share * weight});
      sum += likeness.share * weight;
    });
    const double all = (1.0 - likeness.share) * density + sum;
    for (Partner& partner : list_)
      partner.weight /= all;
    probability_ = sum / all;
    score_ = std::log(all / density);
    return true;
  }
  [[nodiscard]] const std::vector<Partner>& list() const { return list_; }
  [[nodiscard]] double probability() const { return probability_; }
  [[nodiscard]] double score() const { return score_; }

 private:
  std::vector<Partner> list_;
  double probability_ = 0.0;  // that it is one of them
  double score_ = 0.0;
};

// Sums over all pairs, weighted by how probable they are.
struct PairSums {
  double covered = 0.0;
  double weight = 0.0;
  double square_m2 = 0.0;
  double score = 0.0;
  Vector2d source = Vector2d::Zero();
  Vector2d target = Vector2d::Zero();
  double dot = 0.0;
  double cross = 0.0;
};

PairSums sum_pairs(const std::vector<PatternTree>& source, const PatternGrid& target,
                   const PatternFit& fit, Partners& partners) {
  PairSums sums;
  const PlaneMotion& motion = fit.target_from_source;
  const Eigen::Matrix2d rotation = motion.rotation();
  for (const PatternTree& tree : source) {
    if (!partners.find(tree, motion.at + rotation * tree.at, target, fit.likeness)) continue;
    sums.covered += 1.0;
    sums.score += partners.score();
    for (const Partner& partner : partners.list()) {
      const Vector2d there = target.trees()[partner.index].at - motion.at;
      const double w = partner.weight;
      sums.weight += w;
      sums.square_m2 += w * partner.square_m2;
      sums.source += w * tree.at;
      sums.target += w * there;
      sums.dot += w * tree.at.dot(there);
      sums.cross += w * (tree.at.x() * there.y() - tree.at.y() * there.x());
    }
  }
  return sums;
}

// The motion that lays the weighted pairs on each other best.
PlaneMotion motion_of(const PairSums& sums, const PlaneMotion& before) {
  const Vector2d source = sums.source / sums.weight;
  const Vector2d target = sums.target / sums.weight;
  const double dot = sums.dot - sums.weight * source.dot(target);
  const double cross =
      sums.cross - sums.weight * (source.x() * target.y() - source.y() * target.x());
  PlaneMotion motion;
  motion.yaw_rad = std::atan2(cross, dot);
  motion.at = before.at + target - motion.rotation() * source;
  return motion;
}

Matrix3d information_of(const std::vector<PatternTree>& source, const PatternGrid& target,
                        const PatternFit& fit, Partners& partners) {
  Matrix3d information = Matrix3d::Zero();
  const double square = fit.likeness.sd_m * fit.likeness.sd_m;
  for (const PatternTree& tree : source) {
    const Vector2d arm = fit.target_from_source.rotation() * tree.at;
    const Vector2d at = fit.target_from_source.at + arm;
    if (!partners.find(tree, at, target, fit.likeness)) continue;
    Eigen::Matrix<double, 2, 3> jacobian;
    jacobian << -arm.y(), 1.0, 0.0, arm.x(), 0.0, 1.0;
    information += partners.probability() / square * jacobian.transpose() * jacobian;
    Vector3d mean = Vector3d::Zero();
    for (const Partner& partner : partners.list()) {
      const Vector3d slope =
          jacobian.transpose() * (target.trees()[partner.index].at - at) / square;
      information -= partner.weight * slope * slope.transpose();
      mean += partner.weight * slope;
    }
    information += mean * mean.transpose();
  }
  return information;
}

}  // namespace

PatternFit fit_pattern(const std::vector<PatternTree>& source, const PatternGrid& target,
                       const PlaneMotion& start, const TreeLikeness& likeness, int steps) {
  PatternFit fit;
  fit.target_from_source = start;
  fit.likeness = likeness;
  Partners partners;
  double reach = 1.0;
  for (const PatternTree& tree : source)
    reach = std::max(reach, tree.at.norm());
  for (int step = 0; step < steps; ++step) {
    const PairSums sums = sum_pairs(source, target, fit, partners);
    fit.score = sums.score;
    fit.matched = sums.weight;
    fit.covered = sums.covered;
    if (sums.weight < kLeastWeight) break;
    const PlaneMotion before = fit.target_from_source;
    fit.target_from_source = motion_of(sums, before);
    const double sd = fit.likeness.sd_m;
    // What was expected counts as some trees that have been seen: few trees fit too well.
    const double square = (0.5 * sums.square_m2 + kPriorTrees * likeness.sd_m * likeness.sd_m) /
                          (sums.weight + kPriorTrees);
    fit.likeness.sd_m = std::clamp(std::sqrt(square), kLeastSdM, kMostSdM);
    fit.likeness.share =
        std::clamp((sums.weight + kPriorTrees * likeness.share) / (sums.covered + kPriorTrees),
                   kLeastShare, kMostShare);
    const double moved =
        (fit.target_from_source.at - before.at).norm() +
        reach * std::abs(std::remainder(fit.target_from_source.yaw_rad - before.yaw_rad,
                                        2.0 * std::numbers::pi));
    if (moved < kStillM && std::abs(fit.likeness.sd_m - sd) < kStillM) break;
  }
  const PairSums sums = sum_pairs(source, target, fit, partners);
  fit.score = sums.score;
  fit.matched = sums.weight;
  fit.covered = sums.covered;
  fit.information = information_of(source, target, fit, partners);
  return fit;
}

double reverse_score(const PatternGrid& source, const PatternGrid& target, const PatternFit& fit) {
  const double square = fit.likeness.sd_m * fit.likeness.sd_m;
  const double reach = kReachSds * fit.likeness.sd_m;
  const Eigen::Matrix2d source_from_target = fit.target_from_source.rotation().transpose();
  double whole = 0.0;
  for (const PatternTree& tree : source.trees())
    whole = std::max(whole, tree.at.norm());
  std::vector<double> ratios;  // of each tree: how much denser the source is there than around
  target.near(fit.target_from_source.at, whole + kCoverM, [&](std::size_t k, double) {
    const PatternTree& tree = target.trees()[k];
    const Vector2d at = source_from_target * (tree.at - fit.target_from_source.at);
    const double density = source.density(at);
    if (density <= 0.0) return;
    double sum = 0.0;
    source.near(at, reach, [&](std::size_t i, double square_m2) {
      sum += fit.likeness.rank_ratio(source.trees()[i].rank, tree.rank) *
             std::exp(-0.5 * square_m2 / square) / (2.0 * std::numbers::pi * square);
    });
    ratios.push_back(sum / density);
  });
  double share = kSeenShare;
  double score = 0.0;
  constexpr int kSteps = 10;
  for (int step = 0; step < kSteps; ++step) {
    double matched = 0.0;
    score = 0.0;
    for (const double ratio : ratios) {
      const double all = 1.0 - share + share * ratio;
      score += std::log(all);
      matched += share * ratio / all;
    }
    share = std::clamp(
        (matched + kPriorTrees * kSeenShare) / (static_cast<double>(ratios.size()) + kPriorTrees),
        kLeastShare, kMostShare);
  }
  return score;
}

}  // namespace understory
