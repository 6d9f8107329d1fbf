#pragma once

#include <cstddef>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/map/loop_attempt.h"
#include "understory/map/map_pieces.h"
#include "understory/util/config/config.h"

namespace understory {

// How the place of a piece of map is looked for in the pieces before it.
struct PieceSearchConfig {
  bool enabled = true;
  int keyframes = 10;      // on each side of a place, that make the cloud that is compared
  double spacing_m = 8.0;  // along the path between the places of one piece
  int max_candidates = 3;  // places tried in one search beside the scans
  int max_at_end = 200;    // and once all scans are read
  double min_apart_m = 3.0;
};
void describe(ConfigTable& table, PieceSearchConfig& config);

// A place of a piece and one of an earlier piece that is not together with it. Keyframes.
struct PiecePlaces {
  std::size_t older = 0;
  std::size_t newer = 0;
};

// Where the place of the keyframe `query` is looked for: at places of the pieces that are not
// together with its own. Those that its own pieces were compared with least often come first, and
// among them the nearest by the poses. None while its piece is shorter than `min_apart_m`.
// `world_from_keyframe`: of all keyframes.
[[nodiscard]] std::vector<PiecePlaces> places_to_try(const std::vector<Pose>& world_from_keyframe,
                                                     const MapPieces& pieces,
                                                     const std::vector<LoopAttempt>& attempts,
                                                     std::size_t query,
                                                     const PieceSearchConfig& config);

// The same of a whole piece, from each of its places: the nearest by the poses first.
[[nodiscard]] std::vector<PiecePlaces> all_places_to_try(
    const std::vector<Pose>& world_from_keyframe, const MapPieces& pieces, std::size_t piece,
    const PieceSearchConfig& config);

}  // namespace understory
