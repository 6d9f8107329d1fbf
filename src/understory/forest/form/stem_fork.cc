#include "understory/forest/form/stem_fork.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "understory/forest/search/circle_search.h"
#include "understory/forest/search/ring_linker.h"
#include "understory/forest/stem_curve_constants.h"

namespace understory {
namespace {

using namespace stem_constants::stem_fork;

// The section of the stem at a height; the nearest one where there is none.
const CurveSection& section_at(const StemCurve& curve, double height_m) {
  const auto last = static_cast<double>(curve.sections.size() - 1);
  const double number = std::clamp(std::round(height_m / kSectionStep), 0.0, last);
  return curve.sections[static_cast<std::size_t>(number)];
}

using Slices = std::vector<std::vector<Eigen::Vector2f>>;

std::size_t slice_of(double height_m) {
  return static_cast<std::size_t>((height_m - kLowest) / kSlice);
}

Eigen::Vector2d off_axis(const SlicePoint& point, const CurveSection& stem) {
  return Eigen::Vector2d(static_cast<double>(point.x), static_cast<double>(point.y)) - stem.centre;
}

// How far a point lies outside of the surface of the stem; negative inside.
double beside(const SlicePoint& point, const CurveSection& stem) {
  return off_axis(point, stem).norm() - 0.5 * stem.diameter_m;
}

// The points beside the stem in slices one above the other, relative to its centre line.
Slices slices_beside(const std::vector<SlicePoint>& points, const StemCurve& curve, double end_m) {
  Slices slices(static_cast<std::size_t>((end_m - kLowest) / kSlice));
  for (const SlicePoint& point : points) {
    const double height = static_cast<double>(point.height_m);
    if (height < kLowest || slice_of(height) >= slices.size()) continue;
    const CurveSection& stem = section_at(curve, height);
    const double distance = beside(point, stem);
    if (distance > kBark && distance < kReach)
      slices[slice_of(height)].emplace_back(off_axis(point, stem).cast<float>());
  }
  return slices;
}

// Sections that may be of a second stem.
std::vector<Ring> rings_beside(const Slices& slices, const StemCurve& curve) {
  CircleSearchConfig search;
  const double radius = 0.5 * section_at(curve, kLowest).diameter_m;
  search.min_radius_m = std::max(kThinnest, kLeastShare * radius);
  search.max_radius_m = std::max(2.0 * kThinnest, kMostShare * radius);
  const std::vector<std::vector<Circle>> circles = find_circles(slices, search, kSeed);
  std::vector<Ring> rings;
  for (std::size_t i = 0; i < circles.size(); ++i) {
    const double height = kLowest + (static_cast<double>(i) + 0.5) * kSlice;
    const double stem = 0.5 * section_at(curve, height).diameter_m;
    for (const Circle& circle : circles[i]) {
      if (circle.centre.norm() < kLeastApart * (stem + circle.radius_m) ||
          circle.radius_m < kLeastShare * stem || circle.inside > kMostInside * circle.on)
        continue;
      rings.push_back({circle, height, static_cast<int>(i)});
    }
  }
  return rings;
}

// A second stem as its rings show it, upwards.
class Offshoot {
 public:
  Offshoot(std::vector<StemSlice> rings, const StemCurve& curve) : rings_(std::move(rings)) {
    std::sort(rings_.begin(), rings_.end(),
              [](const StemSlice& a, const StemSlice& b) { return a.height_m < b.height_m; });
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();
    for (const StemSlice& ring : rings_)
      middle += place_of(ring);
    aside_ = middle.normalized();
    const double bark = 0.5 * section_at(curve, from_m()).diameter_m;
    fit_line(middle.dot(aside_) / count() - bark);
  }

  // What it gains of distance from the stem per metre of height.
  [[nodiscard]] double slope() const { return slope_; }
  [[nodiscard]] StemFork fork() const {
    return {leaves_m_, from_m(), static_cast<double>(rings_.back().height_m)};
  }
  [[nodiscard]] double from_m() const { return static_cast<double>(rings_.front().height_m); }

  // How much speaks for a second stem: the logarithm of its odds. `of_stem`: points on the stem
  // itself, by slice.
  [[nodiscard]] double evidence(const Slices& slices, const std::vector<int>& of_stem) const {
    double on = 0.0;
    double outside = 0.0;
    double on_stem = 0.0;
    double off_line = 0.0;
    const Eigen::Vector2d across(-aside_.y(), aside_.x());
    for (const StemSlice& ring : rings_) {
      const std::size_t slice = slice_of(static_cast<double>(ring.height_m));
      on_stem += of_stem[slice];
      off_line += std::pow(across.dot(place_of(ring)), 2) / count();
      for (const Eigen::Vector2f& point : slices[slice]) {
        const double off =
            (point.cast<double>() - place_of(ring)).norm() - static_cast<double>(ring.radius_m);
        on += std::abs(off) < kBand ? 1.0 : 0.0;
        outside += off >= kBand && off < kAround ? 1.0 : 0.0;
      }
    }
    const double seen =
        1.0 + std::round((static_cast<double>(rings_.back().height_m) - from_m()) / kSlice);
    const double share = std::min(kFullShare, on / std::max(1.0, on_stem));
    return kBase + kByCount * std::log(count()) + kByFill * count() / seen +
           kByOffLine * std::min(kMostOffLine, std::sqrt(off_line)) +
           kByPoints * std::log(std::max(1.0, on) / count()) +
           kByOutside * std::log(kLittle + outside / std::max(1.0, on)) +
           kByShare * std::log(kLittleShare + share);
  }

 private:
  static Eigen::Vector2d place_of(const StemSlice& ring) {
    return {static_cast<double>(ring.x), static_cast<double>(ring.y)};
  }
  [[nodiscard]] double count() const { return static_cast<double>(rings_.size()); }

  // Of the distances from the stem by least squares.
  void fit_line(double mean_beside) {
    double mean_height = 0.0;
    for (const StemSlice& ring : rings_)
      mean_height += static_cast<double>(ring.height_m) / count();
    double square = 0.0;
    double product = 0.0;
    for (const StemSlice& ring : rings_) {
      const double rise = static_cast<double>(ring.height_m) - mean_height;
      square += rise * rise;
      product += rise * aside_.dot(place_of(ring));
    }
    slope_ = square > 0.0 ? product / square : 0.0;
    if (slope_ > 0.0) leaves_m_ = mean_height - mean_beside / slope_;
  }

  std::vector<StemSlice> rings_;
  Eigen::Vector2d aside_ = Eigen::Vector2d::Zero();
  double slope_ = 0.0;
  double leaves_m_ = 0.0;  // height at which its line leaves the surface of the stem
};

// Points on the surface of the stem, by slice.
std::vector<int> points_of_stem(const std::vector<SlicePoint>& points, const StemCurve& curve,
                                std::size_t slices) {
  std::vector<int> of_stem(slices, 0);
  for (const SlicePoint& point : points) {
    const double height = static_cast<double>(point.height_m);
    if (height < kLowest || slice_of(height) >= slices) continue;
    if (std::abs(beside(point, section_at(curve, height))) < kBand) ++of_stem[slice_of(height)];
  }
  return of_stem;
}

}  // namespace

std::optional<StemFork> find_fork(const std::vector<SlicePoint>& points, const StemCurve& curve) {
  if (curve.sections.empty() || !std::isfinite(curve.measured_to_m)) return std::nullopt;
  const double end_m = std::min(kHighest, curve.measured_to_m + kBeyond);
  if (end_m < kLowest + kFewestSlices * kSlice) return std::nullopt;
  const Slices slices = slices_beside(points, curve, end_m);
  const std::vector<int> of_stem = points_of_stem(points, curve, slices.size());
  std::optional<StemFork> lowest;
  for (const StemFit& line : link_rings(rings_beside(slices, curve), kFewestSlices, kMostLeanDeg)) {
    const Offshoot offshoot(line.slices, curve);
    const StemFork fork = offshoot.fork();
    if (offshoot.slope() < kLeastSlope || fork.height_m < kLowestFork ||
        fork.from_m - fork.height_m > kLongestHidden ||
        offshoot.evidence(slices, of_stem) < kLeastEvidence)
      continue;
    if (!lowest || fork.height_m < lowest->height_m) lowest = fork;
  }
  return lowest;
}

}  // namespace understory
