#include "understory/forest/stand/height_curve.h"

#include <algorithm>
#include <cmath>

#include "understory/forest/stand_constants.h"
#include "understory/forest/stems/stem_axis.h"

namespace understory {
namespace {

using namespace forest_constants::height_curve;

}  // namespace

bool is_lower_bound(const Tree& tree) {
  return tree.height_is_lower_bound > 0.5;  // not where it is not known
}

namespace {

bool has_both(const Tree& tree) {
  return tree.dbh_m > 0.0 && std::isfinite(tree.dbh_m) && tree.height_m > kBreastHeight &&
         std::isfinite(tree.height_m) && !is_lower_bound(tree);
}

}  // namespace

double HeightCurve::at(double dbh_m) const {
  const double root = dbh_m / (a + b * dbh_m);
  return kBreastHeight + root * root;
}

std::optional<HeightCurve> fit_height_curve(const std::vector<Tree>& trees) {
  std::vector<const Tree*> known;
  for (const Tree& tree : trees)
    if (has_both(tree)) known.push_back(&tree);
  if (known.size() < kLeastHeights) return std::nullopt;
  const auto count = static_cast<double>(known.size());
  double mean_d = 0.0;
  double mean_y = 0.0;
  double thinnest = known.front()->dbh_m;
  double thickest = thinnest;
  const auto ratio = [](const Tree& tree) {
    return tree.dbh_m / std::sqrt(tree.height_m - kBreastHeight);
  };
  for (const Tree* tree : known) {
    mean_d += tree->dbh_m / count;
    mean_y += ratio(*tree) / count;
    thinnest = std::min(thinnest, tree->dbh_m);
    thickest = std::max(thickest, tree->dbh_m);
  }
  if (thickest < kLeastSpread * thinnest) return std::nullopt;
  double dd = 0.0;
  double dy = 0.0;
  for (const Tree* tree : known) {
    dd += (tree->dbh_m - mean_d) * (tree->dbh_m - mean_d);
    dy += (tree->dbh_m - mean_d) * (ratio(*tree) - mean_y);
  }
  HeightCurve curve;
  curve.trees = known.size();
  curve.b = dy / dd;
  curve.a = mean_y - curve.b * mean_d;
  if (!(curve.a > 0.0) || !(curve.b >= 0.0)) return std::nullopt;
  double squares = 0.0;
  for (const Tree* tree : known)
    squares += std::pow(tree->height_m - curve.at(tree->dbh_m), 2);
  curve.sd_m = std::sqrt(squares / (count - 2.0));
  return curve;
}

}  // namespace understory
