#include "understory/forest/stand/stand_figures.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "understory/forest/stand_constants.h"
#include "understory/forest/stand_figure_constants.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace forest_constants::stand_figures;
using forest_constants::stand_errors::kSharedDiameter;

double squared(double value) {
  return value * value;
}

// Chance of a standard normal value below `z`.
double normal_below(double z) {
  return 0.5 * std::erfc(-z / std::sqrt(2.0));
}

// Less the square of the error, which the mean of the square of a noisy diameter holds; never less
// than a quarter of it.
double basal_area_m2(const StandTree& tree) {
  const double d2 = squared(tree.dbh_m.value);
  return 0.25 * M_PI * std::max(0.25 * d2, d2 - squared(tree.dbh_m.sd));
}
// Its standard deviation.
double basal_area_sd_m2(const StandTree& tree) {
  return 0.5 * M_PI * tree.dbh_m.value * tree.dbh_m.sd;
}

// What the error of the diameter does to a volume, which goes with the square of the diameter.
double by_diameter(const StandTree& tree, const Measured& volume) {
  return 2.0 * volume.value * tree.dbh_m.sd / tree.dbh_m.value;
}

// The diameter as it counts in a mean weighted by basal area. The mean cube of a noisy diameter is
// too large by three times it and the square of its error.
double weighted_dbh_m(const StandTree& tree) {
  const double d2 = squared(tree.dbh_m.value);
  const double cube_by_d = std::max(0.25 * d2, d2 - 3.0 * squared(tree.dbh_m.sd));
  return tree.dbh_m.value * 0.25 * M_PI * cube_by_d / basal_area_m2(tree);
}

// A tree on the plot, or so near that it may be on it.
struct Candidate {
  const StandTree* tree = nullptr;
  bool inside = false;
  double wrong_side = 0.0;  // chance that it stands on the other side of the border
};

// What every figure of a plot has in common. A figure moves by `pull` of a tree if that tree is in
// the sum or not. It moves by `spread` (a standard deviation) through the errors of its
// measurement.
class PlotSums {
 public:
  PlotSums(const StandTrees& stand, const VisibleArea& seen, const PlotShape& plot, double missing)
      : missing_(missing) {
    const Eigen::Vector4d box = plot.box();
    for (const StandTree& tree : stand.trees) {
      if (!seen.seen(tree.place)) continue;
      const Candidate candidate = candidate_of(tree, plot, box);
      if (candidate.inside || candidate.wrong_side > 0.0) candidates_.push_back(candidate);
    }
  }

  [[nodiscard]] std::vector<const StandTree*> trees() const {
    std::vector<const StandTree*> inside;
    for (const Candidate& candidate : candidates_)
      if (candidate.inside) inside.push_back(candidate.tree);
    return inside;
  }

  using Value = std::function<double(const StandTree&)>;
  [[nodiscard]] double sum(const Value& value) const {
    double total = 0.0;
    for (const Candidate& candidate : candidates_)
      if (candidate.inside) total += value(*candidate.tree);
    return total;
  }
  // A tree beyond the border whose pull is not known does not count for the deviation. `by_dbh`:
  // the part of the spread, with its sign, that goes with the error of the diameter. All trees
  // share some of that.
  [[nodiscard]] double sd(const Value& pull, const Value& spread, const Value& by_dbh) const {
    double variance = 0.0;
    double shared = 0.0;
    for (const Candidate& candidate : candidates_) {
      const double z2 = squared(pull(*candidate.tree));
      if (candidate.inside) {
        const double own_shared = kSharedDiameter * by_dbh(*candidate.tree);
        shared += own_shared;
        variance += std::max(0.0, squared(spread(*candidate.tree)) - squared(own_shared));
        variance += missing_ * z2;
        variance += candidate.wrong_side * z2;
      } else if (std::isfinite(z2)) {
        variance += candidate.wrong_side * z2;
      }
    }
    return std::sqrt(variance + squared(shared));
  }
  // The same of a figure that does not depend on the diameters.
  [[nodiscard]] double sd(const Value& pull, const Value& spread) const {
    return sd(pull, spread, [](const StandTree&) { return 0.0; });
  }

 private:
  static Candidate candidate_of(const StandTree& tree, const PlotShape& plot,
                                const Eigen::Vector4d& box) {
    Candidate candidate{&tree, true, 0.0};
    if (plot.rings.empty()) return candidate;
    const double reach = kFarSides * tree.place_sd_m;
    candidate.inside = false;
    if (tree.place.x() < box[0] - reach || tree.place.x() > box[2] + reach ||
        tree.place.y() < box[1] - reach || tree.place.y() > box[3] + reach)
      return candidate;
    candidate.inside = plot.contains(tree.place);
    const double distance = plot.distance_to_border(tree.place);
    if (distance < reach) candidate.wrong_side = normal_below(-distance / tree.place_sd_m);
    return candidate;
  }

  std::vector<Candidate> candidates_;
  double missing_;  // share of the trees that are not in the sums
};

// A sum over the trees, by hectare. `by_dbh`: see PlotSums::sd.
Measured by_hectare(const PlotSums& sums, double seen_m2, const PlotSums::Value& value,
                    const PlotSums::Value& sd, const PlotSums::Value& by_dbh) {
  const double factor = kHectare / seen_m2;
  return {factor * sums.sum(value), factor * sums.sd(value, sd, by_dbh)};
}
Measured by_hectare(const PlotSums& sums, double seen_m2, const PlotSums::Value& value,
                    const PlotSums::Value& sd) {
  return by_hectare(sums, seen_m2, value, sd, [](const StandTree&) { return 0.0; });
}

// The mean of a value weighted by basal area. `along`: its standard deviation that goes with that
// of the diameter (both have the sign of the same error), `own`: that which does not.
Measured weighted(const PlotSums& sums, const PlotSums::Value& value, const PlotSums::Value& along,
                  const PlotSums::Value& own) {
  const double weight = sums.sum(basal_area_m2);
  if (!(weight > 0.0)) return {};
  const double mean =
      sums.sum([&](const StandTree& tree) { return basal_area_m2(tree) * value(tree); }) / weight;
  const auto by_dbh = [&](const StandTree& tree) {
    return (basal_area_sd_m2(tree) * (value(tree) - mean) + basal_area_m2(tree) * along(tree)) /
           weight;
  };
  const double sd = sums.sd(
      [&](const StandTree& tree) { return basal_area_m2(tree) * (value(tree) - mean) / weight; },
      [&](const StandTree& tree) {
        return std::hypot(by_dbh(tree), basal_area_m2(tree) * own(tree) / weight);
      },
      by_dbh);
  return {mean, sd};
}

Measured quadratic_mean(const PlotSums& sums) {
  const double count = sums.sum([](const StandTree&) { return 1.0; });
  if (!(count > 0.0)) return {};
  const double mean = sums.sum(basal_area_m2) / count;
  const double diameter = std::sqrt(4.0 / M_PI * mean);
  const auto spread = [&](const StandTree& tree) { return basal_area_sd_m2(tree) / count; };
  const double sd = sums.sd(
      [&](const StandTree& tree) { return (basal_area_m2(tree) - mean) / count; }, spread, spread);
  return {diameter, sd * diameter / (2.0 * mean)};
}

// The last one of the thickest trees counts in part, so that small plots are not rounded.
Measured dominant_height(const PlotSums& sums, double wanted) {
  std::vector<const StandTree*> trees = sums.trees();
  if (wanted < kLeastDominant || static_cast<double>(trees.size()) < wanted) return {};
  sort_stably(trees, [](const StandTree* a, const StandTree* b) {
    return a->dbh_m.value > b->dbh_m.value;
  });
  double left = wanted;
  double thinnest = 0.0;
  Measured height{0.0, 0.0};
  std::vector<std::pair<const StandTree*, double>> weights;
  for (const StandTree* tree : trees) {
    if (left <= 0.0) break;
    const double weight = std::min(1.0, left) / wanted;
    left -= 1.0;
    weights.emplace_back(tree, weight);
    height.value += weight * tree->height_m.value;
    thinnest = tree->dbh_m.value;
  }
  const auto weight_of = [&](const StandTree& tree) {
    for (const auto& [which, weight] : weights)
      if (which == &tree) return weight;
    return tree.dbh_m.value > thinnest ? 1.0 / wanted : 0.0;  // one beyond the border
  };
  height.sd = sums.sd(
      [&](const StandTree& tree) {
        const double weight = weight_of(tree);
        return weight > 0.0 ? weight * (tree.height_m.value - height.value) : 0.0;
      },
      [&](const StandTree& tree) {
        const double weight = weight_of(tree);
        return weight > 0.0 ? weight * tree.height_m.sd : 0.0;
      });
  return height;
}

// Chance that the true diameter of a tree lies in a class.
double chance_in(const StandTree& tree, double from_m, double to_m) {
  const double d = tree.dbh_m.value;
  if (!(tree.dbh_m.sd > 0.0)) return d >= from_m && d < to_m ? 1.0 : 0.0;
  return normal_below((to_m - d) / tree.dbh_m.sd) - normal_below((from_m - d) / tree.dbh_m.sd);
}

DiameterClass class_of(const PlotSums& sums, double seen_m2, double from_m, double to_m) {
  DiameterClass result{from_m, to_m, 0, {}, {}};
  const auto holds = [&](const StandTree& tree) {
    return tree.dbh_m.value >= from_m && tree.dbh_m.value < to_m;
  };
  const auto held = [&](const StandTree& tree) { return holds(tree) ? 1.0 : 0.0; };
  result.trees = static_cast<std::size_t>(sums.sum(held));
  const auto doubt = [&](const StandTree& tree) {
    const double chance = std::clamp(chance_in(tree, from_m, to_m), 0.0, 1.0);
    return std::sqrt(holds(tree) ? 1.0 - chance : chance);
  };
  result.stems_per_ha = by_hectare(sums, seen_m2, held, doubt);
  result.basal_area_m2_per_ha = by_hectare(
      sums, seen_m2, [&](const StandTree& tree) { return held(tree) * basal_area_m2(tree); },
      [&](const StandTree& tree) {
        return std::hypot(held(tree) * basal_area_sd_m2(tree), doubt(tree) * basal_area_m2(tree));
      });
  return result;
}

std::vector<DiameterClass> classes_of(const PlotSums& sums, double seen_m2,
                                      const FiguresConfig& config) {
  double thickest = 0.0;
  for (const StandTree* tree : sums.trees())
    thickest = std::max(thickest, tree->dbh_m.value);
  std::vector<DiameterClass> classes;
  if (!(thickest > 0.0)) return classes;
  const auto class_at = [&](double dbh_m) {
    return static_cast<int>(std::floor(dbh_m / config.class_m + 1e-9));
  };
  for (int i = class_at(config.min_dbh_m); i <= class_at(thickest); ++i)
    classes.push_back(class_of(sums, seen_m2, i * config.class_m - 1e-9 * config.class_m,
                               (i + 1) * config.class_m - 1e-9 * config.class_m));
  for (DiameterClass& one : classes) {
    one.from_m += 1e-9 * config.class_m;
    one.to_m += 1e-9 * config.class_m;
  }
  return classes;
}

// With the error that all heights share.
void widen(double shared_sd, Measured& figure) {
  figure.sd = std::hypot(figure.sd, shared_sd);
}

// The error of all heights, and that of the curve, which those share that it stands for.
double shared_height_sd(const PlotSums& sums) {
  using namespace forest_constants::stand_errors;
  const double weight = sums.sum(basal_area_m2);
  const double filled = sums.sum(
      [](const StandTree& tree) { return tree.height_filled_in ? basal_area_m2(tree) : 0.0; });
  const double bias_share = weight > 0.0 ? kCurveBias * filled / weight : 0.0;
  const double curve = sums.sum([&](const StandTree& tree) {
    const double bias = tree.height_filled_in ? bias_share * tree.height_m.value : 0.0;
    return basal_area_m2(tree) * std::hypot(tree.height_shared_sd_m, bias);
  });
  return weight > 0.0 ? std::hypot(kSharedHeightSd, curve / weight) : kSharedHeightSd;
}

void share_errors_of_heights(double shared_sd, StandFigures& figures) {
  const double relative = shared_sd / figures.weighted_height_m.value;
  widen(shared_sd, figures.weighted_height_m);
  widen(shared_sd, figures.dominant_height_m);
  if (!std::isfinite(relative)) return;
  widen(relative * figures.volume_m3_per_ha.value, figures.volume_m3_per_ha);
  widen(relative * figures.national_m3_per_ha.value, figures.national_m3_per_ha);
}

void fill_means(const PlotSums& sums, StandFigures& figures) {
  const auto none = [](const StandTree&) { return 0.0; };
  figures.mean_dbh_m = quadratic_mean(sums);
  figures.weighted_dbh_m = weighted(
      sums, weighted_dbh_m, [](const StandTree& tree) { return tree.dbh_m.sd; }, none);
  figures.weighted_height_m = weighted(
      sums, [](const StandTree& tree) { return tree.height_m.value; }, none,
      [](const StandTree& tree) { return tree.height_m.sd; });
  figures.dominant_trees = kDominantPerHa * figures.seen_m2 / kHectare;
  figures.dominant_height_m = dominant_height(sums, figures.dominant_trees);
}

}  // namespace

StandFigures stand_figures(const StandTrees& stand, const VisibleArea& seen, const PlotShape& plot,
                           const FiguresConfig& config) {
  StandFigures figures;
  figures.seen_m2 = seen.area_in_m2(plot);
  figures.area_m2 = plot.rings.empty() ? figures.seen_m2 : plot.area_m2();
  figures.seen_share = figures.area_m2 > 0.0 ? figures.seen_m2 / figures.area_m2 : 0.0;
  const double listed = figures.seen_share * (1.0 - config.missed_share);
  const PlotSums sums(stand, seen, plot, 1.0 - listed);
  for (const StandTree* tree : sums.trees()) {
    ++figures.trees;
    figures.heights_filled_in += tree->height_filled_in ? 1 : 0;
    figures.heights_lower_bounds += tree->height_is_lower_bound ? 1 : 0;
    figures.volumes_filled_in += tree->volume_filled_in ? 1 : 0;
  }
  if (!(figures.seen_share >= config.least_seen) || !(figures.seen_m2 > 0.0)) return figures;
  const auto one = [](const StandTree&) { return 1.0; };
  const double limit = config.min_dbh_m;
  figures.stems_per_ha = by_hectare(sums, figures.seen_m2, one, [&](const StandTree& tree) {
    return std::sqrt(std::clamp(chance_in(tree, 0.0, limit), 0.0, 1.0));
  });
  figures.basal_area_m2_per_ha =
      by_hectare(sums, figures.seen_m2, basal_area_m2, basal_area_sd_m2, basal_area_sd_m2);
  figures.volume_m3_per_ha = by_hectare(
      sums, figures.seen_m2, [](const StandTree& tree) { return tree.volume_m3.value; },
      [](const StandTree& tree) { return tree.volume_m3.sd; },
      [](const StandTree& tree) { return by_diameter(tree, tree.volume_m3); });
  if (stand.species != TaperSpecies::kUnknown)
    figures.national_m3_per_ha = by_hectare(
        sums, figures.seen_m2, [](const StandTree& tree) { return tree.national_volume_m3.value; },
        [](const StandTree& tree) { return tree.national_volume_m3.sd; },
        [](const StandTree& tree) { return by_diameter(tree, tree.national_volume_m3); });
  fill_means(sums, figures);
  share_errors_of_heights(shared_height_sd(sums), figures);
  figures.classes = classes_of(sums, figures.seen_m2, config);
  return figures;
}

}  // namespace understory
