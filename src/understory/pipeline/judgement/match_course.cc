#include "understory/pipeline/judgement/match_course.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "understory/pipeline/pipeline_constants.h"

namespace understory {
namespace {

using namespace pipeline_constants::match_course;

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double rms(const std::vector<double>& squares, std::size_t begin, std::size_t end) {
  double sum = 0.0;
  for (std::size_t i = begin; i < end; ++i)
    sum += squares[i];
  return std::sqrt(sum / static_cast<double>(end - begin));
}

double share_of(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

}  // namespace

void MatchCourse::add(TimeNs stamp, bool matched, double inlier_ratio, double fitness_m2) {
  if (windows_.empty()) first_ = stamp;
  Window& window = windows_[(stamp - first_) / kWindow];
  ++window.scans;
  if (!matched) return;
  ++window.matched;
  window.inliers += inlier_ratio;
  window.squares_m2 += fitness_m2;
}

void MatchCourse::put(MatchEvidence& evidence) const {
  std::vector<double> inliers;
  std::vector<double> squares;  // of the windows with a match
  for (auto it = windows_.lower_bound(kFirstWindow); it != windows_.end(); ++it) {
    const Window& window = it->second;
    inliers.push_back(window.inliers / static_cast<double>(window.scans));
    if (window.matched > 0)
      squares.push_back(window.squares_m2 / static_cast<double>(window.matched));
  }
  if (inliers.empty()) return;
  const double few = std::max(kFewInliers, kFewOfUsual * median(inliers));
  const auto fewer =
      std::count_if(inliers.begin(), inliers.end(), [&](double x) { return x < few; });
  evidence.few_share = share_of(static_cast<std::size_t>(fewer), inliers.size());
  const double chance = kByChance * reach_m_;
  const auto by_chance =
      std::count_if(squares.begin(), squares.end(), [&](double x) { return x > chance * chance; });
  evidence.chance_share = share_of(static_cast<std::size_t>(by_chance), squares.size());
  const std::size_t third = squares.size() / 3;
  if (third == 0) return;
  const double early = rms(squares, 0, third);
  if (early > 0.0)
    evidence.blur_growth = rms(squares, squares.size() - third, squares.size()) / early;
}

}  // namespace understory
