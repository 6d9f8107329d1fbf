#pragma once

#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "understory/evaluation/trajectory.h"
#include "understory/evaluation/trees/tree_falls.h"
#include "understory/evaluation/world_frame.h"
#include "understory/georeference/systems/geodetic.h"
#include "understory/georeference/systems/layer_frame.h"
#include "understory/output/report/map_picture.h"
#include "understory/pipeline/georeferencing/carried_stand.h"
#include "understory/pipeline/georeferencing/methods/placement.h"
#include "understory/pipeline/georeferencing/run_place.h"
#include "understory/pipeline/judgement/inherited_trust.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/sensor/tree.h"
#include "understory/util/log.h"
#include "understory/util/progress.h"

namespace understory {

// What a run folder holds that a motion can move. Frame: the run's world frame, metres, z up.
struct MovableRun {
  WorldFrame world_frame = WorldFrame::kEnu;  // of its files, and of those of the result
  Trajectory trajectory;
  std::vector<Tree> trees;
  bool has_trees = false;
  std::vector<TreeFall> falls;
  bool has_falls = false;
  // Where the run lies already: the place of the frame east, north, up that `enu_from_world` leads
  // to. That transform is the identity where the run's own frame is that frame. Nothing where it is
  // not known.
  std::optional<GeodeticPlace> origin;
  Pose enu_from_world;
  std::string heights;  // what those of its layers are above, in words
  // How sure that place is, as its method told it; NaN where not known.
  double expected_error_m = std::numeric_limits<double>::quiet_NaN();
  double heading_sd_deg = std::numeric_limits<double>::quiet_NaN();
  std::vector<GnssFix> fixes;  // of a run that is being mapped; else in its gnss.csv
  std::optional<Eigen::Vector3d> antenna_in_body;  // of these fixes, metres; not where unknown
  std::optional<Eigen::Vector3d> second_antenna_in_body;
  // The frame that its layers are in: map.laz, dtm.tif and chm.tif.
  std::shared_ptr<const LayerFrame> layers = std::make_shared<LayerFrame>();
  bool of_cloud = false;  // it has a cloud, so that heights of trees are measured
  CarriedStand stand;
  InheritedTrust trust;
};

// Throws InputError where `folder` holds no trajectory.tum.
[[nodiscard]] MovableRun read_movable_run(const std::filesystem::path& folder);

// The trees in the target frame; their standard deviations turn with the axes.
[[nodiscard]] std::vector<Tree> moved_trees(const std::vector<Tree>& trees, const Pose& motion);

// A run that was moved: its lists in the world frame of the result.
struct MovedRun {
  const MovableRun& run;
  const Placement& placement;
  Trajectory trajectory;
  std::vector<Tree> trees;
};
// From which run folder to which folder a run is moved.
struct MovingFolders {
  const std::filesystem::path& from;
  const std::filesystem::path& to;
  const ProgressSink& progress;  // polled by each point of the cloud
};
// Writes every file of the run in `folders.from`, moved, to the other; the cloud is drawn into
// `picture`. Throws InputError or OutputError.
void write_moved_run(const MovingFolders& folders, const MovedRun& moved,
                     const ResultFrames& frames, MapPicture& picture, Log& log);

}  // namespace understory
