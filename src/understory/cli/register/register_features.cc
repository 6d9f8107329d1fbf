#include "understory/cli/register/register_features.h"

#include <memory>
#include <optional>
#include <utility>

#include "understory/preprocess/voxel_filter.h"

namespace understory {

FeaturePoints features_of_cloud(const FeatureFinder& finder, const Points& points,
                                const std::vector<std::uint16_t>& ring, double voxel_m) {
  BodyCloud cloud;
  cloud.resize(points.size());
  cloud.points = points;
  if (!ring.empty()) cloud.ring = ring;
  for (std::size_t i = 0; i < points.size(); ++i)
    cloud.range[i] = points[i].norm();
  cloud.feature = finder.find({&cloud.points, &cloud.ring});
  VoxelFilterConfig config;
  config.voxel_size_m = voxel_m;
  BodyCloud thinned = VoxelFilter().filter_features(cloud, config, false);
  return {std::move(thinned.points), std::move(thinned.feature)};
}

RegistrationResult match_clouds_by_features(const Matcher& matcher, const FeaturePoints& target,
                                            const FeaturePoints& source, const Pose& guess,
                                            const PoseTerms& terms) {
  const std::unique_ptr<TargetBuilder> builder = matcher.make_builder({});
  builder->insert_features(target, Pose(), std::nullopt);
  return builder->snapshot()->match_features(source, guess, terms, MatchStart::kFar);
}

}  // namespace understory
