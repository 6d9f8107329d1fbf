#include "understory/forest/trees/tree_heights.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "understory/forest/stems/stem_axis.h"
#include "understory/forest/tree_height_constants.h"

namespace understory {
namespace {

using namespace tree_height_constants;

Eigen::Vector2i cell_of(const Eigen::Vector2d& place) {
  return (place / kCell).array().floor().cast<int>();
}

std::uint64_t key(const Eigen::Vector2i& cell) {
  return static_cast<std::uint64_t>(static_cast<std::uint32_t>(cell.x())) << 32 |
         static_cast<std::uint32_t>(cell.y());
}

// The last one: and above.
int decimetre_of(double height_m) {
  return static_cast<int>(std::min(10.0 * HeightColumn::kMetres - 1.0, 10.0 * height_m));
}

void count_one(std::uint8_t& count) {
  if (count < std::numeric_limits<std::uint8_t>::max()) ++count;
}

}  // namespace

Eigen::Vector2d stem_place_at(const StemFit& stem, double height_m) {
  return stem.centre + std::min(height_m - kBreastHeight, kStraight) * stem.slope;
}

TreeColumns::TreeColumns(const std::vector<StemFit>& stems, std::vector<double> ground_m)
    : stems_(stems), ground_m_(std::move(ground_m)), columns_(stems.size()) {
  const Eigen::Vector2d reach(kCrownReach, kCrownReach);
  for (std::size_t i = 0; i < stems.size(); ++i) {
    const Eigen::Vector2d foot = stem_place_at(stems[i], 0.0);
    const Eigen::Vector2d end = stem_place_at(stems[i], std::numeric_limits<double>::infinity());
    const Eigen::Vector2i low = cell_of(foot.cwiseMin(end) - reach);
    const Eigen::Vector2i high = cell_of(foot.cwiseMax(end) + reach);
    for (int y = low.y(); y <= high.y(); ++y) {
      for (int x = low.x(); x <= high.x(); ++x)
        near_[key({x, y})].push_back(static_cast<std::uint32_t>(i));
    }
  }
}

std::size_t TreeColumns::add(const Eigen::Vector3d& point, double height_m) {
  const Eigen::Vector2d place = point.head<2>();
  const auto near = near_.find(key(cell_of(place)));
  if (near == near_.end()) return kNone;
  std::size_t nearest = kNone;
  double least = kCrownReach * kCrownReach;
  for (const std::uint32_t i : near->second) {
    const double distance = (stem_place_at(stems_[i], height_m) - place).squaredNorm();
    if (distance >= least) continue;
    least = distance;
    nearest = i;
  }
  if (nearest == kNone) return kNone;
  Column& column = columns_[nearest];
  const double over_foot = std::max(0.0, point.z() - ground_m_[nearest]);
  const std::size_t metre = HeightColumn::metre_of(over_foot);
  ++column.points[metre];
  column.highest_m[metre] = std::max(column.highest_m[metre], static_cast<float>(over_foot));
  const auto decimetre = static_cast<std::size_t>(decimetre_of(over_foot));
  count_one(column.decimetres[decimetre]);
  if (least < kCoreRadius * kCoreRadius) count_one(column.core[decimetre]);
  return nearest;
}

double TreeColumns::top(std::size_t stem, double slices_end_m, bool low_tops) const {
  const double all = top_with_neighbours(stem, slices_end_m, low_tops);
  if (!(all > slices_end_m)) return all;
  const double own = core_end(stem, slices_end_m);
  const double least_over = std::max(kLeastOver, kLeastOverShare * all);
  if (all - own <= least_over || own <= kLeastSlenderness * 2.0 * stems_[stem].radius_m) return all;
  const Column& column = columns_[stem];
  const int begin = decimetre_of(own), end = decimetre_of(all) + 1;
  const double points = points_within(column.decimetres, begin, end);
  const double at_axis = points_within(column.core, begin, end);
  const bool overtopped = at_axis < kOwnCrownShare * points && has_thicker_neighbour(stem);
  return overtopped ? own : all;
}

double TreeColumns::core_end(std::size_t stem, double slices_end_m) const {
  const Counts& core = columns_[stem].core;
  const auto count = static_cast<int>(core.size());
  int last = decimetre_of(slices_end_m);
  for (int d = last; d < count; ++d) {
    if (core[static_cast<std::size_t>(d)] > 0) last = d;
    // What so many empty decimetres would hold, did the tree go on as below.
    const int expected = (d - last) * points_within(core, last + 1 - kBelowCore, last + 1);
    if (d - last > kCoreGap && expected >= kBelowCore * kCoreExpected) break;
  }
  return 0.1 * (last + 1);
}

bool TreeColumns::has_thicker_neighbour(std::size_t stem) const {
  const StemFit& own = stems_[stem];
  return std::any_of(stems_.begin(), stems_.end(), [&](const StemFit& other) {
    return kThicker * other.radius_m > own.radius_m &&
           (other.centre - own.centre).squaredNorm() < kOvertopReach * kOvertopReach;
  });
}

double TreeColumns::top_with_neighbours(std::size_t stem, double slices_end_m,
                                        bool low_tops) const {
  const double high = high_top(stem, slices_end_m);
  const bool thin = stems_[stem].in_foliage || stems_[stem].radius_m <= kLowTreeRadius;
  if (!low_tops || !thin) return high;
  const double low = low_top(stem);
  // The crown of a young tree begins at its foot, and a gap above it leads to another's. Elsewhere
  // a gap may be a stem of few points.
  const bool ends_low =
      stems_[stem].in_foliage ? low < slices_end_m + kLeastAbove : std::isnan(high);
  return ends_low ? low : high;
}

double TreeColumns::high_top(std::size_t stem, double slices_end_m) const {
  const Column& column = columns_[stem];
  const int first = static_cast<int>(slices_end_m);
  const int end = column.connected_end(first, kLargestGap);
  if (end <= first) return std::numeric_limits<double>::quiet_NaN();
  const auto height =
      static_cast<double>(column.highest_m[static_cast<std::size_t>(column.top(first, end))]);
  return height >= slices_end_m + kLeastAbove ? height : std::numeric_limits<double>::quiet_NaN();
}

double TreeColumns::low_top(std::size_t stem) const {
  const Column& column = columns_[stem];
  const int begin = decimetre_of(stems_[stem].lowest_m);
  int last = begin;
  for (int d = begin; d <= last + kLowGap && d < static_cast<int>(column.decimetres.size()); ++d) {
    if (column.decimetres[static_cast<std::size_t>(d)] > 0) last = d;
  }
  // To a decimetre; to the point itself where no other one is above it in its metre.
  const double end = 0.1 * (last + 1);
  const auto highest = static_cast<double>(column.highest_m[HeightColumn::metre_of(0.1 * last)]);
  return std::min(end, std::max(highest, end - 0.05));
}

int TreeColumns::points_below(std::size_t stem, double height_m, int decimetres) const {
  const int end = decimetre_of(height_m) + 1;
  return points_within(columns_[stem].decimetres, end - decimetres, end);
}

int TreeColumns::points_above(std::size_t stem, double height_m, int decimetres,
                              bool overtopped) const {
  const int begin = decimetre_of(height_m) + 1;
  const Column& column = columns_[stem];
  return points_within(overtopped ? column.core : column.decimetres, begin, begin + decimetres);
}

int TreeColumns::points_within(const Counts& counts, int begin, int end) {
  int points = 0;
  for (int d = std::max(0, begin); d < std::min(end, static_cast<int>(counts.size())); ++d)
    points += counts[static_cast<std::size_t>(d)];
  return points;
}

}  // namespace understory
