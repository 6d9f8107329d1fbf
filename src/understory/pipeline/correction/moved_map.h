#pragma once

#include <filesystem>

#include "understory/geometry/pose.h"
#include "understory/util/log.h"

namespace understory {

// Writes what a run folder holds of map.laz, dtm.tif and chm.tif to another, moved: the cloud point
// by point, the rasters over cells of their own size, north up in the new frame. Throws InputError
// or OutputError.
void write_moved_map(const std::filesystem::path& run, const std::filesystem::path& result,
                     const Pose& target_from_world, Log& log);

}  // namespace understory
