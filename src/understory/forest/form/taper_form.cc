#include "understory/forest/form/taper_form.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "understory/util/error.h"

namespace understory {
namespace {

// Of the powers 1, 2, 3, 5, 8, 13, 21 and 34 of the relative distance from the top; 1 at a fifth of
// the height.
using Coefficients = std::array<double, 8>;
constexpr std::array<int, 8> kPowers = {1, 2, 3, 5, 8, 13, 21, 34};
constexpr Coefficients kPineCurve = {2.1288,  -0.63157, -1.6082, 2.4886,
                                     -2.4147, 2.3619,   -1.7539, 1.0817};
constexpr Coefficients kSpruceCurve = {2.3366, -3.2684, 3.6513,  -2.2608,
                                       0.0,    2.1501,  -2.7412, 1.8876};
constexpr Coefficients kBirchCurve = {0.93838, 4.1060, -7.8517, 7.8993,
                                      -7.5018, 6.3863, -4.3918, 2.1604};

double polynomial(const Coefficients& coefficients, double x) {
  double sum = 0.0;
  for (std::size_t i = 0; i < coefficients.size(); ++i)
    sum += coefficients[i] * std::pow(x, kPowers[i]);
  return sum;
}

}  // namespace

std::string taper_species_name(TaperSpecies species) {
  switch (species) {
    case TaperSpecies::kPine:
      return "pine";
    case TaperSpecies::kSpruce:
      return "spruce";
    case TaperSpecies::kBirch:
      return "birch";
    case TaperSpecies::kUnknown:
      return "unknown";
  }
  return "unknown";
}

TaperForm::TaperForm(TaperSpecies species, double height_m, double power)
    : species_(species), top_m_(height_m), power_(power) {
  UNDERSTORY_CHECK(height_m > 0.0);
}

double TaperForm::at(double height_m) const {
  const double x = std::clamp((top_m_ - height_m) / top_m_, 0.0, 1.0);
  switch (species_) {
    case TaperSpecies::kPine:
      return polynomial(kPineCurve, x);
    case TaperSpecies::kSpruce:
      return polynomial(kSpruceCurve, x);
    case TaperSpecies::kBirch:
      return polynomial(kBirchCurve, x);
    case TaperSpecies::kUnknown:
      return std::pow(x, power_);
  }
  return 0.0;
}

}  // namespace understory
