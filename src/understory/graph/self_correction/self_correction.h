#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/graph/map_sharpness.h"
#include "understory/graph/pose_graph.h"
#include "understory/graph/self_correction/blur_change.h"
#include "understory/graph/self_correction/correction_pairs.h"
#include "understory/graph/self_correction/power_correction.h"
#include "understory/registration/stems/go_icp.h"
#include "understory/registration/stems/sparse_icp.h"
#include "understory/util/config/config.h"
#include "understory/util/progress.h"

namespace understory {

// How a map of stems corrects itself. Some pairs of views that see the same trees are matched
// again, and their corrections are spread over the views between.
enum class CorrectionMethod {
  kNone,
  kPowers,  // P0 section 2: powers of the correction, acting in the frame of the earlier view
  kPowersPrinted,    // the same with (19) as printed, acting in each view's own frame
  kLattice,          // P1 section 2.3: a lattice of pairs, powers by match errors
  kPoseGraph,        // P0's pairs, all matched first, then solved at once with robust kernels
  kGaussianProcess,  // P0's pairs, all matched first, regressed over the path (P1 section 5)
  kExpectedGain  // pairs by what they are expected to tell, matched as gathered views, solved at
                 // once, matched again from the better poses
};

// The lattice of pairs of P1 section 2.3. Counted in views.
struct LatticeConfig {
  int spacing = 30;
  int longest_gap = 300;
  double largest_outlier_ratio = 0.6;  // as in the text of P1; 0.4 in its figure 5
  double largest_error_m = 0.0;        // of the matched stems; 0.5 m in figure 5. 0: no limit
};

// The choice of pairs by expected information. L0 is the mean distance between neighbouring stems.
struct GainConfig {
  int pool = 3000;               // pairs among which the next one is chosen
  double window_l0 = 0.8;        // views that far along the way, to each side, are gathered
  int window_views = 12;         // at most, to each side
  double match_sd_m = 0.02;      // of a match of gathered views with full overlap
  double min_gain = 0.05;        // nats; the next pair must be expected to tell that much
  int revisits = 2;              // rounds in which all accepted pairs are matched again
  double largest_step_l0 = 1.0;  // a match that moves the views farther apart is rejected
};

// Settings of `understory correct` below `correction`; the method decides which of them count.
struct SelfCorrectionConfig {
  CorrectionMethod method = CorrectionMethod::kExpectedGain;
  PairConfig pairs;
  CorrectionOrder order = CorrectionOrder::kMediumGaps;
  PowerConfig power;
  LatticeConfig lattice;
  GainConfig gain;
  SparseIcpConfig icp;
  GoIcpConfig go_icp;
  double min_final_overlap = 0.4;  // lambda0, where the match ends
  double largest_share = 0.04;     // corrections at most, of the views (not for the lattice)
  int patience = 20;               // corrections without a sharper map, then it ends (powers)
  // Solutions of all pairs at once: refused where beta is larger than before by more than this many
  // of its own standard deviations (BlurChange). 0: where it is larger at all.
  double blurrier_sd = 2.0;
  double eliminate_factor = 0.0;  // P0 section 4.2; 0: all views stay
  double eliminate_share = 0.05;
  SharpnessConfig sharpness;
  int seed = 1;
  SelfCorrectionConfig();
};
void describe(ConfigTable& table, SelfCorrectionConfig& config);

// Views with their first poses. All in level frames (z up).
struct SelfCorrectionProblem {
  std::vector<SparsePoints> views;
  std::vector<SparsePoints> map_views;     // the stems of each view by which the map is judged
  std::vector<Pose> world_from_view;       // where the correction begins
  std::vector<Pose> steps;                 // of the odometry, to each view from the one before it
  std::vector<double> step_errors;         // e of the step to each view; 0 for the first
  std::vector<Matrix6d> step_covariances;  // of the step to each view, right perturbation
  std::vector<PoseEdge> loops;             // accepted already, for the methods that solve a graph
  std::vector<TiltPrior> tilts;            // what the views know of up, for the same methods
};

// A pair that was matched again.
struct TriedCorrection {
  CorrectionPair pair;
  double error_before_m = 0.0;
  double error_after_m = 0.0;
  double overlap_after = 0.0;
  double expected_gain = 0.0;  // nats, kExpectedGain only
  double moved_m = 0.0;        // in the plane, by which the match differs from the poses before
  bool by_go_icp = false;      // ICP alone had failed
  bool accepted = false;
  bool kept = false;   // in the result
  std::string reason;  // if not accepted or not kept
  double beta = 0.0;   // of the map after it, if accepted (powers and lattice)
};

// The corrected poses, every pair that was tried, and how sharp the map was before and after.
struct [[nodiscard]] SelfCorrectionResult {
  std::vector<Pose> world_from_view;
  std::vector<char> use;  // 0: the map is better without this view
  std::vector<TriedCorrection> tried;
  std::size_t promising = 0;  // |I2|
  int kept = 0;               // corrections in the result
  int go_icp_calls = 0;
  MapSharpness before;
  MapSharpness after;
  BlurChange blur;  // from before to after
  std::string stopped_because;
};

// Corrects a map by itself. The map is never left blurrier (beta) than it was, beyond what beta can
// tell (SelfCorrectionConfig::blurrier_sd). Too few views or stems are no error: nothing is tried
// then. Deterministic; same result for any number of threads. Polls `progress`.
SelfCorrectionResult self_correct(const SelfCorrectionProblem& problem,
                                  const SelfCorrectionConfig& config,
                                  const ProgressSink& progress = {});

// Odometry as edges between the poses given, with the problem's covariances of the steps.
[[nodiscard]] PoseGraphProblem chain_problem(const SelfCorrectionProblem& problem,
                                             const std::vector<Pose>& world_from_view);

}  // namespace understory
