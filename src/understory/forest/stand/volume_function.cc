#include "understory/forest/stand/volume_function.h"

#include <cmath>
#include <limits>

#include "understory/forest/stems/stem_axis.h"

namespace understory {
namespace {

// v = a d^b c^d h^e (h - 1.3)^f, with v in dm3, d in cm and h in m.
struct VolumeFunction {
  double a, b, c, e, f;
  double sd_share;  // of single trees about it
};
constexpr VolumeFunction kPineVolume = {0.036089, 2.01395, 0.99676, 2.07025, -1.07209, 0.0710};
constexpr VolumeFunction kSpruceVolume = {0.022927, 1.91505, 0.99146, 2.82541, -1.53547, 0.0747};
constexpr VolumeFunction kBirchVolume = {0.011197, 2.10253, 0.98600, 3.98519, -2.65900, 0.0823};

const VolumeFunction* function_of(TaperSpecies species) {
  switch (species) {
    case TaperSpecies::kPine:
      return &kPineVolume;
    case TaperSpecies::kSpruce:
      return &kSpruceVolume;
    case TaperSpecies::kBirch:
      return &kBirchVolume;
    case TaperSpecies::kUnknown:
      return nullptr;
  }
  return nullptr;
}

}  // namespace

double national_volume_m3(TaperSpecies species, double dbh_m, double height_m) {
  const VolumeFunction* function = function_of(species);
  if (function == nullptr || !(dbh_m > 0.0) || !(height_m > kBreastHeight))
    return std::numeric_limits<double>::quiet_NaN();
  const double d = 100.0 * dbh_m;
  return 1e-3 * function->a * std::pow(d, function->b) * std::pow(function->c, d) *
         std::pow(height_m, function->e) * std::pow(height_m - kBreastHeight, function->f);
}

double national_volume_sd_share(TaperSpecies species) {
  const VolumeFunction* function = function_of(species);
  return function == nullptr ? std::numeric_limits<double>::quiet_NaN() : function->sd_share;
}

}  // namespace understory
