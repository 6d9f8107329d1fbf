#include "understory/pipeline/correction/correction_figures.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "understory/graph/self_correction/test_road.h"

namespace understory {
namespace {

// Placed by the truth before, and after as if the second half of the way had been turned by
// half a degree too much.
TEST(CorrectionFigures, ShowWhichPairsLieOnEachOther) {
  const test::Road road = test::drive(5);
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
