#include "understory/forest/stand/stand_trees.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "understory/forest/stand/expected_diameters.h"
#include "understory/forest/stand/volume_function.h"
#include "understory/forest/stand_constants.h"

namespace understory {
namespace {

using namespace forest_constants::stand_trees;

double square(double value) {
  return value * value;
}

double positive_or_zero(double value) {
  return value > 0.0 && std::isfinite(value) ? value : 0.0;
}

// Basal area times height: the volume of the cylinder. NaN where one is unknown.
double cylinder_m3(double dbh_m, double height_m) {
  return 0.25 * M_PI * square(dbh_m) * height_m;
}

// The form factor, and how far single trees are from it.
struct FormFactor {
  double value = std::numeric_limits<double>::quiet_NaN();
  double sd = 0.0;
};

// Of all listed volumes. That up to a lower bound counts with the bound as height: the form of the
// stem ends there, too.
FormFactor form_factor_of(const std::vector<Tree>& trees, double min_dbh_m) {
  double volumes = 0.0;
  double cylinders = 0.0;
  std::vector<double> factors;
  for (const Tree& tree : trees) {
    const double cylinder = cylinder_m3(tree.dbh_m, tree.height_m);
    if (!(tree.dbh_m >= min_dbh_m) || !(cylinder > 0.0) || !std::isfinite(tree.stem_volume_m3))
      continue;
    volumes += tree.stem_volume_m3;
    cylinders += cylinder;
    factors.push_back(tree.stem_volume_m3 / cylinder);
  }
  if (factors.size() < kLeastVolumes) return {};
  FormFactor factor{volumes / cylinders, 0.0};
  double squares = 0.0;
  for (const double single : factors)
    squares += square(single - factor.value);
  factor.sd = std::sqrt(squares / static_cast<double>(factors.size() - 1));
  return factor;
}

// What is known of a height that was not seen to its top.
void fill_in_height(const std::optional<HeightCurve>& curve, const Tree& listed, StandTree& tree) {
  if (std::isfinite(tree.height_m.value)) return;
  const bool bound = std::isfinite(listed.height_m);
  if (curve) {
    const HeightAbove height = bound ? curve->above(listed.dbh_m, listed.height_m)
                                     : HeightAbove{curve->at(listed.dbh_m), curve->sd_m};
    tree.height_m = {height.height_m, height.sd_m};
    tree.height_shared_sd_m = curve->own_sd_at(listed.dbh_m);
    tree.height_filled_in = true;
  } else if (bound) {
    tree.height_m = {listed.height_m, positive_or_zero(listed.height_sd_m)};
    tree.volume_m3 = {listed.stem_volume_m3, positive_or_zero(listed.stem_volume_sd_m3)};
    tree.height_is_lower_bound = true;
  }
}

void fill_in_volume(const FormFactor& factor, StandTree& tree) {
  if (std::isfinite(tree.volume_m3.value) || !std::isfinite(factor.value) ||
      !std::isfinite(tree.height_m.value))
    return;
  const double cylinder = cylinder_m3(tree.dbh_m.value, tree.height_m.value);
  tree.volume_m3.value = factor.value * cylinder;
  tree.volume_m3.sd =
      std::sqrt(square(factor.sd * cylinder) +
                square(tree.volume_m3.value) * (square(2.0 * tree.dbh_m.sd / tree.dbh_m.value) +
                                                square(tree.height_m.sd / tree.height_m.value)));
  tree.volume_filled_in = true;
}

void apply_function(TaperSpecies species, StandTree& tree) {
  const double d = tree.dbh_m.value;
  const double h = tree.height_m.value;
  const double volume = national_volume_m3(species, d, h);
  if (!std::isfinite(volume)) return;
  constexpr double kStep = 1e-4;  // of a central difference, relative
  const double by_d = (national_volume_m3(species, d * (1.0 + kStep), h) -
                       national_volume_m3(species, d * (1.0 - kStep), h)) /
                      (2.0 * kStep * d);
  const double by_h = (national_volume_m3(species, d, h * (1.0 + kStep)) -
                       national_volume_m3(species, d, h * (1.0 - kStep))) /
                      (2.0 * kStep * h);
  tree.national_volume_m3 = {
      volume, std::sqrt(square(by_d * tree.dbh_m.sd) + square(by_h * tree.height_m.sd) +
                        square(national_volume_sd_share(species) * volume))};
}

}  // namespace

StandTrees stand_trees(const std::vector<Tree>& trees, const StandTableConfig& config) {
  StandTrees stand;
  stand.species = config.species;
  const std::vector<double> expected_m = expected_diameters(trees, config.min_dbh_m);
  std::vector<Tree> on_curve = trees;
  for (std::size_t i = 0; i < trees.size(); ++i)
    on_curve[i].dbh_m = expected_m[i];
  stand.curve = fit_height_curve(on_curve);
  for (std::size_t i = 0; i < trees.size(); ++i) {
    const Tree& tree = trees[i];
    if (!(tree.dbh_m > 0.0) || !std::isfinite(tree.dbh_m)) {
      ++stand.without_diameter;
      continue;
    }
    if (tree.dbh_m < config.min_dbh_m) continue;
    StandTree counted;
    counted.place = {tree.x, tree.y};
    counted.place_sd_m = std::sqrt(
        0.5 * (square(positive_or_zero(tree.x_sd_m)) + square(positive_or_zero(tree.y_sd_m))));
    counted.dbh_m = {tree.dbh_m, positive_or_zero(tree.dbh_sd_m)};
    // A lower bound is no height, nor is the volume up to it one. The same holds for a height far
    // below those of the trees that are as thick.
    if (!is_lower_bound(tree) && (!stand.curve || !std::isfinite(tree.height_m) ||
                                  stand.curve->is_likely_height(expected_m[i], tree.height_m))) {
      const bool known = std::isfinite(tree.height_sd_m);
      counted.height_m = {tree.height_m, known ? tree.height_sd_m : kHeightSd};
      counted.volume_m3 = {tree.stem_volume_m3, positive_or_zero(tree.stem_volume_sd_m3)};
    }
    fill_in_height(stand.curve, on_curve[i], counted);
    stand.trees.push_back(counted);
  }
  const FormFactor factor = form_factor_of(trees, config.min_dbh_m);
  stand.form_factor = factor.value;
  for (StandTree& tree : stand.trees) {
    fill_in_volume(factor, tree);
    apply_function(config.species, tree);
  }
  return stand;
}

}  // namespace understory
