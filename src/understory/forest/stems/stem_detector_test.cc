#include "understory/forest/stems/stem_detector.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "understory/forest/stems/stem_fit.h"
#include "understory/util/random.h"

namespace understory {
namespace {

// Arcs of a quarter of a circle in each slice of 25 cm, turned by `turn_deg` from slice to slice.
std::vector<SlicePoint> arcs(double turn_deg) {
  Random random(11);
  std::vector<SlicePoint> points;
  for (int slice = 0; slice < 12; ++slice) {
    for (int i = 0; i < 60; ++i) {
      const double angle = (turn_deg * slice + random.uniform(0.0, 110.0)) * M_PI / 180.0;
      const double r = 0.15 + random.normal(0.0, 0.008);
      points.push_back({static_cast<float>(r * std::cos(angle)),
                        static_cast<float>(r * std::sin(angle)),
                        static_cast<float>(0.5 + 0.25 * (slice + random.uniform())), 1});
    }
  }
  return points;
}

TEST(StemDetector, WhatShowsAnotherSideInEachSliceIsNoStem) {
  // Pieces of a machine that stood in many places made such rings.
  std::vector<SlicePoint> stem = arcs(0.0);
  std::vector<SlicePoint> pieces = arcs(140.0);
  EXPECT_EQ(detect_stems(stem, {}).size(), 1U);
  EXPECT_TRUE(detect_stems(pieces, {}).empty());
}

// A stem of 12 cm, seen from the side of -y by beams that are as wide as it. What they meet beside
// its middle is put on theirs, so its arc looks flat.
std::vector<SlicePoint> seen_by_wide_beams(std::uint64_t seed) {
  Random random(seed);
  std::vector<SlicePoint> points;
  for (int i = 0; i < 140; ++i) {
    const double across = random.uniform(-0.06, 0.06);
    const double depth = -std::sqrt(0.06 * 0.06 - across * across);
    points.push_back({static_cast<float>(across + random.normal(0.0, 0.04)),
                      static_cast<float>(depth + random.normal(0.0, 0.008)),
                      static_cast<float>(random.uniform(0.5, 3.5)), 1});
  }
  return points;
}

TEST(StemDetector, FindsAStemWhoseArcLooksFlatFromAfar) {
  int found = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    std::vector<SlicePoint> points = seen_by_wide_beams(seed);
    const std::vector<StemFit> stems = detect_stems(points, {});
    ASSERT_LE(stems.size(), 1U) << seed;
    if (!stems.empty() && stems[0].centre.norm() < 0.06 &&
        std::abs(2.0 * stems[0].radius_m - 0.12) < 0.1)
      ++found;
  }
  EXPECT_GE(found, 18);
}

TEST(StemDetector, ABoardIsNoStemThoughItStandsClear) {
  for (const double width : {0.5, 1.0}) {
    Random random(3);
    std::vector<SlicePoint> points;
    for (int i = 0; i < 1500; ++i) {
      points.push_back({static_cast<float>(width * (random.uniform() - 0.5)),
                        static_cast<float>(random.normal(0.0, 0.005)),
                        static_cast<float>(random.uniform(0.5, 3.5)), 1});
    }
    EXPECT_TRUE(detect_stems(points, {}).empty()) << width;
  }
}

TEST(StemDetector, AThinStemWithWideScatterIsNotTheEdgeOfAThickOne) {
  Random random(12);
  std::vector<SlicePoint> points;
  for (int i = 0; i < 1200; ++i) {
    const double angle = random.uniform(0.0, 2.0 * M_PI);
    points.push_back({static_cast<float>(0.045 * std::cos(angle) + random.normal(0.0, 0.018)),
                      static_cast<float>(0.045 * std::sin(angle) + random.normal(0.0, 0.018)),
                      static_cast<float>(random.uniform(0.5, 3.5)), 1});
  }
  StemFitResult fit;
  fit.stem.centre = {0.12, 0.0};  // a circle that only touches it
  fit.stem.radius_m = 0.13;
  fit.stem.taper = -0.008;
  fit.evidence.scatter_m = 0.02;
  const StemFitResult refined = refine_stem(points, fit, {});
  ASSERT_TRUE(refined.converged);
  EXPECT_NEAR(refined.stem.radius_m, 0.045, 0.01);
  EXPECT_NEAR(refined.stem.centre.x(), 0.0, 0.01);
}

}  // namespace
}  // namespace understory
