#include "understory/forest/stems/breast_height_sections.h"

#include <gtest/gtest.h>

#include <cmath>

#include "understory/forest/stems/stem_axis.h"
#include "understory/util/random.h"

namespace understory {
namespace {

constexpr double kRadius = 0.1;

// A stem that bows by `bow_m` two metres above breast height, seen from the ground to 3.3 m.
std::vector<SlicePoint> bowed(double bow_m, double from_m, double to_m) {
  Random random(1);
  std::vector<SlicePoint> points;
  for (int i = 0; i < 3000; ++i) {
    const double height = random.uniform(from_m, to_m);
    const double turn = random.uniform(0.0, 2.0 * M_PI);
    const double rise = height - kBreastHeight;
    const double r = kRadius - 0.008 * rise + random.normal(0.0, 0.005);
    points.push_back({static_cast<float>(0.25 * bow_m * rise * rise + r * std::cos(turn)),
                      static_cast<float>(r * std::sin(turn)), static_cast<float>(height), 1});
  }
  return points;
}

// As the fit of a whole stem could be: too thin.
StemFit thin_fit() {
  StemFit fit;
  fit.radius_m = 0.094;
  fit.taper = -0.008;
  fit.rms_m = 0.01;
  fit.spread_m = 0.0005;
  return fit;
}

TEST(BreastHeightSections, AreThickAsTheStemIsThereThoughItBows) {
  const double radius = radius_with_sections(bowed(0.06, 0.3, 3.3), thin_fit());
  EXPECT_NEAR(radius, kRadius, 0.0025);
}

TEST(BreastHeightSections, CountLittleBesideASureFit) {
  StemFit sure = thin_fit();
  sure.spread_m = 0.0;
  StemFit unsure = thin_fit();
  unsure.spread_m = 0.01;
  const auto points = bowed(0.0, 0.3, 3.3);
  EXPECT_LT(radius_with_sections(points, sure), radius_with_sections(points, unsure));
}

TEST(BreastHeightSections, WhereTooFewAreSeenTheFitStands) {
  EXPECT_EQ(radius_with_sections(bowed(0.0, 2.2, 3.3), thin_fit()), thin_fit().radius_m);
  EXPECT_EQ(radius_with_sections({}, thin_fit()), thin_fit().radius_m);
}

// Of a stem that was seen all round, a section of one side tells less than the whole.
TEST(BreastHeightSections, OfOneSideDoNotCountBesideAllSides) {
  std::vector<SlicePoint> side = bowed(0.0, 0.3, 3.3);
  std::erase_if(side, [](const SlicePoint& point) { return point.y > 0.03F; });
  StemFit fit = thin_fit();
  fit.arc_deg = 360.0;
  EXPECT_EQ(radius_with_sections(side, fit), fit.radius_m);
  fit.arc_deg = 200.0;
  EXPECT_NE(radius_with_sections(side, fit), fit.radius_m);
}

// A section that is far off belongs to something else.
TEST(BreastHeightSections, OfAnotherThingDoNotCount) {
  StemFit other = thin_fit();
  other.centre.x() = 0.06;
  EXPECT_EQ(radius_with_sections(bowed(0.0, 0.3, 3.3), other), other.radius_m);
}

}  // namespace
}  // namespace understory
