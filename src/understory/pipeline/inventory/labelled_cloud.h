#pragma once

#include <cstdint>
#include <filesystem>

#include "understory/forest/inventory.h"
#include "understory/georeference/systems/layer_frame.h"
#include "understory/output/clouds/las_stream.h"
#include "understory/pipeline/inventory/stand_cloud.h"
#include "understory/util/progress.h"

namespace understory {

// A cloud and what was found in it. All outlive the writing.
struct LabelledStand {
  const StandCloud& stand;
  const InventoryResult& inventory;  // with the trees that points belong to
  const LayerFrame* layers;          // that a run's map is written in; null: the cloud's own frame
};

// Writes map.laz of an inventory: the cloud with classes, the tree of each point and heights above
// the ground. Returns how many points lie too far from the others for the file. Throws OutputError.
[[nodiscard]] std::uint64_t write_labelled_cloud(const LabelledStand& from,
                                                 const LasOptions& options,
                                                 const std::filesystem::path& file,
                                                 const ProgressSink& progress);

}  // namespace understory
