#include "understory/pipeline/judgement/match_course.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "understory/util/random.h"

namespace understory {
namespace {

struct MatchedScan {
  bool matched = true;
  double inliers = 0.8;
  double distance_m = 0.2;
};

// 60 s at 10 Hz with cells of half a metre.
MatchEvidence gathered_matches(const std::function<MatchedScan(double)>& at) {
  MatchCourse course(0.5);
  for (int i = 0; i < 600; ++i) {
    const MatchedScan scan = at(0.1 * i);
    course.add(from_seconds(1e9 + 0.1 * i), scan.matched, scan.inliers,
               scan.distance_m * scan.distance_m);
  }
  MatchEvidence evidence;
  course.put(evidence);
  return evidence;
}

TEST(MatchCourse, AGoodRunWithFewPointsAtItsBeginning) {
  const MatchEvidence evidence = gathered_matches([](double t) {
    return MatchedScan{true, t < 9.0 ? 0.1 : 0.8};
  });
  EXPECT_EQ(evidence.few_share, 0.0);
  EXPECT_EQ(evidence.chance_share, 0.0);
  EXPECT_NEAR(evidence.blur_growth, 1.0, 1e-9);
}

TEST(MatchCourse, FewPointsOverALongStretch) {
  const auto stretch = [](double inliers, bool matched) {
    return gathered_matches([=](double t) {
             return t > 30.0 && t < 40.0 ? MatchedScan{matched, inliers} : MatchedScan{};
           })
        .few_share;
  };
  EXPECT_NEAR(stretch(0.3, true), 0.2, 1e-9);
  EXPECT_NEAR(stretch(0.8, false), 0.2, 1e-9);
  EXPECT_EQ(stretch(0.5, true), 0.0);
  // A run that finds few from its beginning to its end.
  EXPECT_EQ(gathered_matches([](double) { return MatchedScan{true, 0.2}; }).few_share, 1.0);
}

// What is matched by chance lies anywhere in its cell.
TEST(MatchCourse, PointsThatLieWhereChancePutsThem) {
  Random random(1);
  double squares = 0.0;
  constexpr int kPoints = 100'000;
  for (int i = 0; i < 3 * kPoints; ++i)
    squares += std::pow(random.uniform(-0.25, 0.25), 2);
  const double chance = std::sqrt(squares / kPoints);
  EXPECT_NEAR(chance, 0.25, 1e-3);
  const MatchEvidence evidence = gathered_matches([&](double t) {
    return MatchedScan{true, 0.8, t > 50.0 ? chance : 0.2};
  });
  EXPECT_NEAR(evidence.chance_share, 0.2, 1e-9);
}

TEST(MatchCourse, AMapThatBlursAsItGrows) {
  const MatchEvidence evidence = gathered_matches([](double t) {
    return MatchedScan{true, 0.8, 0.16 + 0.001 * t};
  });
  EXPECT_NEAR(evidence.blur_growth, 0.212 / 0.178, 0.005);  // 44 s to 60 s over 10 s to 26 s
  EXPECT_EQ(evidence.chance_share, 0.0);
}

TEST(MatchCourse, TellsNothingOfAShortRun) {
  MatchCourse course(0.5);
  MatchEvidence evidence;
  course.put(evidence);
  course.add(from_seconds(5.0), true, 0.01, 1.0);
  course.put(evidence);
  EXPECT_EQ(evidence.few_share, 0.0);
  EXPECT_EQ(evidence.chance_share, 0.0);
  EXPECT_EQ(evidence.blur_growth, 1.0);
}

}  // namespace
}  // namespace understory
