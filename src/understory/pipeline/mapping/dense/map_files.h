#pragma once

#include <cstdint>

#include "understory/output/report/map_picture.h"
#include "understory/pipeline/mapping/dense/dense_mapping_config.h"
#include "understory/pipeline/mapping/dense/dense_results.h"
#include "understory/pipeline/mapping/front_end.h"

namespace understory {

// Writes map.laz, map.copc.laz where it is wanted, trees.csv, trees.gpkg, dtm.tif, chm.tif,
// map.qgs, and obstacles where they are wanted, into the folder of results. Draws the map into
// `picture`. Returns the number of points of the map. Throws OutputError.
[[nodiscard]] std::uint64_t write_map(const ReadRecording& recording,
                                      const DenseMappingConfig& config, DenseProducts& made,
                                      MapPicture& picture);

}  // namespace understory
