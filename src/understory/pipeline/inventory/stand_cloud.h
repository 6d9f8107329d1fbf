#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "understory/forest/inventory.h"
#include "understory/georeference/systems/layer_frame.h"
#include "understory/pipeline/inventory/streamed_cloud.h"
#include "understory/recording/clouds/cloud_file.h"
#include "understory/util/progress.h"

namespace understory {

// What the user knows of a cloud's frame. What is given is taken as it is, what is not given is
// checked.
struct CloudFrame {
  double unit_m = 0.0;  // metres per unit; 0: metres, if nothing speaks against it
  // The direction that is up: x, y, z, -x, -y, -z or three numbers "X,Y,Z"; empty: z, if nothing
  // speaks against it.
  std::string up;
  // Of a cloud that states none, as the user names it: its unit is checked too. Empty: not known.
  std::string coordinate_system;
};
// Whether a text names a direction for CloudFrame::up.
[[nodiscard]] bool is_direction(const std::string& up);

// All points of a cloud, file frame.
[[nodiscard]] PointBlocks blocks_of(const PointCloudFile& cloud);

// A cloud in metres with z up, and why it may be none.
struct StandCloud {
  PointCloudFile cloud;                   // without points where they lie in tiles
  std::optional<StreamedCloud> streamed;  // then they are there
  std::string doubt;                      // empty: none
  std::string suspicion;                  // that it is in feet; empty: none
  std::string coarse;                     // that its places are rounded; empty: none
};
// Reads a cloud and turns and scales it as `frame` says; then its coordinate system is dropped,
// with a warning. With `tiling` a large cloud is put into tiles on disk instead. Polls `progress`.
// Throws InputError where read_cloud does, and for a recording; see stream_cloud, too.
[[nodiscard]] StandCloud read_stand(const std::filesystem::path& path, const CloudFrame& frame,
                                    Log& log, const ProgressSink& progress = {},
                                    const CloudTiling* tiling = nullptr);
// The map of a run, brought back from the frame of its layers to the world frame.
[[nodiscard]] StandCloud read_run_map(const std::filesystem::path& path, const LayerFrame& layers,
                                      const CloudFrame& frame, Log& log,
                                      const ProgressSink& progress = {},
                                      const CloudTiling* tiling = nullptr);

}  // namespace understory
