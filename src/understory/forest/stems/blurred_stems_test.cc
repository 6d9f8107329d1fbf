#include "understory/forest/stems/blurred_stems.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "understory/util/random.h"

namespace understory {
namespace {

StemFit known_stem(double x, double radius_m, int returns, double scatter_m = 0.04) {
  StemFit stem;
  stem.centre = {x, 0.0};
  stem.radius_m = radius_m;
  stem.returns = returns;
  stem.scatter_m = scatter_m;
  return stem;
}

TEST(BlurOf, IsTheMedianScatterWhereItHidesStems) {
  EXPECT_EQ(blur_of({known_stem(0, 0.2, 9, 0.034), known_stem(1, 0.2, 9, 0.036),
                     known_stem(2, 0.2, 9, 0.01)}),
            0.03);
  EXPECT_EQ(blur_of({known_stem(0, 0.2, 9, 0.02), known_stem(1, 0.2, 9, 0.02),
                     known_stem(2, 0.2, 9, 0.05)}),
            0.0);
  EXPECT_EQ(blur_of({known_stem(0, 0.2, 9, 0.05), known_stem(1, 0.2, 9, 0.05)}), 0.0);
}

TEST(TakeBlurred, PutsAThickStemInPlaceOfTheThinOneInItsEdge) {
  std::vector<StemFit> stems = {known_stem(0.15, 0.08, 100), known_stem(3.0, 0.2, 300)};
  take_blurred({known_stem(0.0, 0.2, 400)}, BlurredRole::kCovers, stems);
  ASSERT_EQ(stems.size(), 2U);
  EXPECT_EQ(stems[0].radius_m, 0.2);
  EXPECT_EQ(stems[0].centre.x(), 0.0);
}

TEST(TakeBlurred, LeavesStemsOfTheirOwnPointsAlone) {
  // As many points; nearly as thick; two stems.
  for (const std::vector<StemFit>& known :
       {std::vector<StemFit>{known_stem(0.15, 0.08, 350)},
        std::vector<StemFit>{known_stem(0.1, 0.18, 100)},
        std::vector<StemFit>{known_stem(-0.15, 0.05, 100), known_stem(0.15, 0.05, 100)}}) {
    std::vector<StemFit> stems = known;
    take_blurred({known_stem(0.0, 0.2, 400)}, BlurredRole::kCoversOrIsNew, stems);
    ASSERT_EQ(stems.size(), known.size());
    EXPECT_EQ(stems[0].radius_m, known[0].radius_m);
  }
}

TEST(TakeBlurred, AddsNewStemsOnceAndOnlyWhereAsked) {
  const std::vector<StemFit> twice = {known_stem(5.0, 0.2, 400), known_stem(5.1, 0.3, 700)};
  std::vector<StemFit> stems = {known_stem(0.0, 0.2, 300)};
  take_blurred(twice, BlurredRole::kCovers, stems);
  EXPECT_EQ(stems.size(), 1U);
  take_blurred(twice, BlurredRole::kCoversOrIsNew, stems);
  ASSERT_EQ(stems.size(), 2U);
  EXPECT_EQ(stems[1].radius_m, 0.3);  // that of the most returns
}

// Stems of 36 to 56 cm, 4 m apart, seen all round with noise.
std::vector<SlicePoint> noisy_stand(double noise_m, std::uint64_t seed) {
  Random random(seed);
  std::vector<SlicePoint> points;
  for (int tree = 0; tree < 16; ++tree) {
    const double radius = 0.18 + 0.1 * random.uniform();
    for (int i = 0; i < 300; ++i) {
      const double angle = random.uniform(0.0, 2.0 * M_PI);
      points.push_back({static_cast<float>(4.0 * (tree / 4) + radius * std::cos(angle) +
                                           random.normal(0.0, noise_m)),
                        static_cast<float>(4.0 * (tree % 4) + radius * std::sin(angle) +
                                           random.normal(0.0, noise_m)),
                        static_cast<float>(random.uniform(0.5, 3.5)), 1});
    }
  }
  return points;
}

// Stems within 5 cm of their place.
int found_in(const std::vector<StemFit>& stems) {
  int found = 0;
  for (const StemFit& stem : stems) {
    const Eigen::Vector2d place = 4.0 * (stem.centre / 4.0).array().round();
    found += (stem.centre - place).norm() < 0.05 ? 1 : 0;
  }
  return found;
}

std::vector<StemFit> by_slices(std::vector<SlicePoint> points) {
  std::vector<StemFit> stems = detect_stems_in_cut(StemCut::kThin, points, {}, {}, {}, {});
  const std::vector<StemFit> more = detect_stems_in_cut(StemCut::kThick, points, stems, {}, {}, {});
  stems.insert(stems.end(), more.begin(), more.end());
  return stems;
}

TEST(BlurredStems, AreFoundWhereSlicesShowFew) {
  int blurred = 0;
  int by_slices_alone = 0;
  std::size_t listed = 0;
  for (const std::uint64_t seed : {1, 2, 3, 4}) {
    std::vector<SlicePoint> points = noisy_stand(0.05, seed);
    by_slices_alone += found_in(by_slices(points));
    double blur = 0.0;
    const std::vector<StemFit> stems = detect_stems(points, {}, {}, {}, &blur);
    EXPECT_GE(blur, 0.03);
    blurred += found_in(stems);
    listed += stems.size();
  }
  EXPECT_GE(blurred, 58);  // of 64
  EXPECT_LE(listed, 66U);
  EXPECT_LE(by_slices_alone, blurred - 10);
}

TEST(BlurredStems, AreNotLookedForInASharpCloud) {
  std::vector<StemFit> stems = {known_stem(0, 0.2, 9, 0.02), known_stem(3, 0.2, 9, 0.02),
                                known_stem(6, 0.2, 9, 0.02)};
  int searches = 0;
  const double blur = add_blurred_stems(
      {},
      [&](StemCut, const StemDetectorConfig&) {
        ++searches;
        return std::vector<StemFit>();
      },
      stems);
  EXPECT_EQ(blur, 0.0);
  EXPECT_EQ(searches, 0);
}

TEST(BlurredStems, ThatAreFoundTellMoreBlurInASecondRound) {
  std::vector<StemFit> stems = {known_stem(0, 0.2, 9, 0.03), known_stem(3, 0.2, 9, 0.03),
                                known_stem(6, 0.2, 9, 0.03)};
  std::vector<double> blurs;
  const double blur = add_blurred_stems(
      {},
      [&](StemCut cut, const StemDetectorConfig& config) {
        blurs.push_back(config.blur_m);
        if (cut != StemCut::kBlurred) return std::vector<StemFit>();
        EXPECT_DOUBLE_EQ(config.min_dbh_m, 4.0 * config.blur_m);
        return std::vector<StemFit>{known_stem(9, 0.2, 9, 0.05), known_stem(12, 0.2, 9, 0.05),
                                    known_stem(15, 0.2, 9, 0.05)};
      },
      stems);
  EXPECT_EQ(stems.size(), 6U);
  EXPECT_DOUBLE_EQ(blur, 0.05);
  EXPECT_EQ(blurs, (std::vector<double>{0.03, 0.05, 0.05, 0.05}));
}

TEST(BlurredStems, TheNoteTellsWhereTheScatterLies) {
  EXPECT_NE(blur_note(0.03, 0.034).find("the ranges have 3.4 cm of noise"), std::string::npos);
  EXPECT_NE(blur_note(0.03, 0.0).find("the path has errors"), std::string::npos);
}

}  // namespace
}  // namespace understory
