#include "understory/forest/stems/not_a_tree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "understory/forest/stem_constants.h"
#include "understory/forest/stems/stem_axis.h"

namespace understory {
namespace {

using namespace stem_constants::not_a_tree;

// A tree goes on upwards. A stem that ends low, with nothing above it near its axis, is no tree.
// This holds only where the heights above were in view, as points around show.
bool ends_low(const StemFit& stem, const PointsNear& near, const StemDetectorConfig& config) {
  if (stem.highest_m > kLowEnd || config.highest_m < kLowEnd + kLeastSpan) return false;
  const StemAxis axis(stem);
  const double from = stem.highest_m + kAboveEnd;
  int on = 0;
  int above = 0;
  int around = 0;
  near(stem.centre, kAroundReach, [&](const SlicePoint& point) {
    const auto height = static_cast<double>(point.height_m);
    const AxisPlace place = axis.place(point);
    if (height <= stem.highest_m) {
      on += std::abs(axis.surface_error(place)) <= kOnSurface ? 1 : 0;
    } else if (height > from) {
      const double off = place.distance_m - stem.radius_m;
      above += off <= kNearAxis ? 1 : 0;
      around += off > kNotNear && place.distance_m <= kAroundReach ? 1 : 0;
    }
  });
  const double span = std::max(stem.highest_m - stem.lowest_m, kLeastSpan);
  const double expected = on * (config.highest_m - from) / span;
  return expected >= kLeastExpected && around >= kAroundPoints && above <= kAboveShare * expected;
}

// Which sides of a stem were seen: its surface faces the scanner there.
class SeenSides {
 public:
  void add(const Eigen::Vector3d& outward) {
    sum_ += outward.head<2>();
    ++count_;
  }
  // Whether beams that pass over the stem go on to `off`, a place relative to its axis: away from
  // the sides that were seen. Any place does if all sides were seen.
  [[nodiscard]] bool is_behind(const Eigen::Vector2d& off) const {
    const double one_sided = sum_.norm() / std::max(1, count_);
    if (one_sided < kOneSided) return true;
    return off.dot(sum_) <= -kBehindCosine * off.norm() * sum_.norm();
  }

 private:
  Eigen::Vector2d sum_ = Eigen::Vector2d::Zero();
  int count_ = 0;
};

// The half metre below the end of a stem, and the one above it.
struct AtEnd {
  int below = 0;         // on the surface
  int above = 0;         // where the stem would go on
  int beside_below = 0;  // beside it, by up to kNearAxis
  int beside_above = 0;
  SeenSides sides;

  // The stem goes on neither straight nor shifted. What stands beside it hides no more of it above
  // than below: each beam that it stops leaves a point there.
  [[nodiscard]] bool is_sudden() const {
    return below >= kLeastExpected && above <= kAboveShare * below &&
           beside_above <= beside_below + kMoreBeside * below;
  }
};

AtEnd look_at_end(const StemFit& stem, const StemAxis& axis, const PointsNear& near) {
  AtEnd end;
  const double from = stem.highest_m + kAboveEnd;
  near(stem.centre, stem.radius_m + kLeanReach + kNearAxis, [&](const SlicePoint& point) {
    const auto height = static_cast<double>(point.height_m);
    const bool is_below = height <= stem.highest_m && height > stem.highest_m - kLeastSpan;
    const bool is_above = height > from && height <= from + kLeastSpan;
    if (!is_below && !is_above) return;
    const AxisPlace place = axis.place(point);
    const double off = place.distance_m - stem.radius_m;
    if (off > kNearAxis) return;
    if (off > kGoesOn) {
      ++(is_below ? end.beside_below : end.beside_above);
    } else if (is_above) {
      ++end.above;
    } else if (std::abs(axis.surface_error(place)) <= kOnSurface) {
      ++end.below;
      end.sides.add(place.outward);
    }
  });
  return end;
}

bool may_end_low(const StemFit& stem, const StemDetectorConfig& config) {
  return !stem.in_foliage && stem.highest_m <= kLowEnd &&
         config.highest_m >= stem.highest_m + kAboveEnd + kLeastSpan;
}

// A post ends suddenly: its last half metre is well seen, the next one is empty, and things behind
// it were seen through that. Branches may hang above. A stem that leaves the view shows ever fewer
// points before. Young trees within foliage do end low.
bool ends_suddenly(const StemFit& stem, const PointsNear& near, const StemDetectorConfig& config) {
  const double from = stem.highest_m + kAboveEnd;
  const double to = from + kLeastSpan;
  if (!may_end_low(stem, config)) return false;
  const StemAxis axis(stem);
  const AtEnd end = look_at_end(stem, axis, near);
  if (!end.is_sudden()) return false;
  int behind = 0;
  near(stem.centre, kBehindReach, [&](const SlicePoint& point) {
    const auto height = static_cast<double>(point.height_m);
    if (height <= from || height > to) return;
    const AxisPlace place = axis.place(point);
    if (place.distance_m - stem.radius_m <= kNotNear || place.distance_m > kBehindReach) return;
    behind += end.sides.is_behind(place.outward.head<2>()) ? 1 : 0;
  });
  return behind >= kAroundPoints;
}

// The points beside a stem as they lie in one vertical slab through it.
class Slab {
 public:
  // Along `direction`, its middle `offset` from the stem's axis.
  Slab(const StemFit& stem, const Eigen::Vector2d& direction, double offset)
      : stem_(stem), along_(direction), across_(-direction.y(), direction.x()), offset_(offset) {}

  void add(const Eigen::Vector2d& off_axis, double height_m) {
    const double across = off_axis.dot(across_) - offset_;
    const double along = off_axis.dot(along_);
    const double beside = std::abs(along) - stem_.radius_m - kBesideFrom;
    if (beside < 0.0 || beside >= kBesideLength) return;
    const std::size_t side = along > 0.0 ? 1 : 0;
    if (std::abs(across) > kSlabHalf) {
      off_[side] += std::abs(across) <= kSlabFar ? 1 : 0;
      return;
    }
    ++on_[side];
    const auto column = static_cast<std::size_t>(beside / kBesideLength * kColumns);
    const auto row = static_cast<std::size_t>(
        std::clamp((height_m - stem_.lowest_m) / span(), 0.0, 0.999) * kRows);
    filled_[side][std::min(row, kRows - 1) * kColumns + std::min(column, kColumns - 1)] = true;
  }

  // Whether one side of the slab is a wall: covered with points, and little else beside it.
  [[nodiscard]] bool is_wall() const {
    for (std::size_t side = 0; side < 2; ++side) {
      if (on_[side] < kWallPoints) continue;
      const auto filled = std::count(filled_[side].begin(), filled_[side].end(), true);
      if (static_cast<double>(filled) < kCovered * static_cast<double>(kRows * kColumns)) continue;
      // The slabs beside are together wider than the slab by this.
      constexpr double kWider = (kSlabFar - kSlabHalf) / kSlabHalf;
      if (static_cast<double>(off_[side]) <= kBesideShare * kWider * on_[side]) return true;
    }
    return false;
  }

 private:
  [[nodiscard]] double span() const { return std::max(stem_.highest_m - stem_.lowest_m, 0.1); }

  const StemFit& stem_;
  Eigen::Vector2d along_;
  Eigen::Vector2d across_;
  double offset_;
  std::array<int, 2> on_{};
  std::array<int, 2> off_{};
  std::array<std::array<bool, kRows * kColumns>, 2> filled_{};
};

// A wall, or one of a corner, whose plane touches or cuts the stem.
bool part_of_plane(const StemFit& stem, const PointsNear& near) {
  if (stem.highest_m - stem.lowest_m < kWallHeight) return false;
  struct Beside {
    Eigen::Vector2d off_axis;
    double height_m;
  };
  std::vector<Beside> points;
  const double reach = stem.radius_m + kBesideFrom + kBesideLength + kSlabFar;
  near(stem.centre, reach + kLeanReach, [&](const SlicePoint& point) {
    const auto height = static_cast<double>(point.height_m);
    if (height < stem.lowest_m || height > stem.highest_m) return;
    const Eigen::Vector2d place(static_cast<double>(point.x), static_cast<double>(point.y));
    const Eigen::Vector2d off = place - stem.centre - (height - kBreastHeight) * stem.slope;
    const double distance = off.norm();
    if (distance > stem.radius_m + kBesideFrom && distance <= reach)
      points.push_back({off, height});
  });
  if (points.size() < kRows * kColumns) return false;
  for (int turn = 0; turn < kTurns; ++turn) {
    const double angle = M_PI * turn / kTurns;
    const Eigen::Vector2d direction(std::cos(angle), std::sin(angle));
    const double farthest = stem.radius_m + kSlabHalf;
    const int steps = static_cast<int>(std::ceil(2.0 * farthest / kSlabHalf));
    for (int step = 0; step <= steps; ++step) {
      Slab slab(stem, direction, farthest * (2.0 * step / steps - 1.0));
      for (const Beside& point : points)
        slab.add(point.off_axis, point.height_m);
      if (slab.is_wall()) return true;
    }
  }
  return false;
}

}  // namespace

TreeDoubt doubt_of(const StemFit& stem, const PointsNear& near, const StemDetectorConfig& config) {
  if (ends_low(stem, near, config) || ends_suddenly(stem, near, config)) return TreeDoubt::kEndsLow;
  if (part_of_plane(stem, near)) return TreeDoubt::kPartOfPlane;
  return TreeDoubt::kNone;
}

int points_before_sudden_end(const StemFit& stem, const PointsNear& near,
                             const StemDetectorConfig& config) {
  if (!may_end_low(stem, config)) return 0;
  const AtEnd end = look_at_end(stem, StemAxis(stem), near);
  return end.is_sudden() ? end.below : 0;
}

}  // namespace understory
