#pragma once

#include <filesystem>
#include <vector>

#include "understory/evaluation/trees/tree_changes.h"
#include "understory/georeference/systems/layer_frame.h"
#include "understory/output/clouds/point_table.h"

namespace understory {

// Trees of two epochs as rows, docs/reference/evaluation.md: places are those of NEW, else those of
// OLD, in the frame of the lists.
[[nodiscard]] PointTable changes_table(const std::vector<Tree>& old_trees,
                                       const std::vector<Tree>& new_trees,
                                       const TreeChanges& changes);

// Writes them as a GeoPackage with the layer `changes` where `path` ends in .gpkg, with places in
// the frame of `layers`. Else it writes CSV in the frame of the lists. Throws OutputError.
void write_changes(const std::filesystem::path& path, const PointTable& changes,
                   const LayerFrame& layers);

}  // namespace understory
