#include "understory/graph/self_correction/stem_correction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "understory/graph/self_correction/test_road.h"
#include "understory/util/random.h"

namespace understory {
namespace {

using test::Road;

struct Errors {
  double tilt_deg = 0.0;  // RMS
  double height_m = 0.0;  // RMS, first pose at its true height
  double plane_m = 0.0;   // RMS, first pose where it was, its heading the true one
};

Errors errors(const std::vector<Pose>& world_from_body, const std::vector<Pose>& truth) {
  const auto heading = [](const Pose& pose) {
    const Eigen::Vector3d x = pose.rotation() * Eigen::Vector3d::UnitX();
    return std::atan2(x.y(), x.x());
  };
  const Pose turn(
      so3_exp(Eigen::Vector3d(0.0, 0.0, heading(truth[0]) - heading(world_from_body[0]))),
      Eigen::Vector3d::Zero());
  const Eigen::Vector3d shift = truth[0].translation() - turn * world_from_body[0].translation();
  Errors sums;
  for (std::size_t k = 0; k < truth.size(); ++k) {
    const Pose pose = turn * world_from_body[k];
    const Eigen::Vector3d up =
        (pose.rotation() * truth[k].rotation().inverse()) * Eigen::Vector3d::UnitZ();
    sums.tilt_deg += up.head<2>().squaredNorm() / (kDegree * kDegree);
    const Eigen::Vector3d off = pose.translation() + shift - truth[k].translation();
    sums.height_m += off.z() * off.z();
    sums.plane_m += off.head<2>().squaredNorm();
  }
  const auto n = static_cast<double>(truth.size());
  return {std::sqrt(sums.tilt_deg / n), std::sqrt(sums.height_m / n), std::sqrt(sums.plane_m / n)};
}

TEST(StemCorrection, HeightsOfFeetThatAreGuessedDoNotTiltThePath) {
  const Road road = test::drive(3);
  SparseOdometry odometry({});
  Random random(4);
  Pose detour;  // a turn at each view leaves something to correct
  std::vector<SparseStep> steps;
  std::vector<Pose> chained;
  for (const StemView& view : road.views) {
    steps.push_back(odometry.add(view));
    Pose& pose = steps.back().world_from_body;
    detour = detour * Pose(pose.rotation(), pose.translation()) *
             Pose(so3_exp(0.1 * kDegree * random.normal() * Eigen::Vector3d::UnitZ()),
                  Eigen::Vector3d::Zero()) *
             pose.inverse();
    pose = detour * pose;
    chained.push_back(steps.back().world_from_body);
  }
  StemCorrectionConfig config;
  config.correction.largest_share = 0.1;
  StageTimes times;
  const StemCorrection corrected = correct_stems(road.views, steps, config, times);
  EXPECT_GT(corrected.self.kept, 3);
  const Errors before = errors(chained, road.truth);
  const Errors after = errors(corrected.world_from_body, road.truth);
  EXPECT_LT(after.tilt_deg, std::max(0.3, 1.2 * before.tilt_deg));
  EXPECT_LT(after.height_m, 1.1 * before.height_m + 0.02);
  EXPECT_LT(after.plane_m, 0.5 * before.plane_m);
}

}  // namespace
}  // namespace understory
