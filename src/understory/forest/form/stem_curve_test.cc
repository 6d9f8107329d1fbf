#include "understory/forest/form/stem_curve.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/forest/stems/stem_surroundings.h"
#include "understory/util/random.h"

namespace understory {
namespace {

constexpr double kTop = 18.0;

// A bowed pine of 30 cm, seen all around up to `seen_to_m`.
struct TestStem {
  double dbh_m = 0.3;
  double seen_to_m = 8.0;
  double noise_m = 0.006;

  [[nodiscard]] double diameter(double height) const {
    const auto form = [](double h) { return std::pow((kTop - h) / kTop, 0.75); };
    return dbh_m * form(height) / form(1.3);
  }
  [[nodiscard]] Eigen::Vector2d centre(double height) const {
    return {5.0 + 0.01 * height, 7.0 + 0.15 * (1.0 - std::cos(height / 3.0))};
  }
  [[nodiscard]] std::vector<SlicePoint> points(Random& random) const {
    std::vector<SlicePoint> all;
    for (int i = 0; i < 400 * static_cast<int>(seen_to_m); ++i) {
      const double h = random.uniform(0.05, seen_to_m);
      const double turn = random.uniform(0.0, 2.0 * M_PI);
      const double r = 0.5 * diameter(h) + random.normal(0.0, noise_m);
      const Eigen::Vector2d c = centre(h);
      all.push_back({static_cast<float>(c.x() + r * std::cos(turn)),
                     static_cast<float>(c.y() + r * std::sin(turn)), static_cast<float>(h), 1});
    }
    return all;
  }
  [[nodiscard]] StemFit fit() const {
    StemFit fit;
    fit.centre = centre(1.3);
    fit.slope = (centre(1.8) - centre(0.8));
    fit.radius_m = 0.5 * diameter(1.3);
    fit.taper = -0.008;
    fit.rms_m = noise_m;
    fit.covariance(2, 2) = 4e-6;
    return fit;
  }
};

double error_at(const StemCurve& curve, const TestStem& stem, double height) {
  const CurveSection& section =
      curve.sections.at(static_cast<std::size_t>(std::lround(height / 0.1)));
  return section.diameter_m - stem.diameter(height);
}

TEST(StemCurve, FollowsABowedStemAsFarAsItIsSeen) {
  Random random(1);
  const TestStem stem;
  const StemCurve curve = measure_stem_curve(stem.points(random), stem.fit(), kTop, {});
  EXPECT_NEAR(curve.measured_to_m, 8.0, 0.6);
  for (double height = 0.5; height < 7.8; height += 0.5) {
    EXPECT_LT(std::abs(error_at(curve, stem, height)), 0.006) << height;
    const CurveSection& section =
        curve.sections.at(static_cast<std::size_t>(std::lround(height / 0.1)));
    EXPECT_TRUE(section.measured) << height;
    EXPECT_LT((section.centre - stem.centre(height)).norm(), 0.02) << height;
  }
}

TEST(StemCurve, TheSweepIsThatOfTheLowestFiveMetres) {
  Random random(3);
  TestStem stem;
  const auto sweep = [&] {
    return measure_stem_curve(stem.points(random), stem.fit(), kTop, {}).sweep_m;
  };
  double most = 0.0;
  for (double height = 0.5; height <= 5.0; height += 0.1) {
    const double share = (height - 0.5) / 4.5;
    const Eigen::Vector2d chord = stem.centre(0.5) + share * (stem.centre(5.0) - stem.centre(0.5));
    most = std::max(most, (stem.centre(height) - chord).norm());
  }
  ASSERT_GT(most, 0.02);
  EXPECT_NEAR(sweep(), most, 0.006);
  stem.seen_to_m = 4.0;
  EXPECT_TRUE(std::isnan(sweep())) << "not seen up to there";
}

TEST(StemCurve, AboveItHasTheFormAndSaysSo) {
  Random random(2);
  const TestStem stem;
  const StemCurve curve = measure_stem_curve(stem.points(random), stem.fit(), kTop, {});
  EXPECT_EQ(curve.sections.back().height_m, kTop);
  EXPECT_EQ(curve.sections.back().diameter_m, 0.0);
  for (double height = 9.0; height < kTop; height += 1.0) {
    const CurveSection& section =
        curve.sections.at(static_cast<std::size_t>(std::lround(height / 0.1)));
    EXPECT_FALSE(section.measured) << height;
    EXPECT_LT(std::abs(error_at(curve, stem, height)), 2.0 * section.diameter_sd_m) << height;
    EXPECT_GT(section.diameter_sd_m, 0.02 * section.diameter_m) << height;
  }
}

TEST(StemCurve, TheVolumeIsThatOfTheStem) {
  Random random(3);
  const TestStem stem;
  const StemCurve curve = measure_stem_curve(stem.points(random), stem.fit(), kTop, {});
  double volume = 0.0;
  for (double height = 0.005; height < kTop; height += 0.01)
    volume += 0.25 * M_PI * std::pow(stem.diameter(height), 2) * 0.01;
  EXPECT_NEAR(curve.volume_m3, volume, 0.03 * volume);
  EXPECT_LT(std::abs(curve.volume_m3 - volume), 2.0 * volume_sd_m3(curve, 0.01, 0.3));
}

// A wide beam shows a stem from one side, and thicker by the same at all heights. Sections were
// once followed from the corrected radius, so that thicker ones did not count. The few points of a
// section then made it seem seen from one side alone.
TEST(StemCurve, WhatWideBeamsAddIsTakenAwayAlongTheStem) {
  Random random(7);
  TestStem stem;
  stem.dbh_m = 0.14;
  StemFit fit = stem.fit();
  fit.arc_deg = 180.0;
  fit.beam = footprint_at({LidarSensor::kVlp16}, 13.0);
  const auto added = [&](double radius) {
    double sum = 0.0;
    for (int i = 0; i < 20; ++i)
      sum = excess_radius_m(fit.beam, radius + sum, fit.arc_deg);
    return sum;
  };
  fit.beam_excess_m = added(fit.radius_m);
  EXPECT_GT(fit.beam_excess_m, 0.01);
  std::vector<SlicePoint> points;
  for (int i = 0; i < 480; ++i) {
    const double h = random.uniform(0.05, 8.0);
    const double turn = random.uniform(-0.5 * M_PI, 0.5 * M_PI);
    const double r =
        0.5 * stem.diameter(h) + added(0.5 * stem.diameter(h)) + random.normal(0.0, stem.noise_m);
    const Eigen::Vector2d c = stem.centre(h);
    points.push_back({static_cast<float>(c.x() + r * std::cos(turn)),
                      static_cast<float>(c.y() + r * std::sin(turn)), static_cast<float>(h), 1});
  }
  const StemCurve curve = measure_stem_curve(points, fit, kTop, {});
  EXPECT_GT(curve.measured_to_m, 7.0);
  double mean = 0.0;
  for (int decimetre = 5; decimetre < 75; ++decimetre)
    mean += error_at(curve, stem, 0.1 * decimetre) / 70.0;
  EXPECT_LT(std::abs(mean), 0.004);
}

// Whorls make no thicker stem: their points lie around it in some heights only.
// Short sections come out thicker than the whole stem. All of them by as much.
TEST(StemCurve, ItMeetsTheDiameterAtBreastHeight) {
  Random random(9);
  TestStem thicker;
  thicker.dbh_m = 0.32;
  TestStem stem;
  const StemCurve curve = measure_stem_curve(thicker.points(random), stem.fit(), kTop, {});
  for (const double height : {1.0, 1.6, 3.0, 5.0}) {
    const double more = thicker.diameter(height) - stem.diameter(height);
    EXPECT_LT(std::abs(error_at(curve, stem, height)), 0.45 * more) << height;
  }
}

TEST(StemCurve, BranchesDoNotMakeItThicker) {
  Random random(4);
  const TestStem stem;
  std::vector<SlicePoint> points = stem.points(random);
  for (double whorl = 2.5; whorl < 8.0; whorl += 0.7) {
    for (int i = 0; i < 250; ++i) {
      const double h = whorl + random.uniform(-0.12, 0.12);
      const double turn = random.uniform(0.0, 2.0 * M_PI);
      const double r = 0.5 * stem.diameter(h) + random.uniform(0.0, 0.3);
      const Eigen::Vector2d c = stem.centre(h);
      points.push_back({static_cast<float>(c.x() + r * std::cos(turn)),
                        static_cast<float>(c.y() + r * std::sin(turn)), static_cast<float>(h), 1});
    }
  }
  const StemCurve curve = measure_stem_curve(points, stem.fit(), kTop, {});
  EXPECT_GT(curve.measured_to_m, 7.0);
  for (double height = 0.5; height < 7.0; height += 0.5)
    EXPECT_LT(std::abs(error_at(curve, stem, height)), 0.012) << height;
}

// Where only foliage shows, its surface widens upwards, as no stem does.
TEST(StemCurve, AStemIsNotFollowedIntoTheFoliageAroundIt) {
  Random random(6);
  TestStem stem;
  stem.seen_to_m = 4.0;
  std::vector<SlicePoint> points = stem.points(random);
  for (int i = 0; i < 1600; ++i) {
    const double h = random.uniform(4.0, 8.0);
    const double turn = random.uniform(0.0, 2.0 * M_PI);
    const double r = 0.5 * stem.diameter(h) + 0.06 * (h - 4.0) + random.normal(0.0, 0.006);
    const Eigen::Vector2d c = stem.centre(h);
    points.push_back({static_cast<float>(c.x() + r * std::cos(turn)),
                      static_cast<float>(c.y() + r * std::sin(turn)), static_cast<float>(h), 1});
  }
  const StemCurve curve = measure_stem_curve(points, stem.fit(), kTop, {});
  EXPECT_LT(curve.measured_to_m, 5.2);
  for (double height = 0.5; height < 7.0; height += 0.5)
    EXPECT_LT(std::abs(error_at(curve, stem, height)), 0.03) << height;
}

TEST(StemCurve, WithoutAHeightItEndsWhereTheStemWasSeenAndHasNoVolume) {
  Random random(5);
  const TestStem stem;
  const StemCurve curve =
      measure_stem_curve(stem.points(random), stem.fit(), StemCurve::kUnknown, {});
  EXPECT_NEAR(curve.sections.back().height_m, curve.measured_to_m, 0.11);
  EXPECT_LT(std::abs(error_at(curve, stem, 6.0)), 0.008);
  EXPECT_TRUE(std::isnan(curve.volume_m3));
}

// Of a stem that shows at breast height only, the rest has the form, and the volume is uncertain.
TEST(StemCurve, WhereNothingElseIsSeenTheFormStands) {
  const TestStem stem;
  const StemCurve curve = measure_stem_curve({}, stem.fit(), kTop, {});
  EXPECT_NEAR(error_at(curve, stem, 1.3), 0.0, 1e-3);
  EXPECT_EQ(curve.measured_to_m, 1.3);
  EXPECT_GT(curve.volume_form_sd_m3, 0.05 * curve.volume_m3);
}

// Where a lone section told of a stem, its error once counted twice. Errors of the form grew by 3 %
// a metre, and all errors were added up. Volumes were three times as sure as stated.
TEST(StemCurve, OneSectionIsAsSureAsItself) {
  const TestStem stem;
  const StemCurve curve = measure_stem_curve({}, stem.fit(), kTop, {});
  const double radius_sd = std::sqrt(stem.fit().covariance(2, 2)) + 0.002;
  EXPECT_NEAR(curve.sections.at(13).diameter_sd_m, 2.0 * radius_sd, 1e-4);
}

TEST(StemCurve, TheVolumeIsAsSureAsBreastHeightHeightAndForm) {
  Random random(11);
  constexpr int kStems = 600;
  constexpr double kDbh = 0.2;
  constexpr double kHeightSd = 0.6;
  for (const double dbh_sd_share : {0.03, 0.1}) {
    double once = 0.0;
    double twice = 0.0;
    for (int i = 0; i < kStems; ++i) {
      const double power = random.normal(0.7, 0.12);
      const double volume = 0.25 * M_PI * kDbh * kDbh * kTop / (2.0 * power + 1.0) *
                            std::pow(kTop / (kTop - 1.3), 2.0 * power);
      TestStem seen;
      seen.dbh_m = kDbh * (1.0 + random.normal(0.0, dbh_sd_share));
      const double height = kTop + random.normal(0.0, kHeightSd);
      const StemCurve curve = measure_stem_curve({}, seen.fit(), height, {});
      const double error = std::abs(curve.volume_m3 - volume);
      const double sd = volume_sd_m3(curve, dbh_sd_share, kHeightSd);
      once += error <= sd ? 1.0 / kStems : 0.0;
      twice += error <= 2.0 * sd ? 1.0 / kStems : 0.0;
    }
    EXPECT_NEAR(once, 0.683, 0.06) << dbh_sd_share;
    EXPECT_NEAR(twice, 0.954, 0.03) << dbh_sd_share;
  }
}

TEST(StemSurroundings, KeepWhatIsNearAStemByHeightAboveItsGround) {
  std::vector<StemFit> stems(2);
  stems[0].radius_m = stems[1].radius_m = 0.1;
  stems[1].centre = {1.5, 0.0};
  StemSurroundings surroundings(stems, {10.0, 12.0});
  surroundings.add({0.1, 0.0, 13.0});
  surroundings.add({0.101, 0.001, 13.001});  // in the cube of the first
  surroundings.add({0.75, 0.0, 14.0});       // near both: forks are looked for so far away
  surroundings.add({0.1, 0.0, 9.0});         // under the ground
  surroundings.add({5.0, 0.0, 13.0});        // far from both
  surroundings.add({0.75, 0.0, 24.5});       // none is looked for up there
  const auto points = surroundings.take();
  ASSERT_EQ(points.size(), 2U);
  ASSERT_EQ(points[0].size(), 2U);
  EXPECT_EQ(points[0][0].returns, 2U);
  EXPECT_NEAR(points[0][0].height_m, 3.0005, 1e-4);
  ASSERT_EQ(points[1].size(), 1U);
  EXPECT_NEAR(points[1][0].height_m, 2.0, 1e-5);
}

}  // namespace
}  // namespace understory
