#include "understory/forest/inventory_remarks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "understory/forest/forest_constants.h"

namespace understory {
namespace {

using namespace forest_constants::inventory;

// Why few points lie near breast height, in the mean over the area. Points on a square metre there,
// and at all heights.
std::string density_remark(double near_breast, double per_m2, const StemDetectorConfig& stems,
                           const InventoryResult& result) {
  if (result.open_land)
    return fmt::format(
        "Only {:.1f} of {:.0f} returns per square metre lie between {} and {} m above the ground, "
        "as hardly anything stands there. The cloud is dense on {:.0f} % of the area; elsewhere "
        "trees may be missing from the list.",
        near_breast, per_m2, stems.lowest_m, stems.highest_m, 100.0 * result.thin.dense_share);
  return fmt::format(
      "Only {:.1f} returns per square metre lie between {} and {} m above the ground ({:.0f} of "
      "all "
      "heights): too few to see stems reliably. Trees are missing from the list; the terrain and "
      "canopy models are not affected.",
      near_breast, stems.lowest_m, stems.highest_m, per_m2);
}

void remark_on_stems(const StemHarvest& gathered, const InventoryConfig& config,
                     const InventoryResult& result, std::vector<std::string>& remarks) {
  const double area_m2 = std::max(1.0, result.area_m2);
  const double per_m2 = static_cast<double>(gathered.points) / area_m2;
  const std::uint64_t returns = gathered.near_breast;
  const double near_breast = static_cast<double>(returns) / area_m2;
  const std::size_t by_crown = result.trees.size() - result.stems.size();
  if (by_crown > 0)
    remarks.push_back(fmt::format(
        "{} trees were found by their crowns alone ({:.1f} returns per square metre lie between {} "
        "and {} m above the ground, {:.0f} at all heights). They have no diameter. Trees below "
        "other crowns are not in the list.",
        by_crown, near_breast, config.stems.lowest_m, config.stems.highest_m, per_m2));
  if (by_crown > 0 && result.from_above) return;
  if (returns == 0) {
    remarks.push_back(fmt::format(
        "No point lies between {} and {} m above the lowest points. The ground below the trees is "
        "missing from the cloud, or the cloud is a cut at another height.",
        config.stems.lowest_m, config.stems.highest_m));
  } else if (result.too_sparse) {
    remarks.push_back(density_remark(near_breast, per_m2, config.stems, result));
  }
}

}  // namespace

std::vector<std::string> remarks_on(const StemHarvest& gathered, const InventoryConfig& config,
                                    const InventoryResult& result) {
  std::vector<std::string> remarks;
  remark_on_stems(gathered, config, result, remarks);
  if (result.ground.measured_share < kLeastMeasured) {
    remarks.push_back(fmt::format(
        "Ground was seen in only {:.0f} % of the terrain model's cells; between them it is "
        "interpolated{}.",
        100.0 * result.ground.measured_share,
        result.stems.empty() ? "" : ", and with it the height at which diameters are taken"));
  }
  if (gathered.without_ground * 50 > gathered.points) {
    remarks.push_back(fmt::format(
        "{:.0f} % of the points lie where no ground was seen within {} m; they were left out.",
        100.0 * static_cast<double>(gathered.without_ground) / static_cast<double>(gathered.points),
        config.ground.max_gap_m));
  }
  std::size_t no_top = 0;
  for (const Tree& tree : result.trees)
    no_top += std::isnan(tree.height_m) ? 1 : 0;
  if (no_top > 0) {
    remarks.push_back(fmt::format("{} of {} trees have no height: their tops were not seen.",
                                  no_top, result.trees.size()));
  }
  return remarks;
}

}  // namespace understory
