#pragma once

#include <cstdint>
#include <string>

#include "understory/registration/stems/sparse_icp.h"
#include "understory/util/config/config.h"

namespace understory {

// Globally optimal matching of sparse clouds, Go-ICP (Yang et al. 2015) with the bounds of P0
// section 2.3: boxes of motions whose trimmed error is bounded from below, P0 (22).
struct GoIcpConfig {
  // Plane: yaw and the horizontal translation of levelled clouds; height and tilt follow by ICP in
  // space. Space: SE(3), tilt and height within their ranges too, error in space.
  enum class Motion { kPlane, kSpace };

  // Certified: splits until no other place can be better by more than `gap_m`. Paper: stops at
  // boxes inside the convergence region of ICP, P0 (24-26), and hands over to it.
  enum class Mode { kCertified, kPaper };

  // How a box is halved. Elongated: along the side that can move points most, so that boxes become
  // as long as the bound allows. Cubes: all sides at once, as in the original Go-ICP.
  enum class Boxes { kElongated, kCubes };

  Motion motion = Motion::kPlane;
  Mode mode = Mode::kCertified;
  Boxes boxes = Boxes::kElongated;
  double yaw_range_deg = 180.0;  // around the guess
  double shift_range_m = 5.0;    // around the guess, per axis
  double tilt_range_deg = 10.0;  // around the guess, about each level axis (space only)
  double height_range_m = 1.0;   // around the guess (space only)
  double outlier_ratio = 0.4;    // P0's gamma
  double gap_m = 0.02;           // of the root mean square error; certified below it
  // The paper's mode stops at boxes of that size (half sides); 0: by (24) and (25), from L0, and
  // 8.2 degrees of tilt.
  double finest_yaw_deg = 0.0;
  double finest_shift_m = 0.0;
  double finest_tilt_deg = 0.0;
  int max_nodes = 2'000'000;  // given up beyond
  bool refine = true;         // ICP in space at the end
};
void describe(ConfigTable& table, GoIcpConfig& config);

// How the search ended: certified, by the paper's own rule, out of nodes, or without a start.
enum class GoIcpStatus { kCertified, kConverged, kNodeLimit, kTooFewPoints };
// The name of a status in messages and tables.
[[nodiscard]] std::string to_string(GoIcpStatus status);

// The best motion that branch and bound found, P0 (22), and what is certain of it.
struct [[nodiscard]] GoIcpResult {
  GoIcpStatus status = GoIcpStatus::kTooFewPoints;
  std::string reason;        // empty if certified (or, in the paper's mode, converged)
  Pose target_from_source;   // with `refine`: refined in space from the optimum
  Pose optimum;              // what the certificate is about
  double error_rms_m = 0.0;  // trimmed error there, in the plane or in space as it was searched
  double gap_m = 0.0;        // no motion in the range has an error smaller by more than this
  double overlap = 0.0;      // at target_from_source
  double cells = 0.0;        // boxes of the finest size that the whole range holds (P0 T3)
  std::int64_t nodes = 0;    // boxes whose bound was computed
  int icp_runs = 0;
};

// `guess` is the middle of the search. z is up in both frames; where the plane is searched, both
// clouds are level, or made level by the tilt of the guess. Deterministic; thread-safe.
GoIcpResult register_go_icp(const SparseTarget& target, const SparsePoints& source,
                            const Pose& guess, const GoIcpConfig& config);

}  // namespace understory
