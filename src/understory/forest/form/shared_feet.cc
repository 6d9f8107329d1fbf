#include "understory/forest/form/shared_feet.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "understory/forest/stem_curve_constants.h"
#include "understory/forest/stems/stem_axis.h"

namespace understory {
namespace {

using namespace stem_constants::shared_feet;

// The height between the ground and breast height at which the centre lines are nearest.
double nearest_height(const StemFit& a, const StemFit& b) {
  const Eigen::Vector2d apart = b.centre - a.centre;
  const Eigen::Vector2d opens = b.slope - a.slope;
  const double rate = opens.squaredNorm();
  if (rate < kParallel * kParallel) return 0.0;
  return std::clamp(kBreastHeight - apart.dot(opens) / rate, 0.0, kBreastHeight);
}

bool share_a_foot(const StemFit& a, const StemFit& b) {
  const double height = nearest_height(a, b);
  const auto apart_at = [&](double at) {
    return (b.centre - a.centre + (at - kBreastHeight) * (b.slope - a.slope)).norm();
  };
  const double touching = a.radius_m + b.radius_m + kFlare;
  return apart_at(height) < touching && apart_at(kAbove) > apart_at(height) + kOpens;
}

}  // namespace

std::vector<std::size_t> shared_feet(const std::vector<StemFit>& stems) {
  std::vector<std::size_t> foot(stems.size());
  std::iota(foot.begin(), foot.end(), std::size_t{0});
  const auto first_of = [&](std::size_t i) {
    while (foot[i] != i)
      i = foot[i];
    return i;
  };
  // By x, so that only neighbours are compared.
  std::vector<std::size_t> order = foot;
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    const double xa = stems[a].centre.x();
    const double xb = stems[b].centre.x();
    return xa != xb ? xa < xb : a < b;
  });
  for (std::size_t i = 0; i < order.size(); ++i) {
    for (std::size_t j = i + 1; j < order.size(); ++j) {
      const StemFit& a = stems[order[i]];
      const StemFit& b = stems[order[j]];
      if (b.centre.x() - a.centre.x() > kFarthest) break;
      if (std::abs(b.centre.y() - a.centre.y()) > kFarthest || !share_a_foot(a, b)) continue;
      std::size_t thick = first_of(order[i]);
      std::size_t thin = first_of(order[j]);
      if (stems[thin].radius_m > stems[thick].radius_m) std::swap(thick, thin);
      foot[thin] = thick;
    }
  }
  for (std::size_t i = 0; i < foot.size(); ++i)
    foot[i] = first_of(i);
  return foot;
}

}  // namespace understory
