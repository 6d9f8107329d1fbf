#include "understory/forest/trees/thin_coverage.h"

#include <algorithm>

#include "understory/forest/forest_constants.h"

namespace understory {

using namespace forest_constants::thin_coverage;
namespace inventory = forest_constants::inventory;

CoverageGrid::CoverageGrid() : counts_(kCell) {}

void CoverageGrid::add(const Eigen::Vector2d& place, bool near_breast) {
  Counts& counts = counts_.at(place.x(), place.y());
  ++counts.all;
  counts.near_breast += near_breast ? 1 : 0;
}

void CoverageGrid::add(const CoverageGrid& other) {
  counts_.merge(other.counts_, [](Counts& own, const Counts& cell) {
    own.all += cell.all;
    own.near_breast += cell.near_breast;
  });
}

ThinCoverage CoverageGrid::thin() const {
  ThinCoverage thin;
  thin.cell_m = kCell;
  std::size_t cells = 0;
  std::size_t dense = 0;
  std::uint64_t near_breast = 0;
  counts_.for_each([&](int column, int row, const Counts& counts) {
    if (counts.all == 0) return;
    ++cells;
    if (counts.all >= inventory::kSparse * kCell * kCell) {
      ++dense;
      near_breast += counts.near_breast;
    }
    if (counts.all < kFewPerM2 * kCell * kCell)
      thin.corners.emplace_back(column * kCell, row * kCell);
  });
  std::sort(thin.corners.begin(), thin.corners.end(),
            [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
              return a.y() < b.y() || (a.y() == b.y() && a.x() < b.x());
            });
  const auto part = [](std::uint64_t some, double of) {
    return of > 0.0 ? static_cast<double>(some) / of : 0.0;
  };
  thin.share = part(thin.corners.size(), static_cast<double>(cells));
  thin.dense_share = part(dense, static_cast<double>(cells));
  thin.near_breast_per_m2 = part(near_breast, static_cast<double>(dense) * kCell * kCell);
  return thin;
}

}  // namespace understory
