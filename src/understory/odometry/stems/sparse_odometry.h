#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "understory/geometry/pose.h"
#include "understory/odometry/odometry_constants.h"
#include "understory/odometry/stems/sight_noise.h"
#include "understory/odometry/stems/stem_levelling.h"
#include "understory/registration/stems/go_icp.h"
#include "understory/registration/stems/sparse_icp.h"
#include "understory/registration/stems/yaw_vote.h"
#include "understory/sensor/stem_view.h"
#include "understory/util/config/config.h"
#include "understory/util/files/binary_io.h"

namespace understory {

// How views of stems are positioned one after another.
struct SparseOdometryConfig {
  // Frame: each view to the one before, P0 (16). Map: to the stems of the views before, gathered.
  enum class Target { kFrame, kMap };
  Target target = Target::kMap;
  // How: trimmed ICP from the prediction, or branch and bound in a small box around it before (P1's
  // sSLAM). Where either finds too little, a search over every yaw follows.
  enum class Matcher { kIcp, kGoIcp };
  Matcher matcher = Matcher::kIcp;
  SparseIcpConfig icp;
  GoIcpConfig go_icp = small_box();
  YawVoteConfig search;
  double min_overlap = 0.5;  // below it the guess was wrong: search; if still below: weak
  // A stem of the local map moves by at most this share of the difference to where it is seen.
  // It moves by less as far as the sights tell that they scatter (SightNoise). On real views a
  // fixed share below 1 did not help: their errors change slowly from view to view.
  double map_forgetting = 1.0;
  int map_frames = 12;     // stems not seen for longer leave the local map
  double tilt_gain = 0.2;  // share of the tilt from the stems' axes taken over at each view

  [[nodiscard]] static GoIcpConfig small_box();
};
void describe(ConfigTable& table, SparseOdometryConfig& config);

// What became of one view.
enum class SparseStepStatus {
  kFirst,
  kTracked,   // matched from the prediction
  kSearched,  // matched after a search over yaw and translation
  kWeak,      // little overlap even after the search: the best match, not to be trusted
  kUnmatched  // too few stems: the pose is the prediction
};

// The name of a status in steps.csv.
[[nodiscard]] const char* to_string(SparseStepStatus status);

// One view's pose and how well it fits.
struct SparseStep {
  SparseStepStatus status = SparseStepStatus::kFirst;
  Pose world_from_body;
  Pose previous_from_body;                     // the step itself
  Matrix6d covariance = Matrix6d::Identity();  // of the step, right perturbation
  double overlap = 0.0;                        // P0's lambda, measured
  double error_m = 0.0;                        // P0's e
  StemUp up;                                   // by which the view was levelled
  double spacing_m = 0.0;                      // P0's L0 of what the view was matched to, (23)
};

// Odometry from stems alone: one view after another to a local map of stems, tilt held by the axes
// of the stems. The world frame has z up and its x axis along the first view's, origin there.
// Not thread-safe; deterministic.
class SparseOdometry {
 public:
  explicit SparseOdometry(const SparseOdometryConfig& config) : config_(config) {}

  // Positions a view and takes its stems up into the local map.
  SparseStep add(const StemView& view);
  // Positions a view against the local map and leaves the map as it is. Views that are close
  // together should not all enter the map: each adds the error of its own match to those after it.
  // `expected_step` is previous_from_body as it is expected; without one the last shift goes on.
  // `up` is up as it is known from elsewhere too, in place of what the stems alone say. Without it
  // up is about where it was in the view before.
  SparseStep track(const StemView& view, const std::optional<Pose>& expected_step = {},
                   const std::optional<StemUp>& up = {});
  // Takes up the stems of the view that was positioned last.
  void take_up_last();
  // Of the local map: bounded by what the last `map_frames` views have seen.
  [[nodiscard]] std::size_t stems_in_memory() const { return landmarks_.size(); }

  // The whole state, bit for bit; `load` in place of the views so far, same configuration.
  void save(BinaryWriter& writer) const;
  void load(BinaryReader& reader);

 private:
  struct Landmark {
    Eigen::Vector3d point_in_world;
    double height_sd_m = 0.0;  // of the last sight; 0: the view did not say
    int last_seen = 0;
    int sights = 1;
    Eigen::Vector3d last_sight_in_world = Eigen::Vector3d::Zero();
    Eigen::Vector3d last_change = Eigen::Vector3d::Zero();  // of the last sight from the one before
  };
  struct Match {
    SparseIcpResult icp;
    double l0_m = 0.0;
    bool searched = false;
  };

  // A view's stems with z up, and how well their heights are known (empty: not said).
  struct Source {
    SparsePoints points;
    std::vector<double> height_sd_m;
  };

  [[nodiscard]] std::shared_ptr<const SparseTarget> target() const;
  [[nodiscard]] Match match(const Source& source, const Pose& guess) const;
  [[nodiscard]] Pose guess(const Pose& level_from_body,
                           const std::optional<Pose>& expected_step) const;
  [[nodiscard]] Eigen::Vector3d about_up(const StemView& view) const;
  void take_up(const Source& source, const Pose& world_from_level);
  void see_again(Landmark& landmark, const Eigen::Vector3d& at);

  SparseOdometryConfig config_;
  std::vector<Landmark> landmarks_;
  SightNoise plane_noise_{odometry_constants::sight_noise::kLeastNoiseInPlaneM};
  SightNoise height_noise_{odometry_constants::sight_noise::kLeastNoiseInHeightM};
  // Of the landmarks, with the origin where the view stood that was taken up last; as long as none
  // is taken up it stays.
  std::shared_ptr<const SparseTarget> target_;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  Source last_source_;
  int count_ = 0;  // views in the map
  Pose world_from_body_;
  Pose world_from_level_;  // z up, turned like the body, of the last view
  Eigen::Vector3d last_shift_in_level_ = Eigen::Vector3d::Zero();
};

}  // namespace understory
