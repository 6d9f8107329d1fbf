#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "understory/registration/global/global_match.h"
#include "understory/registration/global/level_cloud.h"
#include "understory/registration/global/match_verdict.h"
#include "understory/registration/global/pose_evidence.h"
#include "understory/registration/global/range_view.h"
#include "understory/registration/global/search_cloud.h"
#include "understory/registration/global/test_scans.h"
#include "understory/registration/global/upright_search.h"
#include "understory/registration/global/uprights.h"
#include "understory/registration/matcher.h"
#include "understory/registration/ndt/ndt_matcher.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

Pose pitched(double x, double y, double z, double yaw, double pitch = 0.0) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
                             Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY())),
          {x, y, z}};
}

void expect_pose(const Pose& found, const Pose& truth, double metres, double degrees) {
  const Pose off = truth.inverse() * found;
  EXPECT_LT(off.translation().norm(), metres);
  EXPECT_LT(off.angle() * 180.0 / M_PI, degrees);
}

// Two scans of one stand, 8 m and 100 degrees apart, the second tilted.
struct TwoScans {
  testing::ScanStand stand{3};
  Pose first = pitched(0.0, 0.0, 2.0, 0.3);
  Pose second = pitched(7.0, -4.0, 2.2, 2.0, 0.15);
  Points target = stand.scan(first, 1);
  Points source = stand.scan(second, 2);
  Pose truth = first.inverse() * second;
};

const TwoScans& two_scans() {
  static const TwoScans scans;
  return scans;
}

MatchVerdict judged(const TwoScans& scans, const RegistrationResult& result) {
  const SearchCloud target = prepare_search(scans.target);
  const SearchCloud source = prepare_search(scans.source);
  return judge_match(target, source, result, search_poses(target, source));
}

TEST(GlobalMatch, FindsThePoseWithoutAGuessAndTrustsIt) {
  const TwoScans& scans = two_scans();
  const GlobalRegistration done = register_globally(scans.target, scans.source);
  expect_pose(done.result.target_from_source, scans.truth, 0.1, 0.5);
  EXPECT_TRUE(done.verdict.trusted) << done.verdict.reason;
  EXPECT_GT(done.verdict.chance, 0.95);
  EXPECT_LT(done.verdict.evidence.seen_through, 0.02);
}

TEST(GlobalMatch, GivesTheSameBitsForAnyNumberOfThreads) {
  const TwoScans& scans = two_scans();
  GlobalRegistration done[2];
  for (int i = 0; i < 2; ++i)
    with_threads(i + 1, [&] { done[i] = register_globally(scans.target, scans.source); });
  EXPECT_EQ(done[0].result.target_from_source.matrix(), done[1].result.target_from_source.matrix());
  EXPECT_EQ(done[0].verdict.chance, done[1].verdict.chance);
}

TEST(GlobalMatch, SparseScansAreNotMatchedWithSmallCells) {
  const SearchCloud sparse = prepare_search(two_scans().target);
  ASSERT_LT(two_scans().target.size(), 35000U);
  EXPECT_EQ(sparse.fine_target, sparse.target);
  Points dense = two_scans().target;
  while (dense.size() < 35000U)
    dense.insert(dense.end(), two_scans().target.begin(), two_scans().target.end());
  const SearchCloud more = prepare_search(dense);
  EXPECT_NE(more.fine_target, more.target);
}

TEST(GlobalMatch, TwoStandsAreNotMatched) {
  const TwoScans& scans = two_scans();
  const testing::ScanStand other(77);
  const GlobalRegistration done =
      register_globally(scans.target, other.scan(pitched(1.0, 2.0, 2.0, 1.0), 5));
  EXPECT_FALSE(done.verdict.trusted);
  EXPECT_FALSE(done.verdict.reason.empty());
  EXPECT_LT(done.verdict.chance, 0.5);
}

// A pose that is wrong by metres is refused whichever method says that it converged.
TEST(MatchVerdict, AConvergedMatchInAWrongPlaceIsRefused) {
  const TwoScans& scans = two_scans();
  RegistrationResult result;
  result.status = RegistrationStatus::kConverged;
  result.target_from_source = scans.truth;
  EXPECT_TRUE(judged(scans, result).trusted);
  for (const Pose& step : {pitched(2.5, 0.0, 0.0, 0.0), pitched(0.0, 0.0, 0.0, 0.3)}) {
    result.target_from_source = scans.truth * step;
    const MatchVerdict verdict = judged(scans, result);
    EXPECT_FALSE(verdict.trusted);
    EXPECT_NE(verdict.reason.find("another pose"), std::string::npos) << verdict.reason;
  }
}

TEST(MatchVerdict, AMatchFromABadGuessBeginsAgainWhereTheSearchPutsIt) {
  const TwoScans& scans = two_scans();
  NdtMatcherConfig ndt;
  ndt.cell_sizes_m = {3.0, 1.0};
  const MatchTargetPtr target = make_matcher(ndt)->make_target(voxel_means(scans.target, 0.1));
  const Points source = voxel_means(scans.source, 0.25);
  std::vector<std::size_t> terms_of;
  const MatchFrom match = [&](const Pose& guess, const PoseTerms& terms) {
    terms_of.push_back(terms.size());
    return target->match(source, guess, terms, MatchStart::kFar);
  };
  const GlobalRegistration near = match_and_judge(
      scans.target, scans.source, scans.truth * pitched(0.1, 0.0, 0.0, 0.01), match);
  EXPECT_TRUE(near.verdict.trusted) << near.verdict.reason;
  // Trusted at once: of such sparse scans a first match, and one with their tilt and height.
  ASSERT_EQ(terms_of.size(), 2U);
  EXPECT_EQ(terms_of[0], 0U);
  EXPECT_EQ(terms_of[1], 1U);
  const GlobalRegistration far =
      match_and_judge(scans.target, scans.source, scans.truth * pitched(6.0, 3.0, 0.0, 1.5), match);
  EXPECT_TRUE(far.verdict.trusted) << far.verdict.reason;
  expect_pose(far.result.target_from_source, scans.truth, 0.1, 0.5);
  // Where the bad guess leads too few stems meet, so one match there and two at the second start.
  ASSERT_EQ(terms_of.size(), 5U);
  EXPECT_EQ(terms_of[2], 0U);
  EXPECT_EQ(terms_of[3], 0U);
  EXPECT_EQ(terms_of[4], 1U);
}

TEST(MatchVerdict, ASparseMatchThatTellsThePlaceLooselyIsRefused) {
  const TwoScans& scans = two_scans();
  RegistrationResult result;
  result.status = RegistrationStatus::kConverged;
  result.target_from_source = scans.truth;
  for (const double sd_m : {0.02, 0.2}) {
    result.information = Matrix6d::Identity() / (sd_m * sd_m / 3.0);
    const MatchVerdict verdict = judged(scans, result);
    EXPECT_EQ(verdict.trusted, sd_m < 0.1) << verdict.reason;
    EXPECT_EQ(verdict.reason.find("share too little") != std::string::npos, sd_m > 0.1);
  }
}

TEST(MatchVerdict, AMatchThatDidNotConvergeOrLeavesDirectionsOpenIsRefused) {
  const TwoScans& scans = two_scans();
  RegistrationResult result;
  result.target_from_source = scans.truth;
  result.status = RegistrationStatus::kIterationLimit;
  EXPECT_FALSE(judged(scans, result).trusted);
  result.status = RegistrationStatus::kConverged;
  result.degenerate_directions = Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, 1);
  EXPECT_FALSE(judged(scans, result).trusted);
}

// What speaks for a pose is counted at the right one, and what speaks against it at a wrong one.
TEST(MatchVerdict, TheEvidenceTellsTheRightPoseFromAWrongOne) {
  const TwoScans& scans = two_scans();
  const SearchCloud target = prepare_search(scans.target);
  const SearchCloud source = prepare_search(scans.source);
  const Pose right = target.level_from_cloud * scans.truth * source.level_from_cloud.inverse();
  const PoseEvidence good = weigh_pose(target, source, right);
  EXPECT_GE(good.matched, 8.0);
  EXPECT_GT(good.matched, 2.0 * good.by_chance);
  EXPECT_LT(good.seen_through, 0.02);
  const PoseEvidence bad = weigh_pose(target, source, right * pitched(2.5, 1.5, 0.0, 0.4));
  EXPECT_LT(bad.matched, 0.5 * good.matched);
  EXPECT_GT(bad.seen_through, 3.0 * good.seen_through + 0.02);
  EXPECT_LT(bad.near, good.near);
}

TEST(MatchVerdict, AMatchBesideTheRightPoseIsRefused) {
  const TwoScans& scans = two_scans();
  RegistrationResult result;
  result.status = RegistrationStatus::kConverged;
  for (const double off : {0.28, 0.3, 0.35, 0.45}) {
    result.target_from_source = scans.truth * pitched(off, 0.0, 0.0, 0.0);
    const MatchVerdict verdict = judged(scans, result);
    EXPECT_FALSE(verdict.trusted) << off << " m beside it";
    EXPECT_GT(verdict.moved_m, 0.25) << off;
  }
}

// Each trait moves the chance the way that it should.
TEST(MatchVerdict, TheChanceGrowsWithWhatSpeaksForThePose) {
  PoseEvidence even{.near = 0.5,
                    .seen_through = 0.02,
                    .looked_at = 1.0,
                    .fine = 0.03,
                    .fine_aside = 0.012,
                    .peak_off_m = 0.0,
                    .matched = 6.0,
                    .by_chance = 2.0};
  const double usual = chance_of_right(even, 0.7, 0.4);
  EXPECT_GT(usual, 0.0);
  EXPECT_LT(usual, 1.0);
  PoseEvidence other = even;
  other.seen_through = 0.1;
  EXPECT_LT(chance_of_right(other, 0.7, 0.4), usual);
  other = even;
  other.fine = 0.06;
  EXPECT_GT(chance_of_right(other, 0.7, 0.4), usual);
  other = even;
  other.matched = 20.0;
  EXPECT_GT(chance_of_right(other, 0.7, 0.4), usual);
  EXPECT_LT(chance_of_right(even, 0.7, 0.7), usual);
}

TEST(GlobalMatch, OddCloudsAreRefusedWithAReason) {
  const TwoScans& scans = two_scans();
  Random random(1);
  Points plane;
  Points line;
  for (int i = 0; i < 20000; ++i) {
    const auto x = static_cast<float>(random.uniform(-30.0, 30.0));
    const auto y = static_cast<float>(random.uniform(-30.0, 30.0));
    plane.emplace_back(x, y, 0.0F);
    line.emplace_back(x, 0.0F, 0.0F);
  }
  Points millimetres = scans.source;
  for (Eigen::Vector3f& point : millimetres)
    point *= 1000.0F;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const Points ten(scans.source.begin(), scans.source.begin() + 10);
  for (const Points& odd :
       {Points(), ten, plane, line, millimetres, Points(1000, Eigen::Vector3f(nan, nan, nan))}) {
    for (const bool as_source : {true, false}) {
      const GlobalRegistration done =
          as_source ? register_globally(scans.target, odd) : register_globally(odd, scans.source);
      EXPECT_FALSE(done.verdict.trusted) << odd.size();
      EXPECT_FALSE(done.verdict.reason.empty()) << odd.size();
      EXPECT_TRUE(done.result.target_from_source.matrix().allFinite());
    }
  }
  EXPECT_NE(register_globally(scans.target, millimetres).verdict.reason.find("millimetres"),
            std::string::npos);
}

TEST(LevelCloud, StemsTellWhereUpIs) {
  const testing::ScanStand stand(5);
  for (const double pitch : {-0.4, 0.0, 0.3}) {
    const Pose pose = pitched(0.0, 0.0, 2.0, 0.7, pitch);
    const UpEstimate found = estimate_up(voxel_means(stand.scan(pose, 3), 0.2));
    const Eigen::Vector3d up = pose.rotation().conjugate() * Eigen::Vector3d::UnitZ();
    EXPECT_LT(std::acos(std::min(1.0, found.up.dot(up))) * 180.0 / M_PI, 2.0) << pitch;
  }
}

TEST(LevelCloud, TheGroundIsFoundUnderPlantsAndBetweenItsPoints) {
  Points points;
  for (float x = -20.0F; x < 20.0F; x += 0.25F) {
    for (float y = -20.0F; y < 20.0F; y += 0.25F) {
      const bool hidden = std::abs(x) < 2.5F && std::abs(y) < 2.5F;
      points.emplace_back(x, y, 0.1F * x + (hidden ? 3.0F : 0.0F));
    }
  }
  points.emplace_back(10.0F, 10.0F, -8.0F);  // an echo's fault
  const GroundGrid ground(points);
  EXPECT_NEAR(ground.at(10.0F, 10.0F), 1.0, 0.15);
  EXPECT_LT(ground.at(0.0F, 0.0F), 1.6);
}

TEST(Uprights, StemsStandAloneAndAWallDoesNot) {
  Points points;
  std::vector<float> above;
  const auto add = [&](float x, float y) {
    for (float z = 0.1F; z < 8.0F; z += 0.1F) {
      points.emplace_back(x, y, 5.0F + z);
      above.push_back(z);
    }
  };
  add(3.0F, 4.0F);
  add(-6.0F, 2.0F);
  for (float y = -10.0F; y < 10.0F; y += 0.15F) {
    for (const float x : {12.0F, 12.2F, 12.4F})
      add(x, y);
  }
  const std::vector<Upright> found = find_uprights(points, above, 50);
  ASSERT_GE(found.size(), 2U);
  EXPECT_LT((found[0].at - Eigen::Vector2d(3.0, 4.0)).norm(), 0.05);
  EXPECT_LT((found[1].at - Eigen::Vector2d(-6.0, 2.0)).norm(), 0.05);
  EXPECT_NEAR(found[0].ground_m, 5.0, 0.01);
  for (std::size_t i = 2; i < found.size(); ++i)  // at most its two ends
    EXPECT_GT(std::abs(found[i].at.y()), 9.0) << found[i].at.transpose();
}

TEST(UprightSearch, PairsVoteForTheMotionAmongStrangers) {
  Random random(4);
  const Pose truth = pitched(12.0, -5.0, 0.7, 2.4);
  std::vector<Upright> target;
  std::vector<Upright> source;
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3d at(random.uniform(-25.0, 25.0), random.uniform(-25.0, 25.0), 0.0);
    source.push_back({at.head<2>(), 0.0, 8});
    const Eigen::Vector3d there = truth * at;
    const Eigen::Vector2d noise(0.05 * random.normal(), 0.05 * random.normal());
    if (i < 25) target.push_back({there.head<2>() + noise, there.z(), 8});
  }
  for (int i = 0; i < 40; ++i)
    target.push_back({{random.uniform(-15.0, 40.0), random.uniform(-30.0, 20.0)}, 0.7, 8});
  const std::vector<UprightMatch> found = match_uprights(target, source, 5);
  ASSERT_FALSE(found.empty());
  expect_pose(found[0].target_from_source, truth, 0.2, 0.5);
  EXPECT_GE(found[0].matched, 22);
}

TEST(RangeView, TellsAViewFromAMapAndWhatIsSeenThrough) {
  const TwoScans& scans = two_scans();
  const RangeView view(scans.target, Eigen::Vector3f::Zero());
  EXPECT_TRUE(view.is_one_view());
  Points map = scans.target;
  Random random(8);
  for (const Eigen::Vector3f& point : scans.target) {  // the same directions, other ranges
    for (int k = 0; k < 3; ++k)
      map.push_back(point * static_cast<float>(random.uniform(0.3, 3.0)));
  }
  EXPECT_FALSE(RangeView(map, Eigen::Vector3f::Zero()).is_one_view());
  int through = 0;
  int seen = 0;
  int behind = 0;
  int all = 0;
  for (std::size_t i = 0; i < scans.target.size(); i += 50) {
    if (scans.target[i].norm() < 6.0F) continue;
    ++all;
    seen += view.look(scans.target[i]) == RangeView::Sight::kSeen ? 1 : 0;
    through += view.look(0.3F * scans.target[i]) == RangeView::Sight::kSeenThrough ? 1 : 0;
    behind += view.look(4.0F * scans.target[i]) == RangeView::Sight::kUnknown ? 1 : 0;
  }
  EXPECT_GT(seen, 0.9 * all);
  EXPECT_GT(through, 0.7 * all);
  EXPECT_GT(behind, 0.7 * all);
}

}  // namespace
}  // namespace understory
