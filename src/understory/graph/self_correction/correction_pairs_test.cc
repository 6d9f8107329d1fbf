#include "understory/graph/self_correction/correction_pairs.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <set>

#include "understory/graph/loops/gain_queue.h"
#include "understory/graph/loops/view_cone.h"

namespace understory {
namespace {

Pose flat(double x, double y, double yaw) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())), {x, y, 1.0}};
}

TEST(ViewCone, OverlapOfFullCirclesIsTheLensBetweenThem) {
  const double r = 30.0;
  const ConeOverlap overlap({r, M_PI});
  for (const double d : {0.0, 10.0, 25.0, 45.0, 59.0}) {
    const double lens =
        2.0 * r * r * std::acos(d / (2.0 * r)) - 0.5 * d * std::sqrt(4.0 * r * r - d * d);
    EXPECT_NEAR(overlap(flat(3.0, 4.0, 1.0), flat(3.0 + d, 4.0, -2.0)), lens / (M_PI * r * r),
                0.015);
  }
  EXPECT_EQ(overlap(flat(0.0, 0.0, 0.0), flat(61.0, 0.0, 0.0)), 0.0);
}

TEST(ViewCone, OverlapOfSectorsOnTheSpotIsTheSharedAngle) {
  const double half = 105.0 * M_PI / 180.0;  // 210 degrees, not convex
  const ConeOverlap overlap({40.0, half});
  for (const double turn : {0.0, 0.5, 1.5, 2.5, M_PI}) {
    // Two arcs of 2 half around the circle: they share 2 half - turn, and what meets behind.
    const double shared =
        std::max(0.0, 2.0 * half - turn) + std::max(0.0, turn + 2.0 * half - 2.0 * M_PI);
    EXPECT_NEAR(overlap(flat(0.0, 0.0, 0.3), flat(0.0, 0.0, 0.3 + turn)), shared / (2.0 * half),
                0.015)
        << turn;
  }
}

TEST(ViewCone, IsEstimatedFromTheViews) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<SparsePoints> views(20);
  for (SparsePoints& view : views) {
    for (int k = 0; k < 100; ++k) {
      const double a = (2.0 * unit(random) - 1.0) * 105.0 * M_PI / 180.0;
      const double r = 40.0 * std::sqrt(unit(random));
      view.emplace_back(r * std::cos(a), r * std::sin(a), 0.0);
    }
  }
  const ViewCone cone = estimate_view_cone(views);
  EXPECT_NEAR(cone.half_angle_rad * 180.0 / M_PI, 105.0, 2.0);
  EXPECT_NEAR(cone.range_m, 40.0 * std::sqrt(0.9), 1.0);
  EXPECT_EQ(estimate_view_cone({}).range_m, 0.0);
}

// As IsEstimatedFromTheViews, by a lidar that looks along `yaw` of its frame. The middle was taken
// to be the x axis once, so a lidar that looks backwards had no sector.
TEST(ViewCone, ItsMiddleIsWhereTheLidarLooks) {
  const double half = 105.0 * M_PI / 180.0;
  for (const double yaw : {0.0, 0.5 * M_PI, M_PI, -2.0}) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    std::vector<SparsePoints> views(20);
    for (int k = 0; k < 2000; ++k) {
      const double a = yaw + (2.0 * unit(random) - 1.0) * half;
      const double r = 40.0 * std::sqrt(unit(random));
      views[static_cast<std::size_t>(k % 20)].emplace_back(r * std::cos(a), r * std::sin(a), 0.0);
    }
    const ViewCone cone = estimate_view_cone(views);
    EXPECT_NEAR(cone.half_angle_rad, half, 0.05) << yaw;
    EXPECT_NEAR(std::remainder(cone.middle_rad - yaw, 2.0 * M_PI), 0.0, 0.05) << yaw;
    const ConeOverlap turned(cone);
    EXPECT_TRUE(turned.holds({20.0 * std::cos(yaw + 1.5), 20.0 * std::sin(yaw + 1.5), 0.0}));
    EXPECT_FALSE(turned.holds({-20.0 * std::cos(yaw), -20.0 * std::sin(yaw), 0.0})) << yaw;
    // Two poses of it overlap as those of one that looks along x and is turned instead.
    const ConeOverlap straight({cone.range_m, cone.half_angle_rad});
    EXPECT_NEAR(turned(flat(0.0, 0.0, 0.3 - yaw), flat(15.0, 8.0, 1.9 - yaw)),
                straight(flat(0.0, 0.0, 0.3), flat(15.0, 8.0, 1.9)), 0.03)
        << yaw;
  }
}

TEST(CorrectionPairs, AcceptableIsEquation27) {
  const PairConfig config;
  EXPECT_TRUE(acceptable(0.49, 0.4, config));
  EXPECT_FALSE(acceptable(0.51, 0.4, config));
  EXPECT_FALSE(acceptable(std::numeric_limits<double>::quiet_NaN(), 1.0, config));
}

TEST(CorrectionPairs, PoissonDiskChoiceIsNearTheNumberAndSpread) {
  std::mt19937 random(7);
  std::vector<CorrectionPair> pairs;
  // Dense near the diagonal, as views that follow each other nearly always fit.
  std::uniform_int_distribution<int> view(0, 2799);
  std::exponential_distribution<double> gap(0.01);
  while (pairs.size() < 3500) {
    CorrectionPair pair;
    pair.j = view(random);
    pair.i = pair.j + 1 + static_cast<int>(gap(random));
    if (pair.i < 2800) pairs.push_back(pair);
  }
  const auto chosen = poisson_disk_choice(pairs, 100);
  EXPECT_GT(chosen.size(), 70U);
  EXPECT_LT(chosen.size(), 140U);
  std::vector<double> nearest;
  for (std::size_t a = 0; a < chosen.size(); ++a) {
    double least = 1e9;
    for (std::size_t b = 0; b < chosen.size(); ++b) {
      if (a != b)
        least = std::min(least, std::hypot(chosen[a].j - chosen[b].j, chosen[a].i - chosen[b].i));
    }
    nearest.push_back(least);
  }
  std::sort(nearest.begin(), nearest.end());
  // The same number drawn at random from the same pairs has a tenth below 3.
  EXPECT_GT(nearest[nearest.size() / 10], 10.0);
  EXPECT_EQ(poisson_disk_choice(pairs, 4000).size(), pairs.size());
}

TEST(CorrectionPairs, OrdersAreThoseOfTable1) {
  std::vector<CorrectionPair> pairs;
  for (const int gap : {500, 3, 90, 100, 120, 7, 800}) {
    CorrectionPair pair;
    pair.i = gap;
    pairs.push_back(pair);
  }
  const auto gaps = [](const std::vector<CorrectionPair>& list) {
    std::vector<int> result;
    for (const CorrectionPair& pair : list)
      result.push_back(pair.gap());
    return result;
  };
  EXPECT_EQ(gaps(ordered(pairs, CorrectionOrder::kSmallGaps, 1)),
            (std::vector<int>{3, 7, 90, 100, 120, 500, 800}));
  EXPECT_EQ(gaps(ordered(pairs, CorrectionOrder::kMediumGaps, 1)),
            (std::vector<int>{100, 90, 120, 7, 3, 500, 800}));
  const auto random = gaps(ordered(pairs, CorrectionOrder::kRandom, 1));
  EXPECT_EQ(random, gaps(ordered(pairs, CorrectionOrder::kRandom, 1)));
  EXPECT_NE(random, gaps(ordered(pairs, CorrectionOrder::kRandom, 2)));
  EXPECT_EQ(std::multiset<int>(random.begin(), random.end()),
            (std::multiset<int>{3, 7, 90, 100, 120, 500, 800}));
}

TEST(CorrectionPairs, LatticeHasEveryPairOnce) {
  const auto pairs = lattice_pairs(400, 30, 300);
  std::set<std::pair<int, int>> seen;
  for (const CorrectionPair& pair : pairs) {
    EXPECT_EQ(pair.j % 30, 0);
    EXPECT_EQ(pair.i % 30, 0);
    EXPECT_GT(pair.gap(), 0);
    EXPECT_LE(pair.gap(), 300);
    EXPECT_LT(pair.i, 400);
    EXPECT_TRUE(seen.emplace(pair.j, pair.i).second);
  }
  // Views 0, 30 .. 390: gaps of 1 to 10 steps among 14.
  EXPECT_EQ(pairs.size(), 13U + 12U + 11U + 10U + 9U + 8U + 7U + 6U + 5U + 4U);
}

// Against Gaussian process regression written out with dense matrices.
TEST(GainQueue, IsGaussianProcessRegressionOverTheWay) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> view(0, 99);
  std::uniform_real_distribution<double> unit(0.5, 2.0);
  std::vector<double> steps;
  for (int k = 0; k < 100; ++k)
    steps.push_back(1e-3 * unit(random));
  std::vector<CorrectionPair> pairs;
  std::vector<double> noise;
  while (pairs.size() < 30) {
    CorrectionPair pair;
    pair.j = view(random);
    pair.i = view(random);
    if (pair.j >= pair.i) continue;
    pairs.push_back(pair);
    noise.push_back(1e-3 * unit(random));
  }
  const auto row = [&](const CorrectionPair& pair) {
    Eigen::VectorXd v = Eigen::VectorXd::Zero(100);
    for (int k = pair.j + 1; k <= pair.i; ++k)
      v[k] = 1.0;
    return v;
  };
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(100, 100);
  for (int k = 0; k < 100; ++k)
    covariance(k, k) = steps[static_cast<std::size_t>(k)];
  GainQueue queue(pairs, noise, steps);
  std::set<std::size_t> gone;
  for (int round = 0; round < 12; ++round) {
    std::size_t expected = 0;
    double most = -1.0;
    for (std::size_t c = 0; c < pairs.size(); ++c) {
      const double v = row(pairs[c]).dot(covariance * row(pairs[c]));
      if (gone.contains(c)) continue;
      EXPECT_NEAR(queue.variance_m2(c), v, 1e-12);
      const double gain = 0.5 * std::log(1.0 + v / noise[c]);
      if (gain > most) {
        most = gain;
        expected = c;
      }
    }
    const auto best = queue.best();
    ASSERT_TRUE(best);
    EXPECT_EQ(*best, expected);
    EXPECT_NEAR(queue.gain(*best), most, 1e-9);
    gone.insert(*best);
    if (round % 3 == 2) {
      queue.drop(*best);
      continue;
    }
    const Eigen::VectorXd c = covariance * row(pairs[*best]);
    covariance -= c * c.transpose() / (row(pairs[*best]).dot(c) + noise[*best]);
    queue.take(*best);
  }
}

}  // namespace
}  // namespace understory
