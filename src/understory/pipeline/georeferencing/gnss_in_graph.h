#pragma once

#include <vector>

#include "understory/geometry/pose.h"
#include "understory/georeference/satellites/fused_path.h"
#include "understory/pipeline/georeferencing/map_placing.h"
#include "understory/util/config/config.h"
#include "understory/util/log.h"

namespace understory {

// What `map` does with the recording's positions by satellites.
enum class GnssUse {
  kGeoreference,  // lays the finished map on them, by the method `auto`
  kRigid,         // the same by `split`: one motion, estimated with the receiver's slow errors
  kFuse           // they are factors of the pose graph: the world frame becomes east, north, up
};

// The settings of section `gnss`.
struct GnssUseConfig {
  GnssUse use = GnssUse::kGeoreference;
  FusedPathConfig path;
};
void describe(ConfigTable& table, GnssUseConfig& config);

// A run whose positions were used beside or in its graph.
struct RunWithPositions {
  FoundPlacement found;
  std::vector<Pose> world_from_keyframe;  // new ones; empty where the keyframes stay
};

// By `config.use`, which is not kGeoreference. Where the rigid fit is not to be trusted or the
// graph finds no solution, the keyframes stay, with the reason in a warning. Throws OutputError.
[[nodiscard]] RunWithPositions use_positions(const MappedPath& run, const SolvedRun& solved,
                                             const GeoreferenceConfig& georeference,
                                             const GnssUseConfig& config, Log& log);

}  // namespace understory
