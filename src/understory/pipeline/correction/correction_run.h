#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "understory/evaluation/trajectory.h"
#include "understory/geometry/stamped_pose.h"
#include "understory/graph/self_correction/stem_correction.h"
#include "understory/map/stem_map.h"
#include "understory/odometry/stems/sparse_odometry.h"
#include "understory/pipeline/correction/head_cut_log.h"
#include "understory/pipeline/judgement/run_evidence.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/sensor/stem_view.h"
#include "understory/sensor/tree.h"

namespace understory {

// Stems that have been positioned: what a correction begins with, whether a recording was read just
// now or a file of stems. Poses are in the world of the first one.
struct CorrectionInput {
  std::vector<StemView> views;
  std::vector<SparseStep> steps;  // the chained odometry, one a view
  // Of every scan, before any correction, in order of time; empty: the views are all there is.
  std::vector<StampedPose> path;
  std::vector<float> scan_ms;  // work on the scan of each view; 0: unknown
  bool stopped = false;        // before all views had their steps: they are not corrected
  std::vector<LoggedCut> head_cuts;
  std::string lidar_model;     // of the recording; empty where it is unknown or there are several
  std::vector<GnssFix> fixes;  // of the recording; compared with, not used
  std::optional<Eigen::Vector3d> antenna_in_body;  // metres; nothing where unknown
  std::optional<Eigen::Vector3d> second_antenna_in_body;
  std::optional<Trajectory> truth;  // of a simulated recording
  RunEvidence evidence;             // of the reading
};

// What a correction has found beside.
struct CorrectionRun : CorrectionInput {
  StemCorrection correction;    // the result
  std::vector<StemView> seen;   // the views that make the map: those that hurt it may be left out
  std::vector<Pose> seen_from;  // world from body, of these
  std::vector<MappedStem> stems;
  std::vector<Tree> trees;  // one for each stem
};

}  // namespace understory
