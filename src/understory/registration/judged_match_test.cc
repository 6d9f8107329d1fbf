#include "understory/registration/judged_match.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

struct Limits {
  int min_matches = 10;
  int max_iterations = 30;
  double independent_share = 0.5;
  double degenerate_ratio = 1e-4;
};

// Forty of fifty points matched, with residuals twice as wide as modelled.
MatchSums sums() {
  MatchSums at;
  at.matched = 40;
  at.nearest_squared = 40 * 0.09;
  at.weight = 20.0;
  at.weighted_residual = 4.0 * 60.0;
  at.weighted_rows = 60.0;
  at.surface_squared = 20.0 * 0.0016;
  at.hessian = 100.0 * Matrix6d::Identity();
  return at;
}

RegistrationResult conclude_from(const MatchSums& at, bool converged = true) {
  const internal::Minimum minimum{
      Pose(Eigen::Quaterniond::Identity(), {1.0, 0.0, 0.0}), {}, 7, converged};
  return internal::judged_match(minimum, at, Points(50), 10.0, Pose(),
                                internal::Judgement(Limits{}));
}

TEST(Conclude, FiguresAreThoseOfTheSums) {
  const RegistrationResult result = conclude_from(sums());
  EXPECT_EQ(result.status, RegistrationStatus::kConverged);
  EXPECT_EQ(result.reason, "");
  EXPECT_EQ(result.iterations, 7);
  EXPECT_DOUBLE_EQ(result.target_from_source.translation().x(), 1.0);
  EXPECT_DOUBLE_EQ(result.inlier_ratio, 0.8);
  EXPECT_DOUBLE_EQ(result.fitness_m2, 0.09);
  EXPECT_DOUBLE_EQ(result.surface_residual_m2, 0.0016);
  EXPECT_TRUE(result.information.isApprox(0.5 / 4.0 * 100.0 * Matrix6d::Identity()));
  EXPECT_EQ(result.degenerate_directions.cols(), 0);
}

TEST(JudgedMatch, ResidualsThatLookTooGoodAreNotTrusted) {
  MatchSums at = sums();
  at.weighted_residual = 0.0;
  EXPECT_TRUE(conclude_from(at).information.isApprox(0.5 / 0.1 * at.hessian));
}

TEST(Conclude, ADirectionWithoutInformationIsNamed) {
  MatchSums at = sums();
  at.hessian(4, 4) = 0.0;
  const RegistrationResult result = conclude_from(at);
  ASSERT_EQ(result.degenerate_directions.cols(), 1);
  EXPECT_NEAR(std::abs(result.degenerate_directions(4, 0)), 1.0, 1e-9);
}

TEST(OverallFitness, PointsWithoutAMatchCountAsAtTheReach) {
  RegistrationResult result;
  result.fitness_m2 = 0.04;
  result.inlier_ratio = 0.75;
  EXPECT_DOUBLE_EQ(overall_fitness_m2(result, 0.5), 0.75 * 0.04 + 0.25 * 0.25);
  result.inlier_ratio = 1.0;
  EXPECT_DOUBLE_EQ(overall_fitness_m2(result, 0.5), 0.04);
  result.inlier_ratio = 0.0;
  EXPECT_DOUBLE_EQ(overall_fitness_m2(result, 2.0), 4.0);
}

TEST(Conclude, SaysWhatIsWrong) {
  const RegistrationResult slow = conclude_from(sums(), false);
  EXPECT_EQ(slow.status, RegistrationStatus::kIterationLimit);
  EXPECT_NE(slow.reason.find("30 iterations"), std::string::npos);
  MatchSums few = sums();
  few.matched = 9;
  const RegistrationResult refused = conclude_from(few);
  EXPECT_EQ(refused.status, RegistrationStatus::kTooFewMatches);
  EXPECT_NE(refused.reason.find("9 of 50"), std::string::npos);
  EXPECT_DOUBLE_EQ(refused.target_from_source.translation().x(), 0.0) << "the guess";
  MatchSums nothing = sums();
  nothing.hessian.setZero();
  EXPECT_EQ(conclude_from(nothing).status, RegistrationStatus::kDegenerate);
}

}  // namespace
}  // namespace understory
