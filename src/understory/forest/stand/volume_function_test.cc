#include "understory/forest/stand/volume_function.h"

#include <gtest/gtest.h>

#include <cmath>

namespace understory {
namespace {

// Independent: the volume under the taper curve of the same publication, whose coefficients are
// other ones, scaled to the diameter at breast height. The publication corrects the mean curve by
// size, which is left out here.
double volume_of_curve(TaperSpecies species, double dbh_m, double height_m) {
  const TaperForm form(species, height_m, 0.8);
  const double scale = dbh_m / form.at(1.3);
  constexpr int kSteps = 2'000;
  const double step = height_m / kSteps;
  double sum = 0.0;
  for (int i = 0; i < kSteps; ++i) {
    const double diameter = scale * form.at((i + 0.5) * step);
    sum += 0.25 * M_PI * diameter * diameter * step;
  }
  return sum;
}

TEST(VolumeFunction, AgreesWithTheTaperCurveOfTheSamePublication) {
  for (const TaperSpecies species :
       {TaperSpecies::kPine, TaperSpecies::kSpruce, TaperSpecies::kBirch}) {
    for (const auto& [dbh, height] : {std::pair{0.12, 11.0}, std::pair{0.18, 15.0},
                                      std::pair{0.25, 20.0}, std::pair{0.32, 24.0}}) {
      const double function = national_volume_m3(species, dbh, height);
      EXPECT_NEAR(function / volume_of_curve(species, dbh, height), 1.0, 0.10)
          << taper_species_name(species) << " " << dbh;
    }
  }
}

TEST(VolumeFunction, BirchIsAnderssonsFunctionOfThatYear) {
  // S.-O. Andersson 1954 printed the same birch function as logarithms.
  const double d = 17.0;
  const double h = 16.0;
  const double litres = std::exp(-4.49213 + 2.10253 * std::log(d) + 3.98519 * std::log(h) -
                                 2.65900 * std::log(h - 1.3) - 0.0140970 * d);
  EXPECT_NEAR(1e3 * national_volume_m3(TaperSpecies::kBirch, 0.17, 16.0) / litres, 1.0, 1e-3);
}

TEST(VolumeFunction, IsNotKnownWithoutASpeciesOrAHeight) {
  EXPECT_TRUE(std::isnan(national_volume_m3(TaperSpecies::kUnknown, 0.2, 15.0)));
  EXPECT_TRUE(std::isnan(national_volume_m3(TaperSpecies::kPine, 0.2, 1.3)));
  EXPECT_TRUE(std::isnan(national_volume_m3(TaperSpecies::kPine, 0.0, 15.0)));
  EXPECT_TRUE(std::isnan(national_volume_sd_share(TaperSpecies::kUnknown)));
}

}  // namespace
}  // namespace understory
