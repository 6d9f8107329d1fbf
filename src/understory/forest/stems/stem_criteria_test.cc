#include "understory/forest/stems/stem_criteria.h"

#include <gtest/gtest.h>

namespace understory {
namespace {

// A stem of 12 cm that shows from 0.5 to 3.5 m over the ground, with nothing beside it.
StemFitResult clear_column() {
  StemFitResult fit;
  fit.converged = true;
  fit.stem.radius_m = 0.06;
  fit.stem.arc_deg = 120.0;
  fit.stem.lowest_m = 0.5;
  fit.stem.highest_m = 3.5;
  fit.evidence.returns = 140;
  fit.evidence.on = 140;
  fit.evidence.slices = 12;
  fit.evidence.even_arc_deg = 100.0;
  fit.evidence.scatter_m = 0.01;
  fit.evidence.fill = 1.0;
  return fit;
}

TEST(StemCriteria, AFlatColumnBeginsAtBreastHeightAtMost) {
  StemFitResult fit = clear_column();
  fit.stem.arc_deg = 20.0;
  EXPECT_TRUE(is_flat_column(fit, {}, {}));
  fit.stem.lowest_m = 1.75;
  EXPECT_FALSE(is_flat_column(fit, {}, {}));
}

TEST(StemCriteria, AFlatColumnHasNothingBesideIt) {
  StemFitResult fit = clear_column();
  fit.evidence.outside_ratio = 0.3;
  EXPECT_FALSE(is_flat_column(fit, {}, {}));
}

TEST(StemCriteria, ARefinedStemShowsAnArc) {
  StemFitResult fit = clear_column();
  EXPECT_TRUE(is_stem_still(fit, {}, {}));
  fit.stem.arc_deg = 20.0;
  EXPECT_FALSE(is_stem_still(fit, {}, {}));
}

}  // namespace
}  // namespace understory
