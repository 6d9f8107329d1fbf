#include "understory/registration/global/range_view.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "understory/registration/global/global_constants.h"

namespace understory {
namespace {

using namespace registration_constants::range_view;

constexpr int kColumns = 360;
constexpr int kRows = 180;

}  // namespace

int RangeView::pixel_of(const Eigen::Vector3f& from_eye, float range) const {
  constexpr auto kPerRadian = static_cast<float>(180.0 / M_PI);
  const float azimuth = std::atan2(from_eye.y(), from_eye.x()) * kPerRadian + 180.0F;
  const float elevation = std::asin(std::clamp(from_eye.z() / range, -1.0F, 1.0F)) * kPerRadian;
  const int column = std::clamp(static_cast<int>(azimuth), 0, kColumns - 1);
  const int row = std::clamp(static_cast<int>(elevation + 90.0F), 0, kRows - 1);
  return row * kColumns + column;
}

RangeView::RangeView(const Points& points, const Eigen::Vector3f& eye)
    : eye_(eye),
      pixels_(static_cast<std::size_t>(kColumns * kRows),
              {std::numeric_limits<float>::infinity(), 0.0F, 0}) {
  std::vector<std::pair<int, float>> seen;  // pixel and range
  const std::size_t step = points.size() / kMostPoints + 1;
  for (std::size_t i = 0; i < points.size(); i += step) {
    const Eigen::Vector3f ray = points[i] - eye_;
    const float range = ray.norm();
    if (!(range > kNearest && range < kFarthest)) continue;
    seen.emplace_back(pixel_of(ray, range), range);
    Pixel& pixel = pixels_[static_cast<std::size_t>(seen.back().first)];
    pixel.nearest = std::min(pixel.nearest, range);
    pixel.farthest = std::max(pixel.farthest, range);
    ++pixel.count;
  }
  std::size_t at_one_range = 0;
  for (const auto& [pixel, range] : seen)
    at_one_range += range < kOneRange * pixels_[static_cast<std::size_t>(pixel)].nearest ? 1 : 0;
  std::size_t nearest = 0;  // one of each pixel says nothing
  for (const Pixel& pixel : pixels_)
    nearest += pixel.count > 0 ? 1 : 0;
  const auto others = static_cast<double>(seen.size() - nearest);
  one_view_ = others > kFewestOthers &&
              static_cast<double>(at_one_range - nearest) > kOneViewShare * others;
}

RangeView::Sight RangeView::look(const Eigen::Vector3f& point) const {
  const Eigen::Vector3f ray = point - eye_;
  const float range = ray.norm();
  if (!(range > kNearest)) return Sight::kUnknown;
  const int pixel = pixel_of(ray, range);
  const int row = pixel / kColumns;
  const int column = pixel % kColumns;
  float nearest = std::numeric_limits<float>::infinity();
  float farthest = 0.0F;
  int seen = 0;
  for (int dy = -1; dy <= 1; ++dy) {
    if (row + dy < 0 || row + dy >= kRows) continue;
    for (int dx = -1; dx <= 1; ++dx) {
      const int beside = (column + dx + kColumns) % kColumns;
      const Pixel& there = pixels_[static_cast<std::size_t>((row + dy) * kColumns + beside)];
      if (there.count == 0) continue;
      ++seen;
      nearest = std::min(nearest, there.nearest);
      farthest = std::max(farthest, there.farthest);
    }
  }
  if (seen < kLeastSeen) return Sight::kUnknown;
  const float margin = std::max(kMargin, kMarginShare * range);
  if (range < nearest - margin) return Sight::kSeenThrough;
  return range < farthest + margin ? Sight::kSeen : Sight::kUnknown;
}

}  // namespace understory
