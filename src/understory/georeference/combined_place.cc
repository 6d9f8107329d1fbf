#include "understory/georeference/combined_place.h"

#include "understory/geometry/symmetric_solver.h"
#include "understory/georeference/georeference_constants.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using Eigen::Vector3d;

// A turn through one place and a shift, as a turn through another one and a shift.
Matrix6d seen_from(const Vector3d& middle, const Vector3d& other) {
  Matrix6d change = Matrix6d::Identity();
  change.bottomLeftCorner<3, 3>() = -skew(other - middle);
  return change;
}

// The small turn through the source's middle, then the shift, from its place to `pose`.
Vector6d away_from(const PlaceEvidence& source, const Pose& pose) {
  const Pose step = pose * source.target_from_world.inverse();
  Vector6d away;
  away << so3_log(step.rotation()), step * source.middle - source.middle;
  return away;
}

// `pose` after a turn about the target's axes through `middle` and a shift.
Pose moved(const Pose& pose, const Vector3d& middle, const Vector6d& step) {
  const Eigen::Quaterniond turn = so3_exp(step.head<3>());
  return Pose(turn, middle + step.tail<3>() - turn * middle) * pose;
}

}  // namespace

Matrix6d information_about(const Matrix6d& information, const Vector3d& middle,
                           const Vector3d& other) {
  const Matrix6d change = seen_from(other, middle);
  return change.transpose() * information * change;
}

CombinedPlace combine_places(const std::vector<PlaceEvidence>& sources) {
  UNDERSTORY_CHECK(!sources.empty());
  using georeference_constants::combined_place::kNothingKnown;
  CombinedPlace place;
  place.target_from_world = sources.front().target_from_world;
  place.middle = sources.front().middle;
  constexpr int kMostSteps = 20;
  for (int k = 0; k < kMostSteps; ++k) {
    PlaceEvidence weak = sources.front();
    weak.information = kNothingKnown * Matrix6d::Identity();
    Matrix6d information = weak.information;
    Vector6d right = -weak.information * away_from(weak, place.target_from_world);
    place.disagreement = 0.0;
    for (const PlaceEvidence& source : sources) {
      const Matrix6d jacobian = seen_from(place.middle, source.middle);
      const Vector6d away = away_from(source, place.target_from_world);
      information += jacobian.transpose() * source.information * jacobian;
      right -= jacobian.transpose() * source.information * away;
      place.disagreement += away.dot(source.information * away);
    }
    const SymmetricSolver<6> factor(information);
    place.spread = factor.inverse();
    const Vector6d step = factor.solve(right);
    place.target_from_world = moved(place.target_from_world, place.middle, step);
    if (step.norm() < 1e-10) break;
  }
  return place;
}

}  // namespace understory
