#include "understory/registration/penalties.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "understory/util/error.h"

namespace understory {
namespace {

// A point of the source that lies at `arm` (axes of the target) from the antenna, as believed.
PenaltyPoint point_at(const PoseBelief& belief, const Eigen::Vector3d& arm) {
  PenaltyPoint point;
  point.position_in_target = belief.target_from_source * belief.point_in_source + arm;
  point.point_in_source =
      belief.point_in_source + belief.target_from_source.rotation().conjugate() * arm;
  // A small turn w of the target's axes moves it by w x arm. A larger one also brings it nearer, by
  // half its square. A heading that is some degrees off would push the scan along its arm else.
  const Eigen::Matrix3d lever = skew(arm);
  const Eigen::Matrix3d aside = lever * belief.attitude_covariance * lever.transpose();
  point.covariance = belief.position_covariance + aside;
  const double length = arm.norm();
  if (length > 0.0) {
    const double nearer = 0.5 * aside.trace() / length;
    point.covariance += std::pow(nearer / length, 2.0) * arm * arm.transpose();
  }
  return point;
}

// The x axis of the source, laid into the x-y plane.
Eigen::Vector3d heading_of(const Pose& target_from_source) {
  Eigen::Vector3d ahead = target_from_source.rotation() * Eigen::Vector3d::UnitX();
  ahead.z() = 0.0;
  if (ahead.norm() < 1e-6) return Eigen::Vector3d::UnitX();  // it points up or down
  return ahead.normalized();
}

// In the metric of both covariances; around the belief, where a position of the antenna and a turn
// are independent.
PosePrior direct_term(const PoseBelief& belief) {
  const Eigen::Matrix3d rotation = belief.target_from_source.rotation_matrix();
  // Right perturbation (w, v): the antenna moves by R (v - skew(point) w), the axes turn by R w.
  Eigen::Matrix<double, 6, 6> moved = Eigen::Matrix<double, 6, 6>::Zero();
  moved.topLeftCorner<3, 3>() = rotation;
  moved.bottomLeftCorner<3, 3>() = -rotation * skew(belief.point_in_source);
  moved.bottomRightCorner<3, 3>() = rotation;
  Matrix6d information = Matrix6d::Zero();
  information.topLeftCorner<3, 3>() = belief.attitude_covariance.inverse();
  information.bottomRightCorner<3, 3>() = belief.position_covariance.inverse();
  return {belief.target_from_source, moved.transpose() * information * moved};
}

}  // namespace

PoseBelief belief_of(const Pose& target_from_source, const Matrix6d& covariance) {
  const Eigen::Matrix3d rotation = target_from_source.rotation_matrix();
  PoseBelief belief;
  belief.target_from_source = target_from_source;
  belief.position_covariance =
      rotation * covariance.bottomRightCorner<3, 3>() * rotation.transpose();
  belief.attitude_covariance = rotation * covariance.topLeftCorner<3, 3>() * rotation.transpose();
  return belief;
}

// A push F at p moves by v without a turn if F = I_tt v and p x F = I_rt v.
Eigen::Vector3d centre_of_turning(const Matrix6d& information) {
  const Eigen::Matrix3d holds = information.bottomRightCorner<3, 3>();
  const Eigen::FullPivLU<Eigen::Matrix3d> solver(holds);
  if (!solver.isInvertible()) return Eigen::Vector3d::Zero();
  const Eigen::Matrix3d turns = information.topRightCorner<3, 3>() * solver.inverse();
  return 0.5 * Eigen::Vector3d(turns(2, 1) - turns(1, 2), turns(0, 2) - turns(2, 0),
                               turns(1, 0) - turns(0, 1));
}

PoseTerm penalty_term(const PoseBelief& belief, PenaltyForm form, double arm_m, double scale) {
  UNDERSTORY_CHECK(arm_m > 0.0 && scale > 0.0);
  if (form == PenaltyForm::kDirect) return direct_term(belief);
  PointPenalties penalties{{point_at(belief, Eigen::Vector3d::Zero())}, scale};
  if (form == PenaltyForm::kThreePoints) {
    const double arm = std::max(arm_m, belief.least_arm_m);
    penalties.points.push_back(point_at(belief, -arm * Eigen::Vector3d::UnitZ()));
    penalties.points.push_back(point_at(belief, arm * heading_of(belief.target_from_source)));
  }
  return penalties;
}

}  // namespace understory
