#include "understory/map/local_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

#include "understory/map/map_constants.h"

namespace understory {

using namespace map_constants::local_map;

void describe(ConfigTable& table, LocalMapConfig& config) {
  using Method = LocalMapConfig::Method;
  table.add_enum("method", config.method,
                 {{"accumulate", Method::kAccumulate}, {"recent", Method::kRecent}},
                 "accumulate: all keyframes within the radius; recent: the most recent ones, as in "
                 "the papers");
  table.add("radius_m", config.radius_m, {10.0, 1000.0}, "m",
            "method accumulate: radius of the map");
  table.add("recent_keyframes", config.recent_keyframes, {1, 10000}, "",
            "method recent: number of keyframes");
  table.add("recent_spacing_m", config.recent_spacing_m, {0.0, 100.0}, "m",
            "method recent: edge of the cubes that keep one keyframe each");
}

LocalMap::LocalMap(const LocalMapConfig& config)
    : most_radius_m_(config.radius_m),
      most_bytes_(config.most_bytes),
      radius_m_(config.radius_m),
      first_radius_m_(config.radius_m),
      builder_(make_matcher(config.matcher)->make_builder(config.viewpoint)) {}

void LocalMap::insert(const PlacedPoints& keyframe, bool forget) {
  builder_->insert_features(*keyframe.points_in_body, keyframe.world_from_body,
                            forget ? std::optional(radius_m_) : std::nullopt);
  if (forget && most_bytes_ > 0.0) fit(keyframe.world_from_body.translation());
}

void LocalMap::fit(const Eigen::Vector3d& place) {
  if (builder_->bytes() < kRoomToGrow * most_bytes_)
    radius_m_ = std::min(most_radius_m_, radius_m_ / kSmaller);
  while (builder_->bytes() > most_bytes_ && radius_m_ > kLeastRadiusM) {
    radius_m_ *= kSmaller;
    builder_->forget_beyond(place, radius_m_);
  }
}

void LocalMap::clear() {
  first_radius_m_ = radius_m_;
  builder_->clear();
}

MatchTargetPtr LocalMap::snapshot() {
  return builder_->snapshot();
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
                                                      std::size_t first, double radius_m) {
  std::vector<LocalMapInsertion> chosen;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if ((positions[i] - positions.back()).norm() < radius_m) {
      chosen.push_back({first + i, 0});
    }
  }
  if (!chosen.empty()) chosen.back().forget = 1;
  return chosen;
}

}  // namespace understory
