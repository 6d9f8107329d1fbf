#pragma once

#include <cstdint>
#include <vector>

#include "understory/geometry/feature_points.h"
#include "understory/registration/matcher.h"

namespace understory {

// The features of a single scan of a file, each kind thinned by voxels; what has none is left out.
// `ring`: of each point, or empty. Throws InputError for a cloud without rings.
[[nodiscard]] FeaturePoints features_of_cloud(const FeatureFinder& finder, const Points& points,
                                              const std::vector<std::uint16_t>& ring,
                                              double voxel_m);

// Matches a cloud of features to another one from a guess, with terms beside the points.
[[nodiscard]] RegistrationResult match_clouds_by_features(const Matcher& matcher,
                                                          const FeaturePoints& target,
                                                          const FeaturePoints& source,
                                                          const Pose& guess,
                                                          const PoseTerms& terms);

}  // namespace understory
