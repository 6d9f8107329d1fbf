#include "understory/forest/stand/height_curve.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "understory/forest/stand_constants.h"
#include "understory/forest/stems/stem_axis.h"

namespace understory {
namespace {

using namespace forest_constants::height_curve;

double square_of(double value) {
  return value * value;
}

}  // namespace

bool is_lower_bound(const Tree& tree) {
  return tree.height_is_lower_bound > 0.5;  // not where it is not known
}

double HeightCurve::at(double dbh_m) const {
  return kBreastHeight + square_of(dbh_m / (a + b * dbh_m));
}

namespace {

// Derivatives of the height by a and b.
Eigen::Vector2d gradient_at(const HeightCurve& curve, double dbh_m) {
  const double base = curve.a + curve.b * dbh_m;
  const double by_base = -2.0 * square_of(dbh_m) / (base * base * base);
  return {by_base, by_base * dbh_m};
}

struct TreeOnCurve {
  double dbh_m = 0.0;
  double height_m = 0.0;
  bool is_bound = false;
};

std::vector<TreeOnCurve> trees_with_both(const std::vector<Tree>& trees) {
  std::vector<TreeOnCurve> both;
  for (const Tree& tree : trees) {
    if (!(tree.dbh_m > 0.0) || !std::isfinite(tree.dbh_m)) continue;
    if (!(tree.height_m > kBreastHeight) || !std::isfinite(tree.height_m)) continue;
    both.push_back({tree.dbh_m, tree.height_m, is_lower_bound(tree)});
  }
  return both;
}

double median_of(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// A quantile of d / sqrt(h - 1.3) = a + b d over the full heights (Koenker and Bassett,
// Econometrica 46, 1978). Most trees are lower, so hidden tops do not pull this start down.
HeightCurve start_of(const std::vector<TreeOnCurve>& trees) {
  HeightCurve curve;
  double scale = 0.0;
  for (int round = 0; round < kStartRounds; ++round) {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    double sum = 0.0;
    double weights = 0.0;
    for (const TreeOnCurve& tree : trees) {
      if (tree.is_bound) continue;
      const double ratio = tree.dbh_m / std::sqrt(tree.height_m - kBreastHeight);
      const double residual = ratio - curve.a - curve.b * tree.dbh_m;  // below 0: a high tree
      const double side = residual < 0.0 ? kStartQuantile : 1.0 - kStartQuantile;
      const double weight =
          round == 0 ? 1.0 : side / std::max(std::abs(residual), kLeastResidual * scale);
      const Eigen::Vector2d row(1.0, tree.dbh_m);
      normal += weight * row * row.transpose();
      right += weight * ratio * row;
      sum += ratio;
      weights += 1.0;
    }
    scale = sum / weights;
    const Eigen::Vector2d solved = normal.ldlt().solve(right);
    curve.a = solved[0];
    curve.b = solved[1];
  }
  return curve;
}

// Scatter wider than that of stands comes from hidden tops.
double possible_scatter(const HeightCurve& curve, const std::vector<TreeOnCurve>& trees,
                        double scatter_m) {
  double sum = 0.0;
  for (const TreeOnCurve& tree : trees)
    sum += curve.at(tree.dbh_m);
  const double most = kMostScatter * sum / static_cast<double>(trees.size());
  return std::max(kLeastScatter, std::min(scatter_m, most));
}

// Of the full heights about the start, by their median: those that are far off do not widen it.
double first_scatter(const HeightCurve& curve, const std::vector<TreeOnCurve>& trees) {
  std::vector<double> residuals;
  for (const TreeOnCurve& tree : trees)
    if (!tree.is_bound) residuals.push_back(std::abs(tree.height_m - curve.at(tree.dbh_m)));
  return possible_scatter(curve, trees, kMedianToSd * median_of(std::move(residuals)));
}

// Density of a standard normal value, and the chance that it is larger.
double normal_density(double z) {
  return std::exp(-0.5 * z * z) / std::sqrt(2.0 * M_PI);
}
double chance_above(double z) {
  return 0.5 * std::erfc(z / std::sqrt(2.0));
}

// The chance that a tree ends at the height that is known of it. Else it is higher, by the normal
// distribution about the curve, and its view ended anywhere up to the height of the curve.
double chance_to_end(const HeightCurve& curve, const TreeOnCurve& tree) {
  const double mean = curve.at(tree.dbh_m);
  const double z = (tree.height_m - mean) / curve.sd_m;
  const double before = tree.is_bound ? curve.bounds_that_end : curve.seen_that_end;
  const double ends = before * normal_density(z) / curve.sd_m;
  const double goes_on = (1.0 - before) * chance_above(z) / mean;
  return ends > 0.0 ? ends / (ends + goes_on) : 0.0;
}

// The shares of trees that end at their heights, from the chances of all; what is known before
// counts as some trees.
void learn_shares(const std::vector<TreeOnCurve>& trees, HeightCurve& curve) {
  std::array<double, 2> ends = {kShareTrees * kSeenThatEnd, kShareTrees * kBoundsThatEnd};
  std::array<double, 2> all = {kShareTrees, kShareTrees};
  for (const TreeOnCurve& tree : trees) {
    if (tree.height_m - curve.at(tree.dbh_m) >= kFarOff * curve.sd_m) continue;
    ends[tree.is_bound ? 1 : 0] += chance_to_end(curve, tree);
    all[tree.is_bound ? 1 : 0] += 1.0;
  }
  curve.seen_that_end = ends[0] / all[0];
  curve.bounds_that_end = ends[1] / all[1];
}

double weight_of(const HeightCurve& curve, const TreeOnCurve& tree) {
  const double far = (tree.height_m - curve.at(tree.dbh_m)) / (kFarOff * curve.sd_m);
  if (far >= 1.0) return 0.0;
  const double too_high = far > 0.0 ? square_of(1.0 - far * far) : 1.0;
  return too_high * chance_to_end(curve, tree);
}

// One step of Gauss and Newton; whether it went on.
bool improve(const std::vector<TreeOnCurve>& trees, HeightCurve& curve) {
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  double weights = 0.0;
  double squares = 0.0;
  for (const TreeOnCurve& tree : trees) {
    const double weight = weight_of(curve, tree);
    const double residual = tree.height_m - curve.at(tree.dbh_m);
    const Eigen::Vector2d gradient = gradient_at(curve, tree.dbh_m);
    normal += weight * gradient * gradient.transpose();
    right += weight * residual * gradient;
    weights += weight;
    squares += weight * square_of(residual);
  }
  if (!(normal.determinant() > 0.0)) return false;
  const Eigen::Matrix2d inverse = normal.inverse();
  const Eigen::Vector2d step = inverse * right;
  curve.covariance = square_of(curve.sd_m) * inverse;
  double part = 1.0;
  while (part > kLeastStep && !(curve.a + part * step[0] > kLeastA * curve.a))
    part *= 0.5;
  curve.a += part * step[0];
  curve.b = std::max(0.0, curve.b + part * step[1]);
  curve.sd_m = possible_scatter(curve, trees, std::sqrt(squares / std::max(1.0, weights - 2.0)));
  return true;
}

bool is_spread(const std::vector<TreeOnCurve>& trees) {
  double thinnest = std::numeric_limits<double>::infinity();
  double thickest = 0.0;
  for (const TreeOnCurve& tree : trees) {
    if (tree.is_bound) continue;
    thinnest = std::min(thinnest, tree.dbh_m);
    thickest = std::max(thickest, tree.dbh_m);
  }
  return thickest >= kLeastSpread * thinnest;
}

}  // namespace

double HeightCurve::own_sd_at(double dbh_m) const {
  const Eigen::Vector2d gradient = gradient_at(*this, dbh_m);
  return std::sqrt(std::max(0.0, gradient.dot(covariance * gradient)));
}

HeightAbove HeightCurve::above(double dbh_m, double bound_m) const {
  const double mean = at(dbh_m);
  const double z = (bound_m - mean) / sd_m;
  const double ends = chance_to_end(*this, {dbh_m, bound_m, true});
  // Of a tree that goes on: mean and variance of the normal distribution beyond the bound.
  const double lambda = z < kFarOff ? normal_density(z) / chance_above(z) : z + 1.0 / z;
  const double higher = mean + sd_m * lambda;
  const double variance = square_of(sd_m) * std::clamp(1.0 - lambda * (lambda - z), 0.0, 1.0);
  const double height = ends * bound_m + (1.0 - ends) * higher;
  return {height, std::sqrt(ends * square_of(bound_m - height) +
                            (1.0 - ends) * (variance + square_of(higher - height)))};
}

bool HeightCurve::is_likely_height(double dbh_m, double height_m) const {
  return height_m >= at(dbh_m) || chance_to_end(*this, {dbh_m, height_m, false}) >= 0.5;
}

std::optional<HeightCurve> fit_height_curve(const std::vector<Tree>& trees) {
  const std::vector<TreeOnCurve> known = trees_with_both(trees);
  const auto bounds = static_cast<std::size_t>(
      std::count_if(known.begin(), known.end(), [](const TreeOnCurve& t) { return t.is_bound; }));
  if (known.size() - bounds < kLeastHeights || !is_spread(known)) return std::nullopt;
  HeightCurve curve = start_of(known);
  if (!(curve.a > 0.0) || !(curve.b >= 0.0)) return std::nullopt;
  curve.sd_m = first_scatter(curve, known);
  curve.seen_that_end = kSeenThatEnd;
  curve.bounds_that_end = kBoundsThatEnd;
  for (int round = 0; round < kRounds; ++round) {
    learn_shares(known, curve);
    if (!improve(known, curve)) return std::nullopt;
  }
  if (!(curve.a > 0.0)) return std::nullopt;
  curve.trees = known.size() - bounds;
  curve.lower_bounds = bounds;
  return curve;
}

}  // namespace understory
