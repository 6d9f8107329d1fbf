#pragma once

#include <algorithm>
#include <optional>
#include <string>

#include "understory/registration/icp/icp_map.h"
#include "understory/registration/matcher.h"
#include "understory/util/config/config.h"
#include "understory/util/error.h"

namespace understory::internal {

// What the builders of ICP and GICP have in common: clouds go into one IcpMap. A method adds its
// `snapshot`.
class IcpMapTargetBuilder : public TargetBuilder {
 public:
  explicit IcpMapTargetBuilder(const IcpMapConfig& config) : builder_(config) {}

  void insert(const Points& points_in_source, const Pose& target_from_source,
              std::optional<double> forget_beyond_m) override {
    builder_.insert(points_in_source, target_from_source);
    if (forget_beyond_m) builder_.remove_beyond(target_from_source.translation(), *forget_beyond_m);
  }
  void forget_beyond(const Eigen::Vector3d& centre, double radius_m) override {
    builder_.remove_beyond(centre, radius_m);
  }
  void clear() override { builder_.clear(); }
  [[nodiscard]] double bytes() const override { return builder_.bytes(); }

 protected:
  [[nodiscard]] IcpMapPtr map() { return builder_.snapshot(); }

 private:
  IcpMapBuilder builder_;
};

// The distances that a method named `method` matches over, metres; `near_key` is that of the first.
struct IcpReach {
  const char* method;
  const char* near_key;
  double near_m;
  double far_m;
};
// Throws ConfigError where the map does not reach as far.
inline void check_reach(const IcpReach& reach, const IcpMapConfig& map) {
  const double most = IcpMap::kMaxReach * map.cube_m;
  if (std::max(reach.near_m, reach.far_m) > most + 1e-9)
    throw ConfigError({std::string(reach.method) + ": " + reach.near_key +
                       " and far_distance_m: expected at most " +
                       std::to_string(IcpMap::kMaxReach) + " times map_cube_m"});
  if (map.epsilon_m > map.cube_m)
    throw ConfigError({std::string(reach.method) + ": map_epsilon_m: expected at most map_cube_m"});
}

// The settings of both that name the first steps and the map. `cube_meaning` says what has a point
// a cube.
inline void describe_far_distance(ConfigTable& table, double& far_distance_m) {
  table.add("far_distance_m", far_distance_m, {0.0, 20.0}, "m",
            "max_distance_m of the first steps where the guess may be far off; 0: no such steps");
}
inline void describe_map(ConfigTable& table, const char* cube_meaning, IcpMapConfig& map) {
  table.add("map_cube_m", map.cube_m, {0.05, 5.0}, "m", cube_meaning);
  table.add(
      "map_epsilon_m", map.epsilon_m, {0.0, 1.0}, "m",
      "above 0: instead, points enter as they are that are farther than this from all others, "
      "at most map_cube_m");
  table.add("map_growth", map.growth, {0.0, 10.0}, "",
            "share of new points at which that point is computed again");
}

}  // namespace understory::internal
