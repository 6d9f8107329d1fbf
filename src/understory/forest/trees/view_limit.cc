#include "understory/forest/trees/view_limit.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>

#include "understory/forest/forest_constants.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace forest_constants::view_limit;

bool is_known(const TreeInView& tree) {
  return std::isfinite(tree.height_m) && tree.dbh_m > 0.0 && std::isfinite(tree.farness);
}

double thinnest_that_counts(const std::vector<TreeInView>& trees) {
  std::vector<double> diameters;
  for (const TreeInView& tree : trees)
    if (is_known(tree)) diameters.push_back(tree.dbh_m);
  if (diameters.empty()) return std::numeric_limits<double>::infinity();
  const auto middle = diameters.begin() + static_cast<std::ptrdiff_t>(
                                              kThinShare * static_cast<double>(diameters.size()));
  std::nth_element(diameters.begin(), middle, diameters.end());
  return *middle;
}

// The thick trees, the nearest first.
std::vector<TreeInView> thick_by_distance(const std::vector<TreeInView>& trees) {
  const double least = thinnest_that_counts(trees);
  std::vector<TreeInView> thick;
  for (const TreeInView& tree : trees)
    if (is_known(tree) && tree.dbh_m >= least) thick.push_back(tree);
  sort_stably(thick,
              [](const TreeInView& a, const TreeInView& b) { return a.farness < b.farness; });
  return thick;
}

// What was seen of the trees of one distance.
struct Reached {
  double farness = 0.0;  // of the farthest of them
  double height_m = 0.0;
  double higher_share = 0.0;  // of those farther away, where most are higher
};

Reached reached_from(const std::vector<TreeInView>& thick, std::size_t first) {
  const std::size_t end = first + kNear;
  std::vector<double> heights;
  for (std::size_t i = first; i < end; ++i)
    heights.push_back(thick[i].height_m);
  std::nth_element(heights.begin(), heights.begin() + kRank, heights.end(), std::greater<>());
  Reached reached{thick[end - 1].farness, heights[kRank], 0.0};
  for (std::size_t far = end; far + kFar <= thick.size(); far += kStep) {
    const auto from = thick.begin() + static_cast<std::ptrdiff_t>(far);
    const auto higher =
        std::count_if(from, from + static_cast<std::ptrdiff_t>(kFar),
                      [&](const TreeInView& tree) { return tree.height_m > reached.height_m; });
    reached.higher_share =
        std::max(reached.higher_share, static_cast<double>(higher) / static_cast<double>(kFar));
  }
  return reached;
}

}  // namespace

std::vector<char> ends_with_the_view(const std::vector<TreeInView>& trees) {
  std::vector<char> ends(trees.size(), 0);
  const std::vector<TreeInView> thick = thick_by_distance(trees);
  double done = -std::numeric_limits<double>::infinity();
  for (std::size_t first = 0; first + kNear + kFar <= thick.size(); first += kStep) {
    const Reached reached = reached_from(thick, first);
    if (reached.higher_share < (first == 0 ? kHigherShare : kStillHigherShare)) break;
    for (std::size_t i = 0; i < trees.size(); ++i) {
      const TreeInView& tree = trees[i];
      if (!is_known(tree) || tree.farness <= done || tree.farness > reached.farness) continue;
      ends[i] = tree.height_m > kOfReached * reached.height_m ? 1 : 0;
    }
    done = reached.farness;
  }
  return ends;
}

}  // namespace understory
