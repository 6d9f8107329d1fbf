#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "understory/evaluation/alignment.h"
#include "understory/evaluation/trajectory.h"

namespace understory {

// How two trajectories are paired, aligned and compared.
struct EvaluationOptions {
  Alignment alignment = Alignment::kNone;
  double tolerance_s = 0.01;                  // of the times of a pair; > 0
  std::vector<double> rpe_deltas_m = {10.0};  // path lengths between the poses of RPE, > 0
};

// An index into the estimate and one into the truth.
using PosePair = std::pair<std::size_t, std::size_t>;

// Pairs each pose of the trajectory with fewer poses with the one of the other nearest in time. The
// pair must be within the tolerance; nothing is interpolated. A pose of the longer one may serve
// twice where the shorter one is denser for a while, as in evo's association, which this follows.
[[nodiscard]] std::vector<PosePair> associate(const Trajectory& estimate, const Trajectory& truth,
                                              double tolerance_s);

// Relative pose error, P2 T1: consecutive, non-overlapping pairs of poses, as evo_rpe makes them
// with `--delta D -u m`. A pair ends at the first pose at which the estimate's path since its first
// pose reaches delta.
struct RelativeError {
  double delta_m = 0.0;
  std::size_t pairs = 0;
  double translation_rmse_m = 0.0;   // NaN if there is no pair
  double translation_percent = 0.0;  // rmse per delta
  double rotation_rmse_deg = 0.0;
};

// KITTI's segment error. It is the mean of the end's error after aligning the first pose, over
// segments of one length of the truth. A segment starts at every tenth pair.
struct SegmentError {
  double length_m = 0.0;
  std::size_t segments = 0;
  double translation_percent = 0.0;
  double translation_plane_percent = 0.0;  // horizontal part, in the truth's world frame
  double rotation_deg_per_m = 0.0;
};

// What a trajectory errs by against the truth. Metres and degrees unless a name says otherwise.
struct TrajectoryErrors {
  std::size_t pairs = 0;
  Alignment alignment = Alignment::kNone;
  bool alignment_determined = true;  // false: rotations and velocities after it mean nothing
  double alignment_sd_deg = 0.0;     // of its rotation, see AlignmentResult; NaN: unknown
  Pose truth_from_estimate;          // the motion of the alignment
  double length_m = 0.0;  // path of the truth from the first to the last pair, all its poses
  double covered = 0.0;   // share of the truth's duration between the first and last pair

  // Absolute pose error after the alignment.
  double ape_rmse_m = 0.0;
  double ape_plane_rmse_m = 0.0;  // horizontal
  double ape_mean_m = 0.0;
  double ape_median_m = 0.0;
  double ape_max_m = 0.0;
  double ape_rotation_rmse_deg = 0.0;

  // By how much the estimate's path is too large (+) or too small (-): what a least-squares fit
  // with a free scale (Umeyama 1991, eq. 42) would undo, whatever `alignment` says. No error above
  // has it taken out. Absent where either path stays within decimetres: it has no size.
  std::optional<double> scale_percent;

  // P4 T3 and T4: the last pair's error after aligning the first, whatever `alignment` says.
  Eigen::Vector3d drift_end = Eigen::Vector3d::Zero();  // truth's world frame, metres
  double drift_end_m = 0.0;
  double drift_plane_m = 0.0;
  double drift_percent = 0.0;  // drift_end_m per length_m; NaN where the truth stands still

  std::vector<RelativeError> rpe;
  std::vector<SegmentError> segments;
};

// The errors of an estimate against the truth. Both must be in ascending order of time. Empty if
// no pose of one is within the tolerance of one of the other: different clocks, or recordings.
// Pure and thread-safe.
[[nodiscard]] std::optional<TrajectoryErrors> evaluate_trajectory(const Trajectory& estimate,
                                                                  const Trajectory& truth,
                                                                  const EvaluationOptions& options);

// RMSE of the velocity per axis of the truth's world frame, P2 T1, in m/s; the estimate's
// velocities are turned by the alignment's rotation first. Empty if nothing pairs up in time.
[[nodiscard]] std::optional<Eigen::Vector3d> velocity_rmse(
    const std::vector<StampedVelocity>& estimate, const std::vector<StampedVelocity>& truth,
    const Eigen::Quaterniond& truth_from_estimate, double tolerance_s);

}  // namespace understory
