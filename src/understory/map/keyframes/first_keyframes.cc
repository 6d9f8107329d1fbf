#include "understory/map/keyframes/first_keyframes.h"

#include <algorithm>
#include <numbers>

#include "understory/geometry/matrix_inverse.h"

namespace understory {
namespace {

bool is_acceptable(const RegistrationResult& match, const Pose& before,
                   const FirstKeyframesConfig& config) {
  if (!match.usable() || match.degenerate_directions.cols() > 0) return false;
  const Pose change = before.inverse() * match.target_from_source;
  return change.translation().norm() <= config.max_m &&
         change.angle() <= config.max_deg * std::numbers::pi / 180.0;
}

}  // namespace

void describe(ConfigTable& table, FirstKeyframesConfig& config) {
  table.add("enabled", config.enabled, "position the first keyframes again in the finished map");
  table.add("keyframes", config.keyframes, {1, 1000}, "",
            "number of keyframes that are positioned again");
  table.add("map_keyframes", config.map_keyframes, {1, 1000}, "",
            "number of keyframes after them that make the first map");
  table.add("max_m", config.max_m, {0.0, 10.0}, "m",
            "largest shift of a keyframe; a larger one is refused");
  table.add("max_deg", config.max_deg, {0.0, 180.0}, "deg",
            "largest turn of a keyframe; a larger one is refused");
}

std::vector<Pose> refine_first_keyframes(
    std::span<const Keyframe> segment,
    const std::function<std::shared_ptr<const FeaturePoints>(std::size_t)>& points,
    const LocalMapConfig& map_config, const FirstKeyframesConfig& config) {
  const auto count = static_cast<std::size_t>(config.keyframes);
  const std::size_t known = count + static_cast<std::size_t>(config.map_keyframes);
  if (segment.size() < known) return {};
  LocalMap map(map_config);
  for (std::size_t i = count; i < known; ++i)
    map.insert({points(i).get(), segment[i].world_from_body}, false);

  std::vector<Pose> result(count);
  Pose moved;  // of the world, at the keyframe looked at last
  for (std::size_t i = count; i-- > 0;) {
    const auto cloud = points(i);
    const Pose guess = moved * segment[i].world_from_body;
    const PosePrior prior{guess, inverse_matrix(segment[i + 1].covariance)};
    const RegistrationResult match =
        map.snapshot()->match_features(*cloud, guess, {prior}, MatchStart::kNear);
    result[i] = is_acceptable(match, guess, config) ? match.target_from_source : guess;
    moved = result[i] * segment[i].world_from_body.inverse();
    map.insert({cloud.get(), result[i]}, false);
  }
  return result;
}

}  // namespace understory
