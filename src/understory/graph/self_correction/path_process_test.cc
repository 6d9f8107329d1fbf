#include "understory/graph/self_correction/path_process.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "understory/graph/self_correction/power_correction.h"

namespace understory {
namespace {

constexpr int kViews = 200;

Vector6d step_variances() {
  Vector6d sd;
  sd << 1e-4, 1e-4, 5e-4, 0.01, 0.01, 0.005;
  return sd.cwiseAbs2();
}

struct DriftingWalk {
  std::vector<Pose> truth;
  std::vector<Pose> odometry;
};

// A winding way. What the steps get wrong has the sd of step_variances, times 3 in yaw and in the
// plane, and is alike over `length` views.
DriftingWalk drifting_walk(unsigned seed, double length) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, 1.0);
  Vector6d sd = step_variances().cwiseSqrt();
  sd.segment<3>(2) *= 3.0;
  const double share = length > 0.0 ? std::exp(-1.0 / length) : 0.0;
  DriftingWalk result;
  Vector6d state;
  for (int c = 0; c < 6; ++c)
    state[c] = normal(random);
  Pose drift;
  for (int k = 0; k < kViews; ++k) {
    const double yaw = 0.8 * std::sin(0.3 * k) + 0.01 * k;
    result.truth.emplace_back(Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())),
                              Eigen::Vector3d(0.5 * k, 10.0 * std::sin(0.03 * k), 0.002 * k));
    for (int c = 0; c < 6; ++c)
      state[c] = share * state[c] + std::sqrt(1.0 - share * share) * normal(random);
    const Vector6d wrong = sd.cwiseProduct(state);
    const Pose at(Eigen::Quaterniond::Identity(), result.truth.back().translation());
    if (k > 0) drift = drift * at * Pose::exp(wrong) * at.inverse();
    result.odometry.push_back(drift * result.truth.back());
  }
  return result;
}

std::vector<PathObservation> observed(const std::vector<Pose>& truth, int every, int gap) {
  std::vector<PathObservation> result;
  for (int j = 0; j + gap < kViews; j += every) {
    Vector6d sd;
    sd << 1e-4, 1e-4, 1e-4, 0.005, 0.005, 0.01;
    result.push_back(
        {j, j + gap,
         truth[static_cast<std::size_t>(j)].inverse() * truth[static_cast<std::size_t>(j + gap)],
         Matrix6d(sd.cwiseAbs2().asDiagonal())});
  }
  return result;
}

double rms_error_m(const std::vector<Pose>& poses, const std::vector<Pose>& truth) {
  double squares = 0.0;
  for (std::size_t k = 0; k < poses.size(); ++k)
    squares += (poses[k].translation() - truth[k].translation()).squaredNorm();
  return std::sqrt(squares / static_cast<double>(poses.size()));
}

TEST(PathProcess, TellsHowLongStepsErrAlikeAndByHowMuch) {
  double alike = 0.0;
  double scale = 0.0;
  double alone = 0.0;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const DriftingWalk smooth = drifting_walk(seed, 20.0);
    const PathProcessResult found =
        regress_path(smooth.odometry, step_variances(), observed(smooth.truth, 4, 6), {});
    alike += found.length_views / 5.0;
    scale += found.scale / 5.0;
    const DriftingWalk rough = drifting_walk(seed, 0.0);
    alone += regress_path(rough.odometry, step_variances(), observed(rough.truth, 4, 6), {})
                 .length_views /
             5.0;
  }
  EXPECT_GT(alike, 10.0);
  EXPECT_LT(alike, 40.0);
  EXPECT_GT(scale, 2.0);
  EXPECT_LT(scale, 4.5);
  EXPECT_LT(alone, 2.5);
}

// Where errors are smooth, views between two matches are told better than by powers.
TEST(PathProcess, BetweenMatchesItBeatsPowersWhereErrorsAreSmooth) {
  double regressed = 0.0;
  double by_powers = 0.0;
  double before = 0.0;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const DriftingWalk smooth = drifting_walk(seed, 20.0);
    const std::vector<PathObservation> observations = observed(smooth.truth, 19, 20);
    before += rms_error_m(smooth.odometry, smooth.truth);
    regressed += rms_error_m(
        regress_path(smooth.odometry, step_variances(), observations, {}).world_from_view,
        smooth.truth);
    std::vector<Pose> poses = smooth.odometry;
    for (const PathObservation& pair : observations)
      apply_power_correction(poses, std::vector<double>(poses.size(), 1.0), pair.j, pair.i,
                             pair.j_from_i, {});
    by_powers += rms_error_m(poses, smooth.truth);
  }
  EXPECT_LT(by_powers, 0.5 * before);
  EXPECT_LT(regressed, 0.7 * by_powers);
}

TEST(PathProcess, AWrongMatchIsLeftOutAndWithoutAnyThePathStays) {
  const DriftingWalk rough = drifting_walk(3, 8.0);
  std::vector<PathObservation> observations = observed(rough.truth, 5, 12);
  Vector6d off;
  off << 0.0, 0.0, 0.02, 1.8, 0.0, 0.0;
  observations[11].j_from_i = observations[11].j_from_i * Pose::exp(off);
  const PathProcessResult found = regress_path(rough.odometry, step_variances(), observations, {});
  for (std::size_t k = 0; k < found.used.size(); ++k) {
    EXPECT_EQ(found.used[k], k == 11 ? 0 : 1) << k;
  }
  // As if it had not been there.
  observations.erase(observations.begin() + 11);
  const PathProcessResult without =
      regress_path(rough.odometry, step_variances(), observations, {});
  EXPECT_LT(rms_error_m(found.world_from_view, without.world_from_view), 1e-9);
  EXPECT_LT(rms_error_m(found.world_from_view, rough.truth),
            0.3 * rms_error_m(rough.odometry, rough.truth));
  const PathProcessResult none = regress_path(rough.odometry, step_variances(), {}, {});
  EXPECT_EQ(rms_error_m(none.world_from_view, rough.odometry), 0.0);
}

// Observations that say what the path says already move nothing; sure ones are obeyed.
TEST(PathProcess, SureMatchesAreObeyedByThePosesAsTheyAreBuilt) {
  const DriftingWalk smooth = drifting_walk(4, 20.0);
  std::vector<PathObservation> own = observed(smooth.odometry, 9, 30);
  const PathProcessResult still = regress_path(smooth.odometry, step_variances(), own, {});
  EXPECT_LT(rms_error_m(still.world_from_view, smooth.odometry), 1e-6);
  std::vector<PathObservation> sure = observed(smooth.truth, 9, 30);
  for (PathObservation& pair : sure)
    pair.covariance *= 1e-6;
  PathProcessConfig config;
  config.largest_chi2 = 1e12;
  const PathProcessResult moved = regress_path(smooth.odometry, step_variances(), sure, config);
  for (const PathObservation& pair : sure) {
    const Pose now = moved.world_from_view[static_cast<std::size_t>(pair.j)].inverse() *
                     moved.world_from_view[static_cast<std::size_t>(pair.i)];
    EXPECT_LT((now.inverse() * pair.j_from_i).log().norm(), 1e-3);
  }
}

}  // namespace
}  // namespace understory
