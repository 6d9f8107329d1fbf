#include "understory/pipeline/correction/stem_correction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "understory/pipeline/correction/correction_figures.h"
#include "understory/util/random.h"

namespace understory {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

// A road of 60 m through a stand on level ground, views of 210 degrees to 35 m from a cabin that
// swings. Where nothing shows the ground, feet are guessed too high: by a centimetre a metre of
// range from 12 m on, and roughly. Trees lean by 2 degrees, each its own way.
struct Road {
  std::vector<StemView> views;
  std::vector<Pose> truth;
};

struct Trunk {
  Eigen::Vector3d foot;
  Eigen::Vector3d axis;
};

std::vector<Trunk> stand(Random& random) {
  std::vector<Trunk> trees;
  while (trees.size() < 500) {
    Trunk tree;
    tree.foot = {random.uniform(-40.0, 100.0), random.uniform(-40.0, 40.0), 0.0};
    tree.axis =
        Eigen::Vector3d(2.0 * kDegree * random.normal(), 2.0 * kDegree * random.normal(), 1.0)
            .normalized();
    bool free = std::abs(tree.foot.y()) > 2.0;
    for (const Trunk& other : trees)
      free = free && (tree.foot - other.foot).norm() > 1.8;
    if (free) trees.push_back(tree);
  }
  return trees;
}

Road drive(std::uint64_t seed) {
  Random random(seed);
  const std::vector<Trunk> trees = stand(random);
  Road road;
  for (int k = 0; k < 150; ++k) {
    const double yaw = 0.9 * std::sin(0.3 * k);
    const Eigen::Vector3d tilt(2.0 * kDegree * random.normal(), 2.0 * kDegree * random.normal(),
                               0.0);
    road.truth.emplace_back(so3_exp(Eigen::Vector3d(0.0, 0.0, yaw)) * so3_exp(tilt),
                            Eigen::Vector3d(0.4 * k, 0.0, 2.5));
    const Pose body_from_world = road.truth.back().inverse();
    StemView view;
    view.frame = k;
    view.stamp = TimeNs{1'000'000'000} * k;
    for (const Trunk& tree : trees) {
      Eigen::Vector3d foot = tree.foot;
      const double range = (foot - road.truth.back().translation()).head<2>().norm();
      foot +=
          Eigen::Vector3d(0.02 * random.normal(), 0.02 * random.normal(), 0.05 * random.normal());
      if (range > 12.0) foot.z() += (range - 12.0) * std::abs(0.01 + 0.006 * random.normal());
      const Eigen::Vector3d seen = body_from_world * foot;
      if (range > 35.0 || std::abs(std::atan2(seen.y(), seen.x())) > 1.83) continue;
      if (random.uniform(0.0, 1.0) < 0.25) continue;
      Stem stem;
      stem.point = seen.cast<float>();
      stem.axis =
          (body_from_world.rotation() *
           (tree.axis + 0.5 * kDegree * Eigen::Vector3d(random.normal(), random.normal(), 0.0)))
              .normalized()
              .cast<float>();
      stem.score = 0.9F;
      view.stems.push_back(stem);
    }
    road.views.push_back(view);
  }
  return road;
}

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
  const Road road = drive(3);
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

// Placed by the truth before, and after as if the second half of the way had been turned by
// half a degree too much.
TEST(CorrectionFigures, ShowWhichPairsLieOnEachOther) {
  const Road road = drive(5);
  CorrectionRun run;
  run.views = road.views;
  const Pose turn(so3_exp(Eigen::Vector3d(0.0, 0.0, 0.4 * kDegree)), Eigen::Vector3d::Zero());
  for (std::size_t k = 0; k < road.truth.size(); ++k) {
    SparseStep step;
    step.world_from_body = road.truth[k];
    run.steps.push_back(step);
    run.correction.world_from_body.push_back(k < 75 ? road.truth[k] : turn * road.truth[k]);
  }
  std::vector<Tree> trees(2);
  trees[0].x = 30.0;
  trees[0].y = 3.0;
  trees[1].x = 20.0;
  trees[1].y = -12.0;
  ReportCorrection report;
  add_correction_figures(run, {}, trees, report);

  ASSERT_EQ(report.matrix_before.side, 150);
  ASSERT_EQ(report.matrix_before.views, 150);
  const auto error = [](const ReportViewMatrix& matrix, std::size_t earlier, std::size_t later) {
    return matrix.error_m[earlier * 150 + later];
  };
  EXPECT_EQ(report.matrix_before.overlap[50 * 150 + 50], 1.0F);
  EXPECT_EQ(error(report.matrix_before, 50, 50), 0.0F);
  EXPECT_TRUE(std::isnan(report.matrix_before.overlap[50 * 150 + 49]));  // earlier is the later
  EXPECT_LT(error(report.matrix_before, 70, 78), 0.06F);
  EXPECT_GT(error(report.matrix_after, 70, 78), 0.2F);
  EXPECT_EQ(error(report.matrix_before, 20, 30), error(report.matrix_after, 20, 30));

  ASSERT_GT(report.pairs.size(), 1000U);
  std::size_t good = 0;
  for (const ReportPair& pair : report.pairs) {
    EXPECT_LT(pair.earlier, pair.later);
    EXPECT_LE(pair.overlap, 1.0);
    good += pair.acceptable ? 1 : 0;
  }
  // Placed by the truth.
  EXPECT_GT(good, 1000U);
  EXPECT_LT(good, report.pairs.size());

  std::size_t sights = 0;
  for (const StemView& view : road.views)
    sights += view.stems.size();
  EXPECT_EQ(report.sights_before.size(), sights);
  EXPECT_EQ(report.sights_after.size(), sights);
  EXPECT_GT(report.max_moved.x(), 55.0F);  // the far end of the turned half

  // Rings of 5 m about 60 m of way: 600 m2 and a disk's; one tree each in the first and the third.
  ASSERT_EQ(report.trees_per_ha.size(), 8U);
  EXPECT_NEAR(report.trees_per_ha[0], 1e4 / (600.0 + 78.0), 1.5);
  EXPECT_EQ(report.trees_per_ha[1], 0.0);
  EXPECT_NEAR(report.trees_per_ha[2], 1e4 / (600.0 + 393.0), 1.0);
}

}  // namespace
}  // namespace understory
