#include "understory/forest/trees/tree_crowns.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "understory/forest/crown_constants.h"
#include "understory/forest/forest_constants.h"
#include "understory/util/median.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

using namespace forest_constants::tree_crowns;
namespace tree_owners = forest_constants::tree_owners;

using Places = std::vector<Eigen::Vector2d>;

// How far the places in one direction reach; negative where there are none.
template <std::size_t Sectors>
using Reaches = std::array<double, Sectors>;

template <std::size_t Sectors>
std::size_t sector_of(const Eigen::Vector2d& off) {
  const double turn = std::atan2(off.y(), off.x()) / (2.0 * M_PI) + 0.5;
  return std::min<std::size_t>(Sectors - 1, static_cast<std::size_t>(turn * Sectors));
}

// `quantile`: the share of the places in a direction that lie within.
template <std::size_t Sectors>
Reaches<Sectors> reaches_of(const Places& places, const Eigen::Vector2d& middle, double quantile) {
  std::array<std::vector<double>, Sectors> distances;
  for (const Eigen::Vector2d& place : places) {
    const Eigen::Vector2d off = place - middle;
    distances[sector_of<Sectors>(off)].push_back(off.norm());
  }
  Reaches<Sectors> reaches;
  reaches.fill(-1.0);
  for (std::size_t s = 0; s < Sectors; ++s) {
    std::vector<double>& all = distances[s];
    if (all.empty()) continue;
    const auto at = static_cast<std::size_t>(quantile * static_cast<double>(all.size() - 1));
    std::nth_element(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(at), all.end());
    reaches[s] = all[at];
  }
  return reaches;
}

// Few points leave directions empty: narrow gaps are filled in from both sides.
Reaches<kSectors> without_gaps(const Reaches<kSectors>& reaches) {
  Reaches<kSectors> filled = reaches;
  for (std::size_t s = 0; s < kSectors; ++s) {
    if (reaches[s] >= 0.0) continue;
    std::size_t before = 1;
    std::size_t after = 1;
    while (before < kSectors && reaches[(s + kSectors - before) % kSectors] < 0.0)
      ++before;
    while (after < kSectors && reaches[(s + after) % kSectors] < 0.0)
      ++after;
    if (before + after > kWidestGap) continue;
    const double left = reaches[(s + kSectors - before) % kSectors];
    const double right = reaches[(s + after) % kSectors];
    const auto share = static_cast<double>(before) / static_cast<double>(before + after);
    filled[s] = left + share * (right - left);
  }
  return filled;
}

// Area around `middle` that the places fill: a sum of wedges.
double outline_area(const Places& places, const Eigen::Vector2d& middle) {
  double area = 0.0;
  for (const double reach : without_gaps(reaches_of<kSectors>(places, middle, kEdgeQuantile)))
    area += M_PI / kSectors * std::pow(std::max(0.0, reach), 2);
  return area;
}

// How far to the left of the line from a to b a place lies, times the length of that line.
double left_of(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& place) {
  const Eigen::Vector2d along = b - a;
  const Eigen::Vector2d off = place - a;
  return along.x() * off.y() - along.y() * off.x();
}

// m2: three corners that span less lie on a line, but for rounding.
constexpr double kOnALine = 1e-9;

// The corners of one half of the convex outline of sorted places (A. M. Andrew, Information
// Processing Letters 9(5), 1979).
template <typename Iterator>
Places half_outline(Iterator begin, Iterator end) {
  Places corners;
  for (Iterator place = begin; place != end; ++place) {
    while (corners.size() > 1 &&
           left_of(corners[corners.size() - 2], corners.back(), *place) <= kOnALine)
      corners.pop_back();
    corners.push_back(*place);
  }
  return corners;
}

// The edge of a crown as its places show it, seen from its middle.
struct CrownEdge {
  int sectors = 0;      // that show it
  double places = 0.0;  // of the edge, in the mean of all sectors
};

// Places beyond `most` are those of neighbours.
CrownEdge edge_of(const Places& places, const Eigen::Vector2d& middle, double upper_quartile,
                  double most) {
  std::array<int, kOutlineSectors> seen{};
  CrownEdge edge;
  for (const Eigen::Vector2d& place : places) {
    const Eigen::Vector2d off = place - middle;
    const double reach = off.norm();
    if (reach <= kEdgeShare * upper_quartile || reach > most) continue;
    ++seen[sector_of<kOutlineSectors>(off)];
    edge.places += 1.0 / kOutlineSectors;
  }
  edge.sectors = static_cast<int>(
      std::count_if(seen.begin(), seen.end(), [](int count) { return count >= kFewestEdgeCubes; }));
  return edge;
}

// A crown seen from above, and how far it reaches beyond its outermost places.
struct CrownOutline {
  PlaneRing ring;
  double beyond_m = 0.0;
};

// The convex outline of the places, against the clock. Crowns are round: what sticks out far is a
// branch of a neighbour. Empty where a crown was seen from one side only. Few places leave a gap
// to the edge, which is added: n of them that are spread evenly over a width w leave w / (n + 1).
CrownOutline convex_outline(const Places& places, const Eigen::Vector2d& middle) {
  Reaches<kOutlineSectors> reaches = reaches_of<kOutlineSectors>(places, middle, 1.0);
  std::sort(reaches.begin(), reaches.end());
  const double upper_quartile = std::max(0.0, reaches[3 * kOutlineSectors / 4]);
  std::vector<double> seen(std::upper_bound(reaches.begin(), reaches.end(), -0.5), reaches.end());
  if (seen.empty()) return {};
  const double usual = upper_median(std::move(seen));
  const double most = kStickingOut * usual;
  const CrownEdge edge = edge_of(places, middle, upper_quartile, most);
  if (edge.sectors < kFewestEdgeSectors) return {};
  const double beyond = kThinEdge * (1.0 - kEdgeShare) * usual / (edge.places + 1.0);
  Places within;
  for (const Eigen::Vector2d& place : places) {
    const Eigen::Vector2d off = place - middle;
    if (off.norm() <= most) within.emplace_back(place + beyond * off.normalized());
  }
  std::sort(within.begin(), within.end(), [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  // The second half begins where the first one ends, and ends where that begins.
  PlaneRing ring = half_outline(within.begin(), within.end());
  const Places back = half_outline(within.rbegin(), within.rend());
  if (back.size() > 2) ring.insert(ring.end(), back.begin() + 1, back.end() - 1);
  return {std::move(ring), beyond};
}

// The middle of a crown: half way from its stem to where its places are. Branches of neighbours
// draw at the second, and a crown that has grown to one side is not around the first.
Eigen::Vector2d middle_of(const Places& places, const Eigen::Vector2d& stem) {
  std::vector<double> x;
  std::vector<double> y;
  for (const Eigen::Vector2d& place : places) {
    x.push_back(place.x());
    y.push_back(place.y());
  }
  const Eigen::Vector2d median(upper_median(std::move(x)), upper_median(std::move(y)));
  return 0.5 * (stem + median);
}

// The layers of one tree: its cubes by height.
std::vector<Places> layers_of(const std::vector<TreeOwners::Voxel>& voxels) {
  std::vector<Places> layers;
  for (const TreeOwners::Voxel& voxel : voxels) {
    const auto layer = static_cast<std::size_t>(std::max(0.0, voxel.height_m) / kLayer);
    if (layer >= layers.size()) layers.resize(layer + 1);
    layers[layer].push_back(voxel.place);
  }
  return layers;
}

// How far a layer reaches from the stem, as a mean over all directions.
double width_of(const Places& places, const Eigen::Vector2d& stem) {
  return std::sqrt(outline_area(places, stem) / M_PI);
}

// The lowest wide layer that hangs together with the widest one above the lower third. A bush at
// the foot of a tree is therefore no crown. The number of layers if there is none.
std::size_t base_of(const std::vector<double>& widths, double radius_m) {
  std::vector<double> sorted = widths;
  std::sort(sorted.begin(), sorted.end());
  const double wide =
      sorted[static_cast<std::size_t>(kWideQuantile * static_cast<double>(sorted.size() - 1))];
  const double least = std::max(radius_m + kBranch, kBaseShare * wide);
  const auto low = widths.begin() + static_cast<std::ptrdiff_t>(widths.size() / kLowParts);
  const auto widest = std::max_element(low, widths.end());
  if (*widest < least) return widths.size();
  auto base = static_cast<std::size_t>(widest - widths.begin());
  for (std::size_t layer = base; layer-- > 0 && base - layer <= kBaseGap;) {
    if (widths[layer] >= least) base = layer;
  }
  return base;
}

// Whether the upper half of a tree is a stem alone. Unknown where its stem was hardly seen up
// there.
double bareness(const std::vector<Places>& layers, const OwnerTree& tree) {
  std::size_t on = 0;
  std::size_t beside = 0;
  for (std::size_t i = layers.size() / 2; i < layers.size(); ++i) {
    const Eigen::Vector2d stem = centre_at(tree, (static_cast<double>(i) + 0.5) * kLayer);
    for (const Eigen::Vector2d& place : layers[i])
      ++((place - stem).norm() > tree.radius_m + kBeside ? beside : on);
  }
  const auto upper = static_cast<double>(layers.size() - layers.size() / 2);
  if (static_cast<double>(beside) >= kMostBeside * upper) return 0.0;
  const bool seen = std::isfinite(tree.height_m) && static_cast<double>(on) >= kLeastOnStem * upper;
  return seen && on >= kFewestOnStem ? 1.0 : TreeCrown::kUnknown;
}

TreeCrown crown_of(const std::vector<TreeOwners::Voxel>& voxels, const OwnerTree& tree) {
  const std::vector<Places> layers = layers_of(voxels);
  std::vector<double> widths;
  for (std::size_t i = 0; i < layers.size(); ++i)
    widths.push_back(width_of(layers[i], centre_at(tree, (static_cast<double>(i) + 0.5) * kLayer)));
  TreeCrown crown;
  crown.bare = bareness(layers, tree);
  if (widths.empty()) return crown;
  const std::size_t base = base_of(widths, tree.radius_m);
  if (base == widths.size()) return crown;
  const double base_m = static_cast<double>(base) * kLayer;
  // Lower layers hold what touches the stem alone, so this one is the lowest that can be wide.
  if (base_m > tree_owners::kUndergrowth) crown.base_m = base_m;
  Places all;
  for (std::size_t i = base; i < layers.size(); ++i)
    all.insert(all.end(), layers[i].begin(), layers[i].end());
  const double half_way = 0.5 * kLayer * static_cast<double>(base + layers.size());
  CrownOutline outline = convex_outline(all, middle_of(all, centre_at(tree, half_way)));
  if (outline.ring.empty()) return crown;
  crown.outline = std::move(outline.ring);
  crown.area_m2 = std::abs(signed_area_m2(crown.outline));
  crown.volume_m3 = 0.0;
  for (std::size_t i = base; i < layers.size(); ++i) {
    if (widths[i] > 0.0)
      crown.volume_m3 += kLayer * M_PI * std::pow(widths[i] + outline.beyond_m, 2);
  }
  return crown;
}

}  // namespace

std::vector<TreeCrown> measure_crowns(const TreeOwners& owners,
                                      const std::vector<OwnerTree>& trees) {
  std::vector<std::vector<TreeOwners::Voxel>> voxels(trees.size());
  for (std::size_t i = 0; i < owners.size(); ++i) {
    const TreeOwners::Voxel voxel = owners.voxel(i);
    if (voxel.owner != TreeOwners::kNobody)
      voxels[static_cast<std::size_t>(voxel.owner)].push_back(voxel);
  }
  std::vector<TreeCrown> crowns(trees.size());
  parallel_for(trees.size(), 4, [&](std::size_t i) { crowns[i] = crown_of(voxels[i], trees[i]); });
  return crowns;
}

}  // namespace understory
