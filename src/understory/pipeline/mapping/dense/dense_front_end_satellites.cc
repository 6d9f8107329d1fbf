// What positions by satellites say of the scans while they are positioned (P3).
#include <fmt/format.h>

#include <algorithm>

#include "understory/geometry/matrix_inverse.h"
#include "understory/georeference/satellites/split_fit.h"
#include "understory/pipeline/mapping/dense/dense_front_end.h"
#include "understory/sensor/second_antenna_place.h"

namespace understory {
namespace {

// The belief as the result of a match, with its own covariance: of a right perturbation of the
// body's pose.
LidarFactor factor_of(const PoseBelief& belief) {
  const auto prior = std::get<PosePrior>(penalty_term(belief, PenaltyForm::kDirect));
  LidarFactor factor;
  factor.world_from_body = belief.target_from_source;
  factor.covariance = inverse_matrix(prior.information);
  return factor;
}

}  // namespace

void DenseFrontEnd::make_satellites() {
  satellites_.reset();
  if (config_.satellites.use == SatellitesInMatch::kNone) return;
  const LevelledBy by = odometry_->uses_imu() ? LevelledBy::kGravity : LevelledBy::kNothing;
  satellites_ = std::make_unique<SatelliteBelief>(config_.satellites, tilt_sd_deg(by, 1.0));
}

void DenseFrontEnd::take_fix(const GnssFix& fix) {
  received_.fixes.push_back(fix);
  // Those of the first scans come again where these are done again.
  if (started() && settled()) store_fixes();
  if (!satellites_) return;
  const Eigen::Vector3d antenna =
      rig_.body_from_gnss ? rig_.body_from_gnss->translation() : Eigen::Vector3d::Zero();
  satellites_->add_fix(fix, antenna, second_antenna_of(rig_));
}

ScanKnowledge DenseFrontEnd::knowledge_of(const Scan& scan) {
  if (!satellites_) return {};
  const MotionModel& motion = odometry_->motion();
  const Pose predicted = motion.predict(scan.stamp).world_from_body;
  const StampedPose there{scan.stamp, predicted};
  const std::optional<PoseBelief> belief = satellites_->at(there, motion.level_from_world());
  const std::optional<PoseBelief> heading = satellites_->heading_at(there);
  if (!belief && !heading) {
    satellites_->note_probe(predicted, predicted);  // nothing pulls
    return {};
  }
  const SatelliteBeliefConfig& config = config_.satellites;
  const bool prior = config.use == SatellitesInMatch::kPrior;
  if (prior && !odometry_->uses_imu()) {
    log_.warn("gnss.prior_without_imu",
              "gnss.match.use=prior needs an IMU; scans are matched without it");
    return {};
  }
  ++received_.counts.by_satellites;
  if (prior) return {{}, factor_of(*belief)};
  ScanKnowledge known;
  known.also_alone = satellites_->wants_probe();
  for (const std::optional<PoseBelief>& one : {belief, heading}) {
    if (one) known.terms.push_back(penalty_term(*one, config.form, config.arm_m, config.scale));
  }
  return known;
}

void DenseFrontEnd::tell_satellites(const DenseEstimate& estimate) {
  const RegistrationResult& match = estimate.match;
  const bool had_left = satellites_->drift().left();
  if (estimate.alone) satellites_->note_probe(*estimate.alone, match.target_from_source);
  satellites_->add_pose(positioned_.pose,
                        !estimate.matched || match.degenerate_directions.cols() > 0);
  if (match.usable()) satellites_->note_match(match.information);
  if (had_left || !satellites_->drift().left()) return;
  log_.warn("gnss.drift",
            fmt::format("positions by satellites leave the path of the scans at {}, by more than "
                        "they say; they do not pull until they come back",
                        format_seconds(positioned_.pose.stamp)));
}

std::vector<PositionedScan> DenseFrontEnd::finish(const Rig& /*rig*/) {
  if (satellites_ && !satellites_->aligned()) {
    log_.warn("gnss.not_aligned",
              fix_count() == 0
                  ? "gnss.match.use: the recording has no positions by satellites; scans were "
                    "matched without them"
                  : "gnss.match.use: positions by satellites never told heading and place of the "
                    "map well enough; scans were matched without them");
  }
  return {};
}

}  // namespace understory
