#include "understory/georeference/combined_place.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>

#include "understory/georeference/satellites/gnss_fit.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

using Eigen::Vector3d;

Matrix6d information_of(const Vector6d& sd) {
  return sd.cwiseAbs2().cwiseInverse().asDiagonal();
}

// A turn about the target's axes through a place, then a shift.
Pose moved_about(const Pose& pose, const Vector3d& middle, const Vector6d& step) {
  const Eigen::Quaterniond turn = so3_exp(step.head<3>());
  return Pose(turn, middle + step.tail<3>() - turn * middle) * pose;
}

TEST(CombinedPlace, OneSourceStaysAsItIs) {
  const Pose pose(so3_exp({0.02, -0.01, 2.0}), {30.0, -20.0, 5.0});
  Vector6d sd;
  sd << 0.001, 0.002, 0.01, 1.0, 2.0, 3.0;
  const CombinedPlace place = combine_places({{pose, {100.0, 50.0, 3.0}, information_of(sd)}});
  EXPECT_LT((place.target_from_world.inverse() * pose).log().norm(), 1e-9);
  EXPECT_LT((place.spread.diagonal().cwiseSqrt() - sd).cwiseAbs().maxCoeff(), 1e-3);
  EXPECT_NEAR(place.disagreement, 0.0, 1e-9);
}

TEST(CombinedPlace, EachDegreeOfFreedomIsByWhatKnowsIt) {
  const Pose truth(so3_exp({0.0, 0.0, 1.0}), {10.0, 20.0, 2.0});
  const Vector3d middle = truth * Vector3d(40.0, 0.0, 0.0);
  Vector6d off;  // the fixes know the tilt, the trees heading and place, and nothing the height
  off << 0.0, 0.0, 3.0 * kDegree, 4.0, -3.0, 6.0;
  Vector6d sd;
  sd << 1e-4, 1e-4, 2.0 * kDegree, 4.0, 4.0, 8.0;
  const PlaceEvidence fixes{moved_about(truth, middle, off), middle, information_of(sd)};
  PlaceEvidence trees{truth, truth * Vector3d(-20.0, 10.0, 0.0), Matrix6d::Zero()};
  trees.information.diagonal() << 0.0, 0.0, 1e8, 1e6, 1e6, 0.0;
  const CombinedPlace place = combine_places({fixes, trees});
  const Pose error = truth.inverse() * place.target_from_world;
  EXPECT_NEAR(yaw_of(error), 0.0, 0.01 * kDegree);
  EXPECT_LT((truth.inverse() * (place.target_from_world * Vector3d(40.0, 0.0, 0.0)) -
             truth.inverse() * (truth * Vector3d(40.0, 0.0, 0.0)))
                .head<2>()
                .norm(),
            0.02);
  EXPECT_NEAR(error.translation().z(), 6.0, 0.1);  // as the fixes have it
  EXPECT_LT(std::sqrt(place.spread(3, 3)), 0.02);
  EXPECT_NEAR(std::sqrt(place.spread(5, 5)), 8.0, 0.1);
  EXPECT_GT(place.disagreement, 2.0);
}

TEST(CombinedPlace, TheStatedSpreadIsThatOfTheErrors) {
  const Pose truth(so3_exp({0.01, 0.0, -2.0}), {-30.0, 5.0, 1.0});
  const Vector3d first = truth * Vector3d(60.0, 20.0, 0.0);
  const Vector3d second = truth * Vector3d(-80.0, 0.0, 2.0);
  Vector6d sd1;
  sd1 << 0.002, 0.002, 0.02, 1.5, 0.5, 1.0;
  Vector6d sd2;
  sd2 << 0.01, 0.004, 0.01, 0.4, 1.0, 2.0;
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  constexpr int kRuns = 2000;
  Vector6d normalised = Vector6d::Zero();
  double squared = 0.0;
  double disagreement = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    std::vector<PlaceEvidence> sources;
    for (const auto& [middle, sd] : {std::pair(first, sd1), std::pair(second, sd2)}) {
      Vector6d step;
      for (int k = 0; k < 6; ++k)
        step[k] = sd[k] * normal(random);
      sources.push_back({moved_about(truth, middle, step), middle, information_of(sd)});
    }
    const CombinedPlace place = combine_places(sources);
    const Pose away = truth * place.target_from_world.inverse();
    Vector6d error;
    error << so3_log(away.rotation()), away * place.middle - place.middle;
    squared += error.dot(place.spread.inverse() * error) / kRuns;
    normalised += error.cwiseAbs2().cwiseQuotient(place.spread.diagonal()) / kRuns;
    disagreement += place.disagreement / kRuns;
  }
  EXPECT_NEAR(squared, 6.0, 0.4);
  for (int k = 0; k < 6; ++k)
    EXPECT_NEAR(normalised[k], 1.0, 0.15) << k;
  EXPECT_NEAR(disagreement, 6.0, 0.4);  // twelve known, six found
}

TEST(CombinedPlace, InformationIsTheSameAboutAnyPlace) {
  Matrix6d root = Matrix6d::Random();
  const Matrix6d information = root * root.transpose();
  const Vector3d one(3.0, -2.0, 1.0);
  const Vector3d other(-7.0, 4.0, 0.5);
  const Matrix6d there = information_about(information, one, other);
  EXPECT_LT((information_about(there, other, one) - information).norm(), 1e-9);
  // A turn through `one` moves `other`.
  Vector6d turn = Vector6d::Zero();
  turn.head<3>() << 0.1, 0.2, -0.3;
  Vector6d seen = turn;
  seen.tail<3>() = turn.head<3>().cross(other - one);
  EXPECT_NEAR(turn.dot(information * turn), seen.dot(there * seen), 1e-9);
}

}  // namespace
}  // namespace understory
