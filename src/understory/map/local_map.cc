#include "understory/map/local_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "understory/util/error.h"
#include "understory/util/parallel.h"

namespace understory {

void describe(ConfigTable& table, LocalMapConfig& config) {
  using Method = LocalMapConfig::Method;
  table.add_enum("method", config.method,
                 {{"accumulate", Method::kAccumulate}, {"recent", Method::kRecent}},
                 "all keyframes within the radius, or the most recent ones (as the papers)");
  table.add("cell_sizes_m", config.cell_sizes_m, "m", "cells of the maps, coarse to fine");
  table.add("min_points", config.cells.min_points, {3, 1000}, "",
            "least points of a cell that has a distribution");
  table.add("growth", config.cells.growth, {0.0, 1.0}, "",
            "share of new points at which a cell's distribution is worked out again");
  table.add("sigma_floor_m", config.cells.sigma_floor_m, {1e-3, 1.0}, "m",
            "no surface is taken to be thinner");
  table.add("second_axis_weight", config.cells.second_axis_weight, {0.0, 1.0}, "",
            "weight of a cell's second thinnest direction");
  table.add("volume_weight", config.cells.volume_weight, {0.0, 1.0}, "",
            "weight of cells that are neither surface nor line");
  table.add(
      "near_side_line", config.cells.near_side_line, {0.0, 2.0}, "",
      "the side of a stem that is seen lies before the middle of its cell by this share of the "
      "spread; 0: in its middle");
  table.add("near_side_volume", config.cells.near_side_volume, {0.0, 2.0}, "",
            "the same of cells that are neither surface nor line");
  table.add("few_rings", config.cells.few_rings,
            "a surface seen exactly edge-on is the trace of one ring; of sparse scans true");
  table.add("radius_m", config.radius_m, {10.0, 1000.0}, "m", "accumulate: reach of the map");
  table.add("recent_keyframes", config.recent_keyframes, {1, 10000}, "", "recent: how many");
  table.add("recent_spacing_m", config.recent_spacing_m, {0.0, 100.0}, "m",
            "recent: one keyframe per cube of this edge");
}

namespace {

// Cells that are twice as large or more have their shape from a part of a dense keyframe's points.
constexpr std::size_t kEnoughForCoarse = 20000;
constexpr std::size_t kCoarseEvery = 4;

}  // namespace

LocalMap::LocalMap(const LocalMapConfig& config) : config_(config) {
  if (config.cell_sizes_m.empty()) throw ConfigError({"local_map.cell_sizes_m: is empty"});
  for (const double size : config.cell_sizes_m) {
    if (!(size >= 0.05 && size <= 20.0)) {
      throw ConfigError({"local_map.cell_sizes_m: expected values within 0.05..20 m"});
    }
    NdtMapConfig cells = config.cells;
    cells.cell_size_m = size;
    builders_.emplace_back(cells);
  }
}

void LocalMap::insert(const PlacedPoints& keyframe, bool forget) {
  const Points& all = *keyframe.points_in_body;
  const Points part = thin_evenly(all, kEnoughForCoarse, kCoarseEvery);
  const double finest = config_.cell_sizes_m.back();
  parallel_for(builders_.size(), 1, [&](std::size_t i) {
    NdtMapBuilder& builder = builders_[i];
    const bool coarse = config_.cell_sizes_m[i] >= 2.0 * finest;
    builder.insert(coarse ? part : all, keyframe.world_from_body);
    if (forget) builder.remove_beyond(keyframe.world_from_body.translation(), config_.radius_m);
  });
}

void LocalMap::clear() {
  for (NdtMapBuilder& builder : builders_)
    builder.clear();
}

std::vector<NdtMapPtr> LocalMap::snapshot() {
  std::vector<NdtMapPtr> maps(builders_.size());
  parallel_for(builders_.size(), 1, [&](std::size_t i) { maps[i] = builders_[i].snapshot(); });
  return maps;
}

std::vector<std::size_t> recent_keyframes(const std::vector<Eigen::Vector3d>& positions,
                                          const LocalMapConfig& config) {
  const auto wanted = static_cast<std::size_t>(config.recent_keyframes);
  const std::size_t first = positions.size() > wanted ? positions.size() - wanted : 0;
  std::vector<std::size_t> chosen;
  if (config.recent_spacing_m <= 0.0) {
    for (std::size_t i = first; i < positions.size(); ++i)
      chosen.push_back(i);
    return chosen;
  }
  std::map<std::array<long, 3>, std::vector<std::size_t>> cubes;
  for (std::size_t i = first; i < positions.size(); ++i) {
    std::array<long, 3> cube{};
    for (int k = 0; k < 3; ++k) {
      cube[static_cast<std::size_t>(k)] =
          std::lround(std::floor(positions[i][k] / config.recent_spacing_m));
    }
    cubes[cube].push_back(i);
  }
  for (const auto& [cube, members] : cubes) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const std::size_t i : members)
      mean += positions[i] / static_cast<double>(members.size());
    chosen.push_back(*std::min_element(members.begin(), members.end(), [&](auto a, auto b) {
      return (positions[a] - mean).squaredNorm() < (positions[b] - mean).squaredNorm();
    }));
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

std::vector<LocalMapInsertion> keyframes_within_reach(const std::vector<Eigen::Vector3d>& positions,
                                                      std::size_t first,
                                                      const LocalMapConfig& config) {
  std::vector<LocalMapInsertion> chosen;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if ((positions[i] - positions.back()).norm() < config.radius_m) {
      chosen.push_back({first + i, 0});
    }
  }
  if (!chosen.empty()) chosen.back().forget = 1;
  return chosen;
}

}  // namespace understory
