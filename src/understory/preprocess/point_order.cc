#include "understory/preprocess/point_order.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "understory/preprocess/preprocess_constants.h"
#include "understory/util/median.h"
#include "understory/util/random.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace preprocess_constants::point_order;

// Angles of a point about each axis: nobody knows about which one the lidar spins.
using Angles = std::array<double, 3>;

struct TimedAngles {
  std::uint32_t t_ns = 0;
  Angles angles{};
};

std::vector<TimedAngles> sample_of(const Scan& scan) {
  const std::size_t step = scan.points.size() / kMostPoints + 1;
  std::vector<TimedAngles> sample;
  for (std::size_t i = 0; i < scan.points.size(); i += step) {
    const ScanPoint& p = scan.points[i];
    sample.push_back({p.t_ns, {std::atan2(p.y, p.x), std::atan2(p.z, p.y), std::atan2(p.x, p.z)}});
  }
  return sample;
}

std::size_t different_times(const std::vector<TimedAngles>& in_order) {
  std::size_t count = in_order.empty() ? 0 : 1;
  for (std::size_t i = 1; i < in_order.size(); ++i)
    count += in_order[i].t_ns != in_order[i - 1].t_ns ? 1 : 0;
  return count;
}

// How far two angles of the same axis are apart, both within a half turn of 0.
double angle_between(double a, double b) {
  const double apart = std::abs(a - b);
  return apart <= M_PI ? apart : std::abs(2.0 * M_PI - apart);
}

// Median angle about an axis to the nearest of the points that follow. Several, because beams of
// one moment may look into different directions.
double median_step(const std::vector<TimedAngles>& points, std::size_t axis) {
  std::vector<double> steps;
  for (std::size_t i = 0; i + kFollowing < points.size(); ++i) {
    double nearest = M_PI;
    for (std::size_t k = 1; k <= kFollowing; ++k)
      nearest =
          std::min(nearest, angle_between(points[i + k].angles[axis], points[i].angles[axis]));
    steps.push_back(nearest);
  }
  return upper_median(steps);
}

void shuffle(std::vector<TimedAngles>& points) {
  for (std::size_t i = points.size(); i > 1; --i)
    std::swap(points[i - 1], points[hash_numbers(i) % i]);
}

}  // namespace

bool times_in_no_order(const Scan& scan) {
  if (!scan.has_point_times || scan.points.size() < kLeastPoints) return false;
  std::vector<TimedAngles> points = sample_of(scan);
  sort_stably(points, [](const TimedAngles& a, const TimedAngles& b) { return a.t_ns < b.t_ns; });
  if (different_times(points) < kLeastTimes) return false;
  std::vector<TimedAngles> mixed = points;
  shuffle(mixed);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (median_step(points, axis) < kOrderedShare * median_step(mixed, axis)) return false;
  }
  return true;
}

}  // namespace understory
