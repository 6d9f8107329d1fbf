#include "understory/graph/stem_matching/star_association.h"

#include <algorithm>
#include <cmath>

#include "understory/geometry/plane/delaunay.h"

namespace understory {
namespace {

// How much more likely an offset is where its partner is expected than where any stem may be, one
// on l0 x l0 square metres.
double likelihood_ratio(double squared_m2, double variance_m2, double l0_m) {
  return l0_m * l0_m / (2.0 * M_PI * variance_m2) * std::exp(-0.5 * squared_m2 / variance_m2);
}

double nearest_squared_m2(const Eigen::Vector2d& offset,
                          const std::vector<Eigen::Vector2d>& others) {
  double least = 1e18;
  for (const Eigen::Vector2d& other : others)
    least = std::min(least, (offset - other).squaredNorm());
  return least;
}

// Of the same stem against two strangers. Each neighbour is looked for in the other star: one that
// was not seen there changes the star but not all of it.
double star_ratio(const std::vector<Eigen::Vector2d>& a, const std::vector<Eigen::Vector2d>& b,
                  double l0_m, const StarNoise& noise) {
  const double variance = 4.0 * noise.stem_sd_m * noise.stem_sd_m;  // two differences
  double ratio = 1.0;
  for (const Eigen::Vector2d& offset : a)
    ratio *= 1.0 - noise.seen +
             noise.seen * likelihood_ratio(nearest_squared_m2(offset, b), variance, l0_m);
  return ratio;
}

}  // namespace

StarView stars_of(const SparsePoints& level_view) {
  StarView result;
  for (const Eigen::Vector3d& stem : level_view)
    result.stems.emplace_back(stem.head<2>());
  result.stars.resize(result.stems.size());
  const auto neighbours = natural_neighbours(result.stems);
  for (std::size_t k = 0; k < neighbours.size(); ++k) {
    for (const int n : neighbours[k])
      result.stars[k].emplace_back(result.stems[static_cast<std::size_t>(n)] - result.stems[k]);
  }
  result.l0_m = mean_neighbour_distance(result.stems);
  return result;
}

double associated_stems(const StarView& target, const StarView& source,
                        const Pose& target_from_source, double guess_variance_m2,
                        const StarNoise& noise) {
  if (target.l0_m <= 0.0 || source.l0_m <= 0.0) return 0.0;
  const double variance = guess_variance_m2 + 2.0 * noise.stem_sd_m * noise.stem_sd_m;
  const double reach = 3.0 * std::sqrt(variance);
  const Eigen::Matrix2d turn = target_from_source.rotation_matrix().topLeftCorner<2, 2>();
  double sum = 0.0;
  for (std::size_t k = 0; k < source.stems.size(); ++k) {
    const Eigen::Vector2d place =
        turn * source.stems[k] + target_from_source.translation().head<2>();
    std::vector<Eigen::Vector2d> star;
    double all = 1.0 / noise.seen - 1.0;  // for having no partner
    double squares = 0.0;
    for (std::size_t l = 0; l < target.stems.size(); ++l) {
      const double squared = (target.stems[l] - place).squaredNorm();
      if (squared > reach * reach) continue;
      if (star.empty()) {
        for (const Eigen::Vector2d& offset : source.stars[k])
          star.emplace_back(turn * offset);
      }
      const double weight = likelihood_ratio(squared, variance, target.l0_m) *
                            star_ratio(star, target.stars[l], target.l0_m, noise);
      all += weight;
      squares += weight * weight;
    }
    sum += squares / (all * all);
  }
  return sum;
}

}  // namespace understory
