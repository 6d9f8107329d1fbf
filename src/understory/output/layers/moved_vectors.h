#pragma once

#include <filesystem>

#include "understory/geometry/pose.h"
#include "understory/georeference/systems/layer_frame.h"

namespace understory {

// How the layers of one run come into the frame of another.
struct VectorMove {
  const LayerFrame& from;
  const Pose& target_from_world;  // between the world frames, metres
  const LayerFrame& to;
};

// Brings the layers `plots`, `look_again`, `crowns`, `stumps` and `logs` of one trees.gpkg into
// another that exists, with all their columns. Outlines and places are moved; so are the columns x
// and y, which are in the world frame, and bearing_deg. Outlines have no height: they lie at the
// mean height of the trees. A file or a layer that is not there leaves the other as it is. Throws
// InputError or OutputError.
void add_moved_vectors(const std::filesystem::path& from_file, const std::filesystem::path& to_file,
                       const VectorMove& move);

}  // namespace understory
