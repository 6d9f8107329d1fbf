#pragma once

#include <filesystem>

#include "understory/geometry/pose.h"
#include "understory/georeference/systems/layer_frame.h"
#include "understory/output/report/map_picture.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// The layers of a run and the frame that they are in.
struct RunLayers {
  std::filesystem::path folder;
  const LayerFrame& frame;
  ProgressSink progress = {};  // polled by each point that is read
};

// Writes what a run folder holds of map.laz, map.copc.laz, obstacles.laz and the rasters to another
// folder, moved. Clouds move point by point; rasters keep their cell size and lie north up in the
// new frame. A point of a layer goes back to the world frame of its run. `target_from_world` leads
// from there to the world frame of the result, and to its layers. The cloud is drawn into
// `picture`, in the frame `drawing` of the result. Throws InputError or OutputError.
void write_moved_layers(const RunLayers& from, const Pose& target_from_world, const RunLayers& to,
                        const LayerFrame& drawing, MapPicture& picture, Log& log);

}  // namespace understory
