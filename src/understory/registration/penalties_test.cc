#include "understory/registration/penalties.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "understory/registration/icp/icp_matcher.h"
#include "understory/registration/solve.h"
#include "understory/registration/test_stand.h"

namespace understory {
namespace {

PoseBelief some_belief() {
  PoseBelief belief;
  belief.target_from_source = Pose::exp((Vector6d() << 0.1, -0.2, 0.8, 3.0, -1.0, 2.0).finished());
  belief.point_in_source = Eigen::Vector3d(0.2, -0.1, 0.5);
  belief.position_covariance << 0.04, 0.01, 0.0, 0.01, 0.09, 0.02, 0.0, 0.02, 0.25;
  belief.attitude_covariance = Eigen::Vector3d(1e-4, 2e-4, 9e-4).asDiagonal();
  return belief;
}

// P3 (6, 8) worked out as printed: points_weight / 2 times 1 / (s K) sum e^T W^-1 e.
TEST(Penalties, CountAsThePaperPrintsThem) {
  const PoseBelief belief = some_belief();
  const double weight = 40.0;
  const double scale = 2.5;
  const auto penalties =
      std::get<PointPenalties>(penalty_term(belief, PenaltyForm::kThreePoints, 1.5, scale));
  ASSERT_EQ(penalties.points.size(), 3U);
  const Pose pose = belief.target_from_source *
                    Pose::exp((Vector6d() << 0.03, 0.01, -0.02, 0.1, 0.2, -0.1).finished());
  double sum = 0.0;
  for (const PenaltyPoint& point : penalties.points) {
    const Eigen::Vector3d e = point.position_in_target - pose * point.point_in_source;
    sum += e.dot(point.covariance.fullPivLu().solve(e));
  }
  PoseCost cost;
  internal::add_term(penalties, pose, weight, cost);
  EXPECT_NEAR(cost.cost, weight / 2.0 / scale * sum / 3.0, 1e-9 * sum);
  const double h = 1e-6;
  for (int i = 0; i < 6; ++i) {
    const auto moved = [&](double by) {
      PoseCost at;
      internal::add_term(penalties, pose * Pose::exp(by * Vector6d::Unit(i)), weight, at);
      return at.cost;
    };
    EXPECT_NEAR(cost.gradient[i], (moved(h) - moved(-h)) / (2.0 * h), 1e-5 * cost.gradient.norm());
  }
}

// P3 section 5.1: one point at the position, one below it, one ahead in the x-y plane. At the
// believed pose all three meet their partners.
TEST(Penalties, ThreePointsLieAtTheAntennaBelowItAndAhead) {
  const PoseBelief belief = some_belief();
  const auto points =
      std::get<PointPenalties>(penalty_term(belief, PenaltyForm::kThreePoints, 2.0)).points;
  const Eigen::Vector3d antenna = belief.target_from_source * belief.point_in_source;
  EXPECT_LT((points[0].position_in_target - antenna).norm(), 1e-12);
  EXPECT_LT((points[1].position_in_target - antenna - Eigen::Vector3d(0, 0, -2.0)).norm(), 1e-12);
  const Eigen::Vector3d ahead = points[2].position_in_target - antenna;
  EXPECT_NEAR(ahead.norm(), 2.0, 1e-12);
  EXPECT_NEAR(ahead.z(), 0.0, 1e-12);
  const Eigen::Vector3d axis = belief.target_from_source.rotation_matrix().col(0);
  EXPECT_NEAR(std::atan2(ahead.y(), ahead.x()), std::atan2(axis.y(), axis.x()), 1e-12);
  for (const PenaltyPoint& point : points) {
    EXPECT_LT((belief.target_from_source * point.point_in_source - point.position_in_target).norm(),
              1e-12);
  }
  // The point below moves with roll and pitch, and the one ahead up and down with pitch.
  EXPECT_NEAR(points[1].covariance(0, 0), 0.04 + 4.0 * 2e-4, 1e-12);
  EXPECT_NEAR(points[1].covariance(1, 1), 0.09 + 4.0 * 1e-4, 1e-12);
  // A turn by an angle brings it nearer by half the square of that.
  EXPECT_NEAR(points[1].covariance(2, 2), 0.25 + std::pow(0.5 * 2.0 * (1e-4 + 2e-4), 2), 1e-12);
}

// Alone, the direct form has its minimum at the belief. Its curvature is that of both covariances:
// a displacement of the antenna and a turn about it.
TEST(Penalties, TheDirectFormHasTheCovariancesOfTheBelief) {
  const PoseBelief belief = some_belief();
  const PoseTerms terms = {penalty_term(belief, PenaltyForm::kDirect)};
  const auto cost = [&](const Eigen::Vector3d& turn, const Eigen::Vector3d& shift) {
    // Turned about the antenna, then shifted, in the axes of the target.
    const Eigen::Vector3d antenna = belief.target_from_source * belief.point_in_source;
    const Eigen::Quaterniond q(Eigen::AngleAxisd(turn.norm() + 1e-300, turn.stableNormalized()));
    const Pose moved(q, antenna + shift - q * antenna);
    PoseCost at;
    internal::add_terms(terms, moved * belief.target_from_source, 1.0, at);
    return at.cost;
  };
  const Eigen::Vector3d shift(0.003, -0.002, 0.004);
  EXPECT_NEAR(cost(Eigen::Vector3d::Zero(), shift),
              0.5 * shift.dot(belief.position_covariance.inverse() * shift), 1e-9);
  const Eigen::Vector3d turn(1e-4, 2e-4, -3e-4);
  const double expected = 0.5 * turn.dot(belief.attitude_covariance.inverse() * turn);
  EXPECT_NEAR(cost(turn, Eigen::Vector3d::Zero()), expected, 1e-3 * expected);
}

// A lidar whose beams are tilted by a little makes every match pitch by as much: the drift of P3
// F4. The carrier goes straight ahead over open, rolling ground and each scan joins the map.
struct Walk {
  static constexpr int kSteps = 12;
  static constexpr double kStepM = 0.4;
  static constexpr double kScale = 0.02;  // s of (8)

  // The pitch (rad) and the height error (m) at the end.
  struct End {
    double pitch_rad = 0.0;
    double off_m = 0.0;
  };
  [[nodiscard]] static End with(const std::optional<PenaltyForm>& form) {
    testing::Stand stand = testing::make_stand({.half_width_m = 15.0, .crowns = false}, 5);
    stand.bump_m = 0.3;
    testing::Pattern pattern = testing::os0_128();
    pattern.rings = 24;
    pattern.columns = 240;
    pattern.range_m = 20.0;
    IcpMatcherConfig config;
    const auto builder = make_matcher(config)->make_builder({});
    Pose estimate(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.0, 0.0, 1.6));
    for (int i = 0; i <= kSteps; ++i) {
      const Pose truth(Eigen::Quaterniond::Identity(), Eigen::Vector3d(kStepM * i, 0.0, 1.6));
      const Points scan =
          bent(testing::scan_stand(stand, truth, pattern, static_cast<std::uint64_t>(i)));
      if (i > 0) {
        PoseBelief belief;
        belief.target_from_source = truth;
        belief.position_covariance = 1e-4 * Eigen::Matrix3d::Identity();
        belief.attitude_covariance = 1e-5 * Eigen::Matrix3d::Identity();
        PoseTerms terms;
        if (form == PenaltyForm::kDirect) {
          // The weight that the points have by (8): 0.05 of some 5000 matches, over s and K.
          belief.position_covariance *= 3.0 * kScale / 250.0;
          belief.attitude_covariance *= 3.0 * kScale / 250.0;
        }
        if (form) terms.push_back(penalty_term(belief, *form, 1.0, kScale));
        const Pose guess = estimate * Pose(Eigen::Quaterniond::Identity(), {kStepM, 0.0, 0.0});
        const RegistrationResult result =
            builder->snapshot()->match(scan, guess, terms, MatchStart::kNear);
        EXPECT_TRUE(result.usable()) << result.reason;
        estimate = result.target_from_source;
      }
      builder->insert(scan, estimate, std::nullopt);
    }
    const Eigen::Vector3d ahead = estimate.rotation_matrix().col(0);
    return {-std::asin(ahead.z()),
            (estimate.translation() - Eigen::Vector3d(kSteps * kStepM, 0.0, 1.6)).norm()};
  }
  // What is ahead looks higher the farther it is, and what is behind does not. Over a few metres of
  // way each scan then seems to have pitched.
  [[nodiscard]] static Points bent(Points points) {
    for (Eigen::Vector3f& p : points)
      p.z() += 0.004F * p.x() * std::abs(p.x()) / 5.0F;
    return points;
  }
};

TEST(Penalties, OnePointDriftsInPitchAndThreePointsDoNot) {
  const Walk::End none = Walk::with(std::nullopt);
  const Walk::End one = Walk::with(PenaltyForm::kOnePoint);
  const Walk::End three = Walk::with(PenaltyForm::kThreePoints);
  const Walk::End direct = Walk::with(PenaltyForm::kDirect);
  RecordProperty("pitch_mrad_none", std::to_string(1e3 * none.pitch_rad));
  RecordProperty("pitch_mrad_one", std::to_string(1e3 * one.pitch_rad));
  RecordProperty("pitch_mrad_three", std::to_string(1e3 * three.pitch_rad));
  RecordProperty("pitch_mrad_direct", std::to_string(1e3 * direct.pitch_rad));
  EXPECT_GT(std::abs(none.pitch_rad), 0.008);
  EXPECT_GT(std::abs(one.pitch_rad), 0.008);
  EXPECT_LT(one.off_m, 0.5 * none.off_m);
  EXPECT_LT(std::abs(three.pitch_rad), 0.5 * std::abs(one.pitch_rad));
  EXPECT_LT(std::abs(direct.pitch_rad), 0.5 * std::abs(one.pitch_rad));
  EXPECT_LT(three.off_m, 0.5 * none.off_m);
}

// Points that are held in all directions alike turn about their centroid.
TEST(Penalties, APushAtTheCentreOfTurningTurnsNothing) {
  const std::vector<Eigen::Vector3d> points = {
      {4.0, 1.0, -1.0}, {-2.0, 3.0, 2.0}, {1.0, -5.0, 5.0}};
  Matrix6d information = Matrix6d::Zero();
  for (const Eigen::Vector3d& point : points) {
    Eigen::Matrix<double, 3, 6> moved;
    moved << -skew(point), Eigen::Matrix3d::Identity();
    information += 40.0 * moved.transpose() * moved;
  }
  const Eigen::Vector3d centre = centre_of_turning(information);
  EXPECT_LT((centre - Eigen::Vector3d(1.0, -1.0 / 3.0, 2.0)).norm(), 1e-9);
  const Eigen::Vector3d push(3.0, -2.0, 1.0);
  Vector6d wrench;
  wrench << centre.cross(push), push;
  const Vector6d motion = information.ldlt().solve(wrench);
  EXPECT_LT(motion.head<3>().norm(), 1e-9);
  EXPECT_EQ(centre_of_turning(Matrix6d::Zero()), Eigen::Vector3d::Zero());
}

}  // namespace
}  // namespace understory
