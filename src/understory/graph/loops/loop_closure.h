#pragma once

#include <string>
#include <vector>

#include "understory/geometry/points.h"
#include "understory/geometry/pose.h"
#include "understory/registration/matchers.h"
#include "understory/util/config/config.h"

namespace understory {

// Two places that may be the same, and their estimated relative pose. Points of both in the body
// frames of their keyframes, thinned by a voxel filter (about 0.2-0.4 m). Best each a small map of
// a few keyframes around it.
struct LoopInput {
  Points target_points;
  Points source_points;
  Pose target_from_source;           // estimated
  double sigma_translation_m = 0.0;  // of that, per axis
  double sigma_rotation_rad = 0.0;   // of its heading
  Eigen::Vector3d up_in_target = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d up_in_source = Eigen::Vector3d::UnitZ();
};

// How a loop is matched, and when a match is accepted.
struct LoopClosureConfig {
  MatcherConfig matcher;  // for a first estimate
  // The method that has the last word, e.g. ICP as in P2-7, with its settings in `matcher`; none:
  // the last steps of the first.
  std::string refine = kNoRefinement;
  static constexpr const char* kNoRefinement = "none";
  // Where the belief is uncertain, matching starts from many places: a grid over so many standard
  // deviations, with steps that the coarsest steps can bridge.
  double search_sigmas = 2.0;
  double search_step_m = 1.5;
  double search_yaw_step_deg = 4.0;
  int max_starts = 600;    // beyond, the steps grow
  int refined_starts = 6;  // of those, the best few are carried through
  // Acceptance.
  double max_fitness_m2 =
      0.3;  // of the last match; grows with the spacing of the points, so it is wide
  double structure_low_m = 0.7;  // heights above ground of what is compared
  double structure_high_m = 6.0;
  double structure_cell_m = 0.25;
  int min_structure_points = 100;
  double min_overlap = 0.4;       // share of the structure that is found again
  double min_contrast = 0.15;     // by how much that is more than by chance
  double contrast_shift_m = 1.5;  // chance is measured shifted by this in eight directions
  double max_runner_up = 0.85;    // overlap of the second best place, as a share of the best
  double max_asymmetry_m = 0.1;   // between source to target and target to source
  double max_asymmetry_deg = 0.5;
  bool check_symmetry = true;
  // The least standard deviations of a result.
  double sigma_rotation_deg = 0.1;
  double sigma_translation_m = 0.02;
  double sigma_translation_per_m = 0.002;  // of the distance between the two: surfaces seen from
                                           // different sides fit a little too near
};
void describe(ConfigTable& table, LoopClosureConfig& config);

// What a loop's match came to, with the numbers that decided.
struct [[nodiscard]] LoopVerification {
  bool accepted = false;
  std::string reason;  // why not
  Pose target_from_source;
  Matrix6d covariance = Matrix6d::Identity();  // right perturbation, rotation first
  double fitness_m2 = 0.0;
  double overlap = 0.0;         // of the structure
  double chance_overlap = 0.0;  // the same, shifted
  double runner_up = 0.0;       // overlap of the best other place
  double asymmetry_m = 0.0;
  double asymmetry_deg = 0.0;
  int starts = 0;
};

// Decides whether two places are the same, P2-7. A first match gives an estimate, another refines
// it, and checks make sure that a chance match among stems does not pass. Pure function of its
// inputs; may run in the background. Parallel inside; same bits for any number of threads.
LoopVerification verify_loop(const LoopInput& input, const LoopClosureConfig& config);

}  // namespace understory
