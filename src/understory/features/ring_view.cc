#include "understory/features/ring_view.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "understory/features/features_constants.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace features_constants::ring_view;

constexpr double kPi = std::numbers::pi;

double median_of(std::vector<double>& values, double share = 0.5) {
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace

RingView::RingView(const Scan& scan, const Eigen::Matrix3d& level_from_lidar, double max_range_m,
                   const std::vector<std::uint8_t>& use)
    : level_from_lidar_(level_from_lidar), covered_(360, 0) {
  gather(scan, use);
  if (rings_.size() < 2) return;
  calibrate();
  if (step_rad_ <= 0.0) return;
  for (int level = 0; level < levels(); ++level)
    cut(level, max_range_m);
}

void RingView::gather(const Scan& scan, const std::vector<std::uint8_t>& use) {
  UNDERSTORY_CHECK(use.empty() || use.size() == scan.points.size());
  std::uint16_t most = 0;
  for (const ScanPoint& point : scan.points)
    most = std::max(most, point.ring);
  std::vector<Ring> rings(static_cast<std::size_t>(most) + 1);
  const Eigen::Matrix3f turn = level_from_lidar_.cast<float>();
  points_.reserve(scan.points.size());
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    const ScanPoint& point = scan.points[i];
    if (point.return_index != 0) continue;
    const float range = std::hypot(point.x, point.y);
    if (!(range > 0.0F)) continue;
    const float azimuth = std::atan2(point.y, point.x);
    const bool used = use.empty() || use[i] != 0;
    rings[point.ring].returns.push_back(
        {azimuth, range, used ? static_cast<std::uint32_t>(points_.size()) : kOnlyHides,
         static_cast<float>(point.t_ns)});
    rings[point.ring].slope += static_cast<double>(point.z / range);
    if (used) points_.emplace_back(turn * Eigen::Vector3f(point.x, point.y, point.z));
    const int degree = static_cast<int>(std::floor(azimuth * (180.0F / static_cast<float>(kPi))));
    covered_[static_cast<std::size_t>((degree + 360) % 360)] = 1;
  }
  for (Ring& ring : rings) {
    if (ring.returns.size() < 3) continue;
    ring.slope /= static_cast<double>(ring.returns.size());
    const auto by_azimuth = [](const Return& a, const Return& b) {
      return a.azimuth != b.azimuth ? a.azimuth < b.azimuth : a.point < b.point;
    };
    // A ring comes in the order of its turning, one way or the other, begun anywhere.
    std::vector<Return>& returns = ring.returns;
    if (returns[returns.size() / 2].azimuth < returns[returns.size() / 2 - 1].azimuth)
      std::reverse(returns.begin(), returns.end());
    const auto lowest = std::min_element(returns.begin(), returns.end(), by_azimuth);
    std::rotate(returns.begin(), lowest, returns.end());
    if (!std::is_sorted(returns.begin(), returns.end(), by_azimuth))
      std::sort(returns.begin(), returns.end(), by_azimuth);
    rings_.push_back(std::move(ring));
  }
  std::sort(rings_.begin(), rings_.end(),
            [](const Ring& a, const Ring& b) { return a.slope < b.slope; });
}

// The step of azimuth between firings, and the noise along the beam from the bends of smooth runs.
void RingView::calibrate() {
  std::vector<double> steps;
  for (const Ring& ring : rings_) {
    for (std::size_t i = 1; i < ring.returns.size(); ++i) {
      const double step =
          static_cast<double>(ring.returns[i].azimuth - ring.returns[i - 1].azimuth);
      if (step > 1e-5) steps.push_back(step);
    }
  }
  if (steps.size() < kFewestSteps) return;
  const double low = median_of(steps, kUsualQuantile);
  std::erase_if(steps, [&](double step) { return step > kMostSteps * low; });
  step_rad_ = median_of(steps);
  std::vector<double> bends;
  for (const Ring& ring : rings_) {
    for (std::size_t i = 2; i < ring.returns.size(); ++i) {
      const Return& a = ring.returns[i - 2];
      const Return& c = ring.returns[i];
      if (static_cast<double>(c.azimuth - a.azimuth) > kBendSteps * step_rad_) continue;
      const double bend = static_cast<double>(a.range - 2.0F * ring.returns[i - 1].range + c.range);
      if (std::abs(bend) < kMostBend) bends.push_back(std::abs(bend));
    }
  }
  // A bend of independent errors has sqrt(6) times their spread; 0.67 is the median of |normal|.
  range_sd_m_ = bends.size() < kFewestSteps ? kMostRangeSd
                                            : median_of(bends) / (kNormalMedian * std::sqrt(6.0));
  range_sd_m_ = std::clamp(range_sd_m_, kLeastRangeSd, kMostRangeSd);
}

// Whether two returns of a ring that follow each other may lie on one stem. Its depth falls by up
// to its radius from its middle to its edge, the faster the wider the step.
bool RingView::linked(const Return& a, const Return& b) const {
  if (a.only_hides() || b.only_hides()) return false;
  const auto step = static_cast<float>(step_rad_);
  if (b.azimuth - a.azimuth > kBridged * step) return false;
  const float spacing = step * std::min(a.range, b.range);
  const float most = std::min(
      kMostLink, kLinkSds * static_cast<float>(range_sd_m_) + kLinkDepth * std::sqrt(spacing));
  return std::abs(b.range - a.range) <= most;
}

void RingView::cut(int level, double max_range_m) {
  const std::vector<Return>& returns = rings_[static_cast<std::size_t>(level)].returns;
  std::size_t begin = 0;
  for (std::size_t i = 1; i <= returns.size(); ++i) {
    if (i < returns.size() && linked(returns[i - 1], returns[i])) continue;
    if (!returns[begin].only_hides() && static_cast<double>(returns[begin].range) <= max_range_m)
      add_section(level, begin, i);
    begin = i;
  }
}

Side RingView::side(const Ring& ring, std::size_t at, int direction) const {
  const bool last = direction > 0 ? at + 1 == ring.returns.size() : at == 0;
  if (last) return Side::kOpen;
  const Return& edge = ring.returns[at];
  const Return& beside = ring.returns[direction > 0 ? at + 1 : at - 1];
  if (std::abs(beside.azimuth - edge.azimuth) > kGap * static_cast<float>(step_rad_))
    return Side::kOpen;
  const float depth = beside.range - edge.range;
  if (depth < 0.0F) return Side::kHidden;
  return static_cast<double>(depth) > kRoughDepth ? Side::kOpen : Side::kRough;
}

void RingView::add_section(int level, std::size_t begin, std::size_t end) {
  const Ring& ring = rings_[static_cast<std::size_t>(level)];
  const Return& first = ring.returns[begin];
  const Return& last = ring.returns[end - 1];
  double range = 0.0;
  double height = 0.0;
  double time = 0.0;
  double level_range = 0.0;
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (std::size_t i = begin; i < end; ++i) {
    const Eigen::Vector3d point = points_[ring.returns[i].point].cast<double>();
    range += static_cast<double>(ring.returns[i].range);
    height += point.z();
    level_range += point.head<2>().norm();
    time += static_cast<double>(ring.returns[i].t_ns);
  }
  middle = points_[first.point].head<2>().cast<double>().normalized() +
           points_[last.point].head<2>().cast<double>().normalized();
  const auto n = static_cast<double>(end - begin);
  StemSection section;
  section.spacing_m = step_rad_ * range / n;
  section.width_m =
      static_cast<double>(last.azimuth - first.azimuth) * range / n + section.spacing_m;
  if (section.width_m > kWidest) return;
  section.sight = middle.normalized();
  section.range_m = level_range / n;
  section.surface = section.range_m * section.sight;
  section.height_m = height / n;
  section.right = side(ring, begin, -1);
  section.left = side(ring, end - 1, 1);
  section.returns = static_cast<int>(end - begin);
  section.level = level;
  section.t_ns = static_cast<float>(time / n);
  sections_.push_back(section);
}

double RingView::height_at(int level, const Eigen::Vector2d& place) const {
  const double slope = rings_[static_cast<std::size_t>(level)].slope;
  const double height = slope * place.norm();
  // One step of Newton's method from an upright sensor: good to millimetres for tilts of degrees.
  const Eigen::Vector3d at =
      level_from_lidar_.transpose() * Eigen::Vector3d(place.x(), place.y(), height);
  return height + (slope * at.head<2>().norm() - at.z()) / level_from_lidar_(2, 2);
}

bool RingView::covered(double azimuth) const {
  const int degree = static_cast<int>(std::floor(azimuth * 180.0 / kPi));
  return covered_[static_cast<std::size_t>((degree + 360) % 360)] != 0;
}

Sight RingView::look(int level, const Eigen::Vector2d& place, double half_width_m) const {
  const Ring& ring = rings_[static_cast<std::size_t>(level)];
  const Eigen::Vector3d at = level_from_lidar_.transpose() *
                             Eigen::Vector3d(place.x(), place.y(), height_at(level, place));
  const double range = at.head<2>().norm();
  const double azimuth = std::atan2(at.y(), at.x());
  const double half = half_width_m / std::max(range, 0.1);
  if (!covered(azimuth)) return Sight::kUnknown;
  const auto from =
      std::lower_bound(ring.returns.begin(), ring.returns.end(), static_cast<float>(azimuth - half),
                       [](const Return& a, float value) { return a.azimuth < value; });
  bool hidden = false;
  bool passed = false;
  auto to = from;
  for (; to != ring.returns.end() && static_cast<double>(to->azimuth) <= azimuth + half; ++to) {
    const double depth = static_cast<double>(to->range) - range;
    if (std::abs(depth) <= kDepthMargin && !to->only_hides()) return Sight::kHit;
    (depth < 0.0 ? hidden : passed) = true;
  }
  if (hidden) return Sight::kHidden;
  if (passed) return Sight::kPassed;
  // No return: either no beam went there, or nothing sent it back.
  const double before =
      from == ring.returns.begin() ? -2.0 * kPi : static_cast<double>((from - 1)->azimuth);
  const double after = to == ring.returns.end() ? 2.0 * kPi : static_cast<double>(to->azimuth);
  const bool missing = azimuth + half - before > step_rad_ &&
                       after - (azimuth - half) > step_rad_ &&
                       after - before > static_cast<double>(kGap) * step_rad_;
  return missing ? Sight::kPassed : Sight::kUnknown;
}

}  // namespace understory
