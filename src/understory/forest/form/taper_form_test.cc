#include "understory/forest/form/taper_form.h"

#include <gtest/gtest.h>

#include <cmath>

namespace understory {
namespace {

constexpr TaperSpecies kFinnish[] = {TaperSpecies::kPine, TaperSpecies::kSpruce,
                                     TaperSpecies::kBirch};

// The curves are relative to the diameter at a fifth of the height: their coefficients, each with
// its power, have to give one there.
TEST(TaperForm, CurvesOfFinlandAreOneAtAFifthOfTheHeight) {
  for (const TaperSpecies species : kFinnish)
    EXPECT_NEAR(TaperForm(species, 20.0, 0.7).at(4.0), 1.0, 1e-4) << taper_species_name(species);
}

TEST(TaperForm, StemsBecomeThinnerUpToATopOfNothing) {
  for (const TaperSpecies species :
       {TaperSpecies::kUnknown, TaperSpecies::kPine, TaperSpecies::kSpruce, TaperSpecies::kBirch}) {
    const TaperForm form(species, 18.0, 0.7);
    for (double height = 0.5; height < 18.0; height += 0.5)
      EXPECT_LT(form.at(height), form.at(height - 0.5)) << taper_species_name(species) << height;
    EXPECT_EQ(form.at(18.0), 0.0);
    EXPECT_EQ(form.at(25.0), 0.0);
  }
}

// Of one diameter at a fifth of the height, birches taper more than spruces, and those more than
// pines, at half of the height.
TEST(TaperForm, SpeciesDiffer) {
  const auto middle = [](TaperSpecies species) { return TaperForm(species, 20.0, 0.7).at(10.0); };
  EXPECT_NEAR(middle(TaperSpecies::kPine), 0.774, 0.002);
  EXPECT_NEAR(middle(TaperSpecies::kSpruce), 0.737, 0.002);
  EXPECT_NEAR(middle(TaperSpecies::kBirch), 0.733, 0.002);
}

TEST(TaperForm, AnUnknownSpeciesHasAPower) {
  const TaperForm cone(TaperSpecies::kUnknown, 10.0, 1.0);
  EXPECT_NEAR(cone.at(2.5) / cone.at(5.0), 1.5, 1e-12);
}

}  // namespace
}  // namespace understory
