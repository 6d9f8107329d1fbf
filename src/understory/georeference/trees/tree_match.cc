#include "understory/georeference/trees/tree_match.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>

#include "understory/georeference/georeference_constants.h"
#include "understory/georeference/trees/pattern_fit.h"
#include "understory/georeference/trees/source_part.h"
#include "understory/util/median.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace georeference_constants::tree_match;
using Eigen::Vector2d;

Vector2d place_of(const Tree& tree) {
  return {tree.x, tree.y};
}

std::vector<std::size_t> usable(std::span<const Tree> trees) {
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < trees.size(); ++i)
    if (std::isfinite(trees[i].x) && std::isfinite(trees[i].y)) indices.push_back(i);
  return indices;
}

// The target near the area: its trees, with the indices that they have in the list given.
struct NearTarget {
  std::vector<std::size_t> indices;
  std::vector<PatternTree> trees;
};

// What both maps tell of sizes: which figure of each, and how well these agree.
struct SharedSizes {
  double Tree::*source = nullptr;  // nullptr: sizes are not compared
  double Tree::*target = nullptr;
  double correlation = 0.0;
};

double share_with(std::span<const Tree> trees, const std::vector<std::size_t>& indices,
                  double Tree::*size) {
  const auto known = std::count_if(indices.begin(), indices.end(),
                                   [&](std::size_t i) { return std::isfinite(trees[i].*size); });
  return indices.empty() ? 0.0 : static_cast<double>(known) / static_cast<double>(indices.size());
}

SharedSizes shared_sizes(std::span<const Tree> source, const std::vector<std::size_t>& of_source,
                         std::span<const Tree> target, const std::vector<std::size_t>& of_target) {
  const std::array<SharedSizes, 4> kinds{{{&Tree::height_m, &Tree::height_m, kSameSizeCorrelation},
                                          {&Tree::dbh_m, &Tree::dbh_m, kSameSizeCorrelation},
                                          {&Tree::dbh_m, &Tree::height_m, kOtherSizeCorrelation},
                                          {&Tree::height_m, &Tree::dbh_m, kOtherSizeCorrelation}}};
  for (const SharedSizes& kind : kinds) {
    if (share_with(source, of_source, kind.source) >= kLeastSized &&
        share_with(target, of_target, kind.target) >= kLeastSized)
      return kind;
  }
  return {};
}

std::vector<PatternTree> pattern_of(std::span<const Tree> trees,
                                    const std::vector<std::size_t>& indices, double Tree::*size) {
  std::vector<Vector2d> places;
  std::vector<double> sizes;
  for (const std::size_t i : indices) {
    places.push_back(place_of(trees[i]));
    if (size != nullptr) sizes.push_back(trees[i].*size);
  }
  std::vector<double> ranks(places.size(), std::numeric_limits<double>::quiet_NaN());
  if (size != nullptr) ranks = local_ranks(places, sizes, kRankRadiusM);
  std::vector<PatternTree> pattern;
  for (std::size_t k = 0; k < places.size(); ++k)
    pattern.push_back({places[k], ranks[k]});
  return pattern;
}

// Best first; of those that end at one place the best.
std::vector<PatternFit> refined(const std::vector<PatternTree>& part, const PatternGrid& target,
                                const PlaceSearch& search, const TreeLikeness& likeness,
                                double reach_m) {
  std::vector<PatternFit> fits(search.candidates.size());
  const auto better = [](const PatternFit& a, const PatternFit& b) {
    const auto key = [](const PatternFit& fit) {
      return std::tuple(-fit.score, fit.target_from_source.yaw_rad, fit.target_from_source.at.x(),
                        fit.target_from_source.at.y());
    };
    return key(a) < key(b);
  };
  parallel_for(fits.size(), 4, [&](std::size_t k) {
    fits[k] =
        fit_pattern(part, target, search.candidates[k].target_from_source, likeness, kFirstSteps);
  });
  std::sort(fits.begin(), fits.end(), better);
  fits.resize(std::min(fits.size(), kRefined));
  const double spacing_m = 1.0 / std::sqrt(PatternGrid(part).median_density());
  const PatternGrid seen(part, {kSeenReach * spacing_m, kSeenShrink * spacing_m,
                                std::max(kLeastSeenCellM, kSeenCell * spacing_m)});
  parallel_for(fits.size(), 1, [&](std::size_t k) {
    fits[k] = fit_pattern(part, target, fits[k].target_from_source, likeness, kAllSteps);
    // Half the sum of two likelihood ratios is one, too.
    fits[k].score =
        std::max(fits[k].score, reverse_score(seen, target, fits[k])) - std::numbers::ln2;
  });
  std::sort(fits.begin(), fits.end(), better);
  std::vector<PatternFit> kept;
  for (const PatternFit& fit : fits) {
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const PatternFit& other) {
      const PlaneMotion& a = fit.target_from_source;
      const PlaneMotion& b = other.target_from_source;
      const double turn = std::remainder(a.yaw_rad - b.yaw_rad, 2.0 * std::numbers::pi);
      return (a.at - b.at).norm() + std::abs(turn) * reach_m < kSamePlaceM;
    });
    if (!known) kept.push_back(fit);
  }
  return kept;
}

// One part of the source, laid on the target.
struct PartOnTarget {
  SourcePart part;
  std::vector<PatternFit> fits;  // best first
  double poses = 0.0;
  double chance = 1.0;
};

// How rarely chance gives the best place: at most exp(-k score) times the number of poses. Where
// trees lie by chance the likelihood ratio has the mean 1, and k = 1 is a bound (Markov). Trees in
// rows or clumps look alike at more places. These show in the best of the other places: its score
// is what so many poses give, and k is taken from it. Beyond it the true curve falls off more
// steeply, since the logarithm of the probability is concave.
double chance_of(const std::vector<PatternFit>& fits, double poses) {
  if (fits.empty()) return 1.0;
  const double tried = std::log(poses);
  const double rival = fits.size() > 1 ? fits[1].score : 0.0;
  const double k = std::min(1.0, tried / std::max(1.0, rival));
  return std::min(1.0, std::exp(tried - k * fits.front().score));
}

// The fit to ever more of the source around the part. A long map that is a little bent is so
// followed from the part on. It ends where the rest no longer fits.
PatternFit grown(const PatternFit& start, const std::vector<PatternTree>& all, double reach_m,
                 const PatternGrid& target) {
  double whole = reach_m;
  for (const PatternTree& tree : all)
    whole = std::max(whole, tree.at.norm());
  PatternFit best = start;
  for (double reach = reach_m; reach < whole;) {
    reach = std::min(whole, kGrowth * reach);
    std::vector<PatternTree> part;
    for (const PatternTree& tree : all)
      if (tree.at.norm() <= reach) part.push_back(tree);
    TreeLikeness likeness = best.likeness;
    likeness.sd_m = std::clamp(kGrownNoise * likeness.sd_m, kLeastGrownM, kMostSdM);
    const PatternFit fit = fit_pattern(part, target, best.target_from_source, likeness, kAllSteps);
    if (fit.matched < kGrownMatches * best.matched / best.covered * fit.covered) break;
    best = fit;
  }
  return best;
}

// Pairs one to one, the nearest first.
std::vector<MatchedTrees> pair_trees(std::span<const Tree> source,
                                     const std::vector<std::size_t>& of_source,
                                     const PatternGrid& target, const NearTarget& near,
                                     const PlaneMotion& motion, double reach_m) {
  std::vector<MatchedTrees> all;
  for (const std::size_t i : of_source) {
    target.near(motion * place_of(source[i]), reach_m, [&](std::size_t k, double square_m2) {
      all.push_back({i, near.indices[target.given_index(k)], std::sqrt(square_m2)});
    });
  }
  std::sort(all.begin(), all.end(), [](const MatchedTrees& a, const MatchedTrees& b) {
    return std::tie(a.apart_m, a.source, a.target) < std::tie(b.apart_m, b.source, b.target);
  });
  std::vector<MatchedTrees> pairs;
  std::vector<bool> source_taken(source.size(), false);
  std::vector<bool> target_taken(
      near.indices.empty() ? 0 : 1 + *std::max_element(near.indices.begin(), near.indices.end()),
      false);
  for (const MatchedTrees& pair : all) {
    if (source_taken[pair.source] || target_taken[pair.target]) continue;
    source_taken[pair.source] = target_taken[pair.target] = true;
    pairs.push_back(pair);
  }
  std::sort(pairs.begin(), pairs.end(),
            [](const MatchedTrees& a, const MatchedTrees& b) { return a.source < b.source; });
  return pairs;
}

// The shift in height that the feet of the pairs tell.
void fit_height(std::span<const Tree> source, std::span<const Tree> target, TreeMatch& match) {
  std::vector<double> shifts;
  for (const MatchedTrees& pair : match.pairs) {
    const double shift = target[pair.target].z - source[pair.source].z;
    if (std::isfinite(shift)) shifts.push_back(shift);
  }
  match.heights_compared = shifts.size();
  match.height_sd_m = std::numeric_limits<double>::quiet_NaN();
  if (shifts.size() < kLeastHeights) return;
  const double shift = upper_median(shifts);
  for (double& value : shifts)
    value = std::abs(value - shift);
  match.height_sd_m = kMedianSd * kSdOverMad * upper_median(shifts) /
                      std::sqrt(static_cast<double>(match.heights_compared));
  match.target_from_source =
      Pose(match.target_from_source.rotation(),
           match.target_from_source.translation() + Eigen::Vector3d(0.0, 0.0, shift));
}

// All of a search that does not change from part to part.
struct Task {
  std::span<const Tree> source;
  std::span<const Tree> target;
  std::vector<std::size_t> of_source;
  NearTarget near;
  TreeLikeness likeness;
};

PartOnTarget find_part(const SourcePart& part, const PatternGrid& target,
                       const TreeSearchArea& area, const TreeLikeness& likeness,
                       const ProgressSink& progress) {
  PartOnTarget finding;
  finding.part = part;
  const SearchDisc disc{area.target_point,
                        area.radius_m + (part.centre - area.source_point).norm()};
  const PlaceSearch search = search_places(part.trees, target, disc, likeness, progress);
  finding.poses = search.poses;
  finding.fits = refined(part.trees, target, search, likeness, part.reach_m);
  finding.chance = chance_of(finding.fits, search.poses);
  return finding;
}

// Everything that is told of a place that was found.
void tell(const Task& task, const PatternGrid& target, const std::vector<PatternTree>& all,
          const PartOnTarget& finding, TreeMatch& match) {
  const PatternFit& best = finding.fits.front();
  const Vector2d centre = finding.part.centre;
  std::vector<PatternTree> centred = all;
  for (PatternTree& tree : centred)
    tree.at -= centre;
  const PatternFit fit = grown(best, centred, finding.part.reach_m, target);
  PlaneMotion motion = fit.target_from_source;
  match.found = true;
  match.centre_in_source = centre;
  match.covariance = fit.information.inverse();
  match.searched_trees = finding.part.trees.size();
  match.covered_trees = static_cast<std::size_t>(best.covered);
  match.noise_m = fit.likeness.sd_m;
  match.score = best.score;
  match.rival_score = finding.fits.size() > 1 ? finding.fits[1].score : 0.0;
  match.poses_tried = finding.poses;
  match.chance = finding.chance;
  motion.at = motion * -centre;
  match.target_from_source =
      Pose(Eigen::Quaterniond(Eigen::AngleAxisd(motion.yaw_rad, Eigen::Vector3d::UnitZ())),
           Eigen::Vector3d(motion.at.x(), motion.at.y(), 0.0));
  const double reach = std::max(kLeastPairM, kPairSds * match.noise_m);
  match.pairs = pair_trees(task.source, task.of_source, target, task.near, motion, reach);
  for (const MatchedTrees& pair : match.pairs)
    match.apart_rms_m += pair.apart_m * pair.apart_m / static_cast<double>(match.pairs.size());
  match.apart_rms_m = std::sqrt(match.apart_rms_m);
  for (const std::size_t i : task.of_source)
    match.expected_by_chance += 1.0 - std::exp(-target.density(motion * place_of(task.source[i])) *
                                               std::numbers::pi * reach * reach);
  fit_height(task.source, task.target, match);
}

void judge(const PartOnTarget& finding, const TreeMatchConfig& config, TreeMatch& match) {
  const PatternFit& best = finding.fits.front();
  if (best.matched < kLeastMatched) {
    match.reason = fmt::format(
        "only {:.0f} of {} trees have a partner at the best place; at least {:.0f} are needed",
        best.matched, finding.part.trees.size(), kLeastMatched);
  } else if (!(finding.chance <= config.most_chance)) {
    match.reason = fmt::format(
        "the best place may be chance: of {} trees {:.0f} have a partner there. The probability "
        "that chance gives a place as good is {:.2g} ({:.0e} at most)",
        finding.part.trees.size(), best.matched, finding.chance, config.most_chance);
  } else {
    match.trusted = true;
  }
}

}  // namespace

TreeMatch match_tree_maps(std::span<const Tree> source, std::span<const Tree> target,
                          const TreeSearchArea& area, const TreeMatchConfig& config,
                          const ProgressSink& progress) {
  TreeMatch match;
  Task task{source, target, usable(source), {}, {config.noise_m, config.share, 0.0}};
  if (task.of_source.size() < kFewestTrees) {
    match.reason = fmt::format("expected {} trees with a place at least, found {}", kFewestTrees,
                               task.of_source.size());
    return match;
  }
  double reach = area.radius_m + kCoverM;
  double whole = 0.0;
  for (const std::size_t i : task.of_source)
    whole = std::max(whole, (place_of(source[i]) - area.source_point).norm());
  reach += whole;
  for (const std::size_t i : usable(target))
    if ((place_of(target[i]) - area.target_point).norm() <= reach) task.near.indices.push_back(i);
  if (task.near.indices.size() < kFewestTrees) {
    match.reason = fmt::format("expected {} trees at least in the area that is searched, found {}",
                               kFewestTrees, task.near.indices.size());
    return match;
  }
  if (area.radius_m > kLargestRadiusM) {
    match.reason = fmt::format("expected a search radius of {:.0f} m at most, got {:.0f} m",
                               kLargestRadiusM, area.radius_m);
    return match;
  }
  const SharedSizes sizes = shared_sizes(source, task.of_source, target, task.near.indices);
  task.likeness.rank_correlation = sizes.correlation;
  const PatternGrid grid(pattern_of(target, task.near.indices, sizes.target));
  const std::vector<std::size_t> large =
      dominant_trees(source, task.of_source, grid.median_density());
  const std::vector<PatternTree> pattern = pattern_of(source, large, sizes.source);
  std::optional<PartOnTarget> best;
  for (const SourcePart& part : parts_of(pattern, config.most_trees, kParts)) {
    PartOnTarget finding = find_part(part, grid, area, task.likeness, progress);
    if (finding.fits.empty()) continue;
    if (!best || finding.chance < best->chance) best = std::move(finding);
    if (best->chance <= config.most_chance) break;
  }
  if (!best) {
    match.reason = "no place of the area has trees";
    return match;
  }
  tell(task, grid, pattern, *best, match);
  judge(*best, config, match);
  return match;
}

}  // namespace understory
