#pragma once

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/graph/loops/loop_closure.h"
#include "understory/registration/matcher.h"

namespace understory {

// A candidate of P4 (38) and the local map of the present. The map's frame is the world.
struct LocalMapLoopInput {
  const MatchTarget* local_map = nullptr;  // as scans are registered to it; null: none
  Points map_points_in_query;              // the same map as points, body frame of the query
  Points candidate_points;                 // body frame of the candidate, thinned as scans are
  Pose world_from_candidate;               // as the graph has it
  Pose world_from_query;                   // of the scan about to be mapped
};

// Steps 2 and 3 of P4's loop closure (section 3.1.1). The candidate's scan is registered to the
// present local map, from where the graph has it. The pose of the query relative to the result is
// the edge (`target_from_source`, from the candidate). Its fitness is the mean squared distance of
// the scan's points from their nearest points of the map (36); worse than `max_fitness_m2` it is
// refused. Covariance: `sigma_rotation_deg`, `sigma_translation_m` of the configuration alone, as
// (36) has it below its threshold. Pure; parallel inside; same bits for any number of threads.
[[nodiscard]] LoopVerification register_to_local_map(const LocalMapLoopInput& input,
                                                     const LoopClosureConfig& config);

}  // namespace understory
