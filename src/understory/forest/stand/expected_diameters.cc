#include "understory/forest/stand/expected_diameters.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

#include "understory/forest/stand_figure_constants.h"

namespace understory {
namespace {

using namespace forest_constants::expected_diameters;

struct Diameter {
  double m = 0.0;
  double variance = 0.0;  // of its error
};

// Of the true diameters of a stand.
struct Spread {
  double mean = 0.0;
  double variance = 0.0;
};

bool is_measured(const Tree& tree, double min_dbh_m) {
  return tree.dbh_m >= min_dbh_m && std::isfinite(tree.dbh_m) && tree.dbh_sd_m >= 0.0 &&
         std::isfinite(tree.dbh_sd_m);
}

// Mean and variance without the errors: each weighs as much as it is sure, at the variance so far.
Spread spread_of(const std::vector<Diameter>& diameters) {
  Spread spread{0.0, kFirstSpread * kFirstSpread};
  for (int round = 0; round < kRounds; ++round) {
    double weights = 0.0;
    double sum = 0.0;
    for (const Diameter& d : diameters) {
      const double weight = 1.0 / (spread.variance + d.variance);
      weights += weight;
      sum += weight * d.m;
    }
    spread.mean = sum / weights;
    double squares = 0.0;
    for (const Diameter& d : diameters)
      squares +=
          ((d.m - spread.mean) * (d.m - spread.mean) - d.variance) / (spread.variance + d.variance);
    spread.variance = std::max(kLeastSpread * kLeastSpread, squares / weights);
  }
  return spread;
}

// From the sure stems. Far ones do not tell: thin ones are missing, and wide beams shift the rest.
std::optional<Spread> spread_of_sure(const std::vector<Diameter>& all) {
  if (all.size() < kFewestSure) return std::nullopt;
  Spread spread = spread_of(all);
  for (int round = 0; round < kSureRounds; ++round) {
    std::vector<Diameter> sure;
    for (const Diameter& d : all)
      if (d.variance < kSureShare * spread.variance) sure.push_back(d);
    if (sure.size() < kFewestSure) return std::nullopt;
    spread = spread_of(sure);
  }
  return spread;
}

}  // namespace

std::vector<double> expected_diameters(const std::vector<Tree>& trees, double min_dbh_m) {
  std::vector<double> expected;
  std::vector<Diameter> measured;
  for (const Tree& tree : trees) {
    expected.push_back(tree.dbh_m);
    if (is_measured(tree, min_dbh_m))
      measured.push_back({tree.dbh_m, tree.dbh_sd_m * tree.dbh_sd_m});
  }
  const std::optional<Spread> spread = spread_of_sure(measured);
  if (!spread) return expected;
  for (std::size_t i = 0; i < trees.size(); ++i) {
    if (!is_measured(trees[i], min_dbh_m)) continue;
    const double error = trees[i].dbh_sd_m * trees[i].dbh_sd_m;
    const double kept = spread->variance / (spread->variance + error);
    expected[i] = spread->mean + kept * (trees[i].dbh_m - spread->mean);
  }
  return expected;
}

}  // namespace understory
