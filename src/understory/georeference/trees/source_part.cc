#include "understory/georeference/trees/source_part.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include "understory/georeference/georeference_constants.h"
#include "understory/util/median.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace georeference_constants::tree_match;
using Eigen::Vector2d;

bool mostly_known(std::span<const Tree> trees, const std::vector<std::size_t>& indices,
                  double Tree::*size) {
  const auto known = std::count_if(indices.begin(), indices.end(),
                                   [&](std::size_t i) { return std::isfinite(trees[i].*size); });
  return static_cast<double>(known) >= kLeastSized * static_cast<double>(indices.size());
}

// Squared distance within which `most` trees lie around each of the trees.
double square_reach(const std::vector<PatternTree>& trees, const Vector2d& centre, std::size_t most,
                    std::vector<double>& squares) {
  squares.clear();
  for (const PatternTree& tree : trees)
    squares.push_back((tree.at - centre).squaredNorm());
  const auto last = squares.begin() + static_cast<std::ptrdiff_t>(most - 1);
  std::nth_element(squares.begin(), last, squares.end());
  return *last;
}

SourcePart part_around(const std::vector<PatternTree>& trees, const Vector2d& middle,
                       double square_m2) {
  SourcePart part;
  for (const PatternTree& tree : trees)
    if ((tree.at - middle).squaredNorm() <= square_m2) part.trees.push_back(tree);
  for (const PatternTree& tree : part.trees)
    part.centre += tree.at / static_cast<double>(part.trees.size());
  for (PatternTree& tree : part.trees) {
    tree.at -= part.centre;
    part.reach_m = std::max(part.reach_m, tree.at.norm());
  }
  return part;
}

// Trees per square metre around half of the trees at least. Neighbours are those within a circle,
// so that a turn of the map changes nothing.
double usual_density(std::span<const Tree> trees, const std::vector<std::size_t>& indices) {
  std::vector<PatternTree> places;
  for (const std::size_t i : indices)
    places.push_back({Vector2d(trees[i].x, trees[i].y), 0.0});
  const PatternGrid grid(places);
  std::vector<double> counts;
  for (const PatternTree& tree : places) {
    double count = -1.0;  // without the tree itself
    grid.near(tree.at, kCrowdM, [&](std::size_t, double) { count += 1.0; });
    counts.push_back(count);
  }
  return std::max(1.0, upper_median(counts)) / (std::numbers::pi * kCrowdM * kCrowdM);
}

}  // namespace

std::vector<std::size_t> dominant_trees(std::span<const Tree> trees,
                                        const std::vector<std::size_t>& indices, double density) {
  const double own = usual_density(trees, indices);
  const double share = kDominantDensity * density / own;
  double Tree::*size = mostly_known(trees, indices, &Tree::height_m) ? &Tree::height_m
                       : mostly_known(trees, indices, &Tree::dbh_m)  ? &Tree::dbh_m
                                                                     : nullptr;
  if (!(share < 1.0) || size == nullptr) return indices;
  std::vector<double> sizes;
  for (const std::size_t i : indices)
    if (std::isfinite(trees[i].*size)) sizes.push_back(trees[i].*size);
  auto keep = static_cast<std::size_t>(share * static_cast<double>(indices.size()));
  keep = std::clamp(keep, std::min(kFewestTrees, sizes.size()), sizes.size());
  const auto limit = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() - keep);
  if (limit == sizes.end()) return indices;
  std::nth_element(sizes.begin(), limit, sizes.end());
  std::vector<std::size_t> large;
  for (const std::size_t i : indices)
    if (trees[i].*size >= *limit) large.push_back(i);
  return large;
}

std::vector<SourcePart> parts_of(const std::vector<PatternTree>& trees, std::size_t most,
                                 std::size_t count) {
  constexpr double kEverywhere = 1e300;
  if (trees.size() <= most) return {part_around(trees, Vector2d::Zero(), kEverywhere)};
  std::vector<double> squares;
  std::vector<std::tuple<double, Vector2d>> centres;  // by how compact the part around each is
  const std::size_t step = 1 + trees.size() / 200;
  for (std::size_t i = 0; i < trees.size(); i += step)
    centres.emplace_back(square_reach(trees, trees[i].at, most, squares), trees[i].at);
  sort_stably(centres,
              [](const auto& a, const auto& b) { return std::get<0>(a) < std::get<0>(b); });
  std::vector<SourcePart> parts;
  for (const auto& [square, centre] : centres) {
    const Vector2d middle = centre;
    const bool known = std::any_of(parts.begin(), parts.end(), [&](const SourcePart& part) {
      return (part.centre - middle).norm() < 1.5 * part.reach_m;
    });
    if (!known) parts.push_back(part_around(trees, centre, square));
    if (parts.size() >= count) break;
  }
  return parts;
}

}  // namespace understory
