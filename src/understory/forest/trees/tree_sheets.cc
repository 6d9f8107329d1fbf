#include "understory/forest/trees/tree_sheets.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <unordered_map>
#include <utility>

#include "understory/forest/forest_constants.h"
#include "understory/forest/stems/stem_axis.h"
#include "understory/forest/trees/tree_doubt.h"
#include "understory/forest/trees/tree_heights.h"
#include "understory/sensor/tree.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace forest_constants::tree_sheets;

constexpr double kBytes = 127.0;  // steps on each side that an std::int8_t has

// Well mixed bits of three whole numbers (the finishing steps of a common integer hash).
std::uint32_t mixed(std::int32_t x, std::int32_t y, std::int32_t z) {
  std::uint64_t h = static_cast<std::uint32_t>(x) * 0x9e3779b97f4a7c15ULL;
  h = (h ^ h >> 29 ^ static_cast<std::uint32_t>(y)) * 0xbf58476d1ce4e5b9ULL;
  h = (h ^ h >> 32 ^ static_cast<std::uint32_t>(z)) * 0x94d049bb133111ebULL;
  return static_cast<std::uint32_t>(h >> 32);
}

double reach_of(const StemFit& stem) {
  return stem.radius_m + kAround;
}

// Which stems lie near a place.
class StemSquares {
 public:
  explicit StemSquares(const std::vector<StemFit>& stems) {
    for (std::size_t i = 0; i < stems.size(); ++i) {
      const double reach = reach_of(stems[i]) + stems[i].slope.norm();
      for (auto y = cell(stems[i].centre.y() - reach); y <= cell(stems[i].centre.y() + reach); ++y)
        for (auto x = cell(stems[i].centre.x() - reach); x <= cell(stems[i].centre.x() + reach);
             ++x)
          near_[key(x, y)].push_back(i);
    }
  }
  // Null if none does.
  [[nodiscard]] const std::vector<std::size_t>* near(double x, double y) const {
    const auto found = near_.find(key(cell(x), cell(y)));
    return found == near_.end() ? nullptr : &found->second;
  }

 private:
  static std::int32_t cell(double metres) { return static_cast<std::int32_t>(std::floor(metres)); }
  static std::uint64_t key(std::int32_t x, std::int32_t y) {
    return static_cast<std::uint64_t>(static_cast<std::uint32_t>(x)) << 32 |
           static_cast<std::uint32_t>(y);
  }
  std::unordered_map<std::uint64_t, std::vector<std::size_t>> near_;
};

std::int32_t millimetres(float metres) {
  return static_cast<std::int32_t>(std::lround(1e3 * static_cast<double>(metres)));
}

// A tree as the doubt needs it, before its height is known.
double doubt_of_stem(const StemFit& stem) {
  if (stem.in_foliage) return 0.0;  // there are many, and a sheet shows foliage
  Tree tree;
  tree.dbh_m = 2.0 * stem.radius_m;
  tree.dbh_sd_m = 2.0 * std::sqrt(std::max(0.0, stem.covariance(2, 2)));
  return doubt_of(tree, stem.arc_deg);
}

std::size_t side_of(const Eigen::Vector2d& from_axis) {
  const double turn = std::atan2(from_axis.y(), from_axis.x()) / (2.0 * std::numbers::pi);
  const auto side = static_cast<int>(std::floor((turn < 0.0 ? turn + 1.0 : turn) * 36.0));
  return static_cast<std::size_t>(std::clamp(side, 0, 35));
}

}  // namespace

void PointSample::settle() {
  std::sort(points_.begin(), points_.end());
  points_.erase(std::unique(points_.begin(), points_.end()), points_.end());
  if (points_.size() < most_) return;
  points_.resize(most_);
  full_ = true;
  last_ = points_.back();
}

std::vector<PointSample::Point> PointSample::take() {
  settle();
  return std::move(points_);
}

std::vector<char> most_doubtful(const std::vector<StemFit>& stems) {
  std::vector<char> chosen(stems.size(), 1);
  if (stems.size() <= kMostSheets) return chosen;
  std::vector<std::size_t> order(stems.size());
  for (std::size_t i = 0; i < order.size(); ++i)
    order[i] = i;
  sort_stably(order, [&](std::size_t a, std::size_t b) {
    return doubt_of_stem(stems[a]) > doubt_of_stem(stems[b]);
  });
  for (std::size_t k = kMostSheets; k < order.size(); ++k)
    chosen[order[k]] = 0;
  return chosen;
}

SheetCollector::SheetCollector(const std::vector<StemFit>& stems,
                               const std::vector<SlicePoint>& slices,
                               const std::vector<char>& with_sheet)
    : stems_(stems), seen_(stems.size()), sheet_of_(stems.size(), -1) {
  choose(with_sheet);
  look_at_slices(slices);
}

void SheetCollector::choose(const std::vector<char>& with_sheet) {
  for (std::size_t stem = 0; stem < stems_.size(); ++stem) {
    if (with_sheet[stem] == 0) continue;
    sheet_of_[stem] = static_cast<std::int32_t>(sheets_.size());
    sheets_.push_back(
        {stem, PointSample(kNearPoints), PointSample(kAroundPoints), PointSample(kSectionPoints)});
  }
}

void SheetCollector::look_at_slices(const std::vector<SlicePoint>& slices) {
  const StemSquares squares(stems_);
  for (const SlicePoint& point : slices) {
    if (point.height_m < kCrossLow || point.height_m > kCrossHigh) continue;
    const auto* near = squares.near(static_cast<double>(point.x), static_cast<double>(point.y));
    if (near == nullptr) continue;
    for (const std::size_t i : *near) {
      const StemFit& stem = stems_[i];
      const double rise = static_cast<double>(point.height_m) - kBreastHeight;
      const Eigen::Vector2d from_axis =
          Eigen::Vector2d(static_cast<double>(point.x), static_cast<double>(point.y)) -
          stem.centre - rise * stem.slope;
      const double reach = reach_of(stem);
      if (from_axis.cwiseAbs().maxCoeff() > reach) continue;
      const double off = std::abs(from_axis.norm() - stem.radius_m - rise * stem.taper);
      if (off < std::max(kOnSurface, 2.0 * stem.rms_m)) seen_[i].set(side_of(from_axis));
      if (sheet_of_[i] < 0) continue;
      const auto hash =
          mixed(millimetres(point.x), millimetres(point.y), millimetres(point.height_m));
      sheets_[static_cast<std::size_t>(sheet_of_[i])].section.add(
          {hash, static_cast<std::int8_t>(std::lround(from_axis.x() / reach * kBytes)),
           static_cast<std::int8_t>(std::lround(from_axis.y() / reach * kBytes)), 0});
    }
  }
}

void SheetCollector::add(std::size_t stem, const Eigen::Vector2d& place, double height_m) {
  const std::int32_t sheet = sheet_of_[stem];
  if (sheet < 0) return;
  const StemFit& fit = stems_[stem];
  const Eigen::Vector2d from_foot = place - stem_place_at(fit, 0.0);
  const Eigen::Vector2d cube = (from_foot / kCube).array().floor();
  if (cube.cwiseAbs().maxCoeff() > kBytes) return;
  const auto x = static_cast<std::int32_t>(cube.x());
  const auto y = static_cast<std::int32_t>(cube.y());
  const auto z = static_cast<std::int32_t>(height_m / kCube);
  const PointSample::Point point{mixed(x, y, z), static_cast<std::int8_t>(x),
                                 static_cast<std::int8_t>(y), static_cast<std::uint16_t>(z)};
  // By the cube's middle, so that all points of a cube count alike.
  const Eigen::Vector3d middle = cube_middle(point);
  const double away =
      (stem_place_at(fit, 0.0) + middle.head<2>() - stem_place_at(fit, middle.z())).norm();
  Gathered& gathered = sheets_[static_cast<std::size_t>(sheet)];
  (away < fit.radius_m + kNear ? gathered.near : gathered.around).add(point);
}

Eigen::Vector3d SheetCollector::cube_middle(const PointSample::Point& point) {
  return kCube * (Eigen::Vector3d(point.x, point.y, point.z) + Eigen::Vector3d::Constant(0.5));
}

std::vector<TreeSheet> SheetCollector::take() {
  std::vector<TreeSheet> sheets;
  for (Gathered& gathered : sheets_) {
    TreeSheet sheet;
    sheet.tree = gathered.stem;
    sheet.section_reach_m = reach_of(stems_[gathered.stem]);
    sheet.seen = seen_[gathered.stem];
    for (PointSample* sample : {&gathered.around, &gathered.near}) {
      for (const PointSample::Point& point : sample->take()) {
        const Eigen::Vector3d middle = cube_middle(point);
        sheet.front.push_back({middle.cast<float>(), sample == &gathered.near, true});
      }
    }
    for (const PointSample::Point& point : gathered.section.take())
      sheet.section.push_back(
          (sheet.section_reach_m / kBytes * Eigen::Vector2d(point.x, point.y)).cast<float>());
    sheets.push_back(std::move(sheet));
  }
  sheets_.clear();
  return sheets;
}

}  // namespace understory
