#include "understory/graph/self_correction/stem_sights.h"

#include <algorithm>
#include <cmath>

#include "understory/graph/graph_constants.h"
#include "understory/odometry/stems/stem_levelling.h"

namespace understory {
namespace {

using namespace graph_constants::stem_sights;

// The value that a share of all does not exceed; infinite for none.
double usual_value(std::vector<double> values, double of_none) {
  if (values.empty()) return of_none;
  const auto at = static_cast<std::ptrdiff_t>(kShare * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

}  // namespace

void describe(ConfigTable& table, StemSightConfig& config) {
  table.add(
      "range_share", config.range_share, {0.0, 100.0}, "",
      "the map is made of stems within this share of the usual range; matching uses all stems");
  table.add("score_share", config.score_share, {0.0, 1.0}, "",
            "the map is made of stems with at least this share of a high score of the recording");
}

std::vector<StemView> map_sights(const std::vector<StemView>& views,
                                 const StemSightConfig& config) {
  std::vector<double> ranges;
  std::vector<double> scores;
  for (const StemView& view : views) {
    const Eigen::Vector3d up = up_of_axes(view);
    for (const Stem& stem : view.stems) {
      ranges.push_back(plane_range_m(stem, up));
      if (std::isfinite(stem.score)) scores.push_back(static_cast<double>(stem.score));
    }
  }
  const double farthest = config.range_share * usual_value(std::move(ranges), 0.0);
  const double lowest = config.score_share * usual_value(std::move(scores), 0.0);
  std::vector<StemView> result = views;
  for (StemView& view : result) {
    const Eigen::Vector3d up = up_of_axes(view);
    std::erase_if(view.stems, [&](const Stem& stem) {
      return plane_range_m(stem, up) > farthest || static_cast<double>(stem.score) < lowest;
    });
  }
  return result;
}

}  // namespace understory
