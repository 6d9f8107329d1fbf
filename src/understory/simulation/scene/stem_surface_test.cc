#include "understory/simulation/scene/stem_surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "understory/simulation/scene/scene.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

GrownTree pine() {
  GrownTree tree;
  tree.id = 1;
  tree.dbh_m = 0.3;
  tree.height_m = 18.0;
  tree.crown_base_m = 9.0;
  tree.crown_radius_m = 1.5;
  return tree;
}

StandConfig bare() {
  StandConfig stand;
  stand.foliage = stand.dead_branches = stand.wind_sway_m = 0.0;
  stand.ovality = stand.bark_relief_m = stand.whorl_swelling_m = 0.0;
  return stand;
}

// Radii of the points that level rays from all around hit, at a height above the foot.
std::vector<double> section(const StandConfig& config, double height, int count) {
  TerrainConfig flat;
  flat.relief_m = flat.hummock_m = flat.slope_deg = flat.roughness_m = 0.0;
  const Terrain terrain(flat, 30.0, 30.0, 1);
  Stand stand;
  stand.trees = {pine()};
  const ForestScene scene(config, terrain, stand, 3);
  std::vector<double> radii;
  for (int i = 0; i < count; ++i) {
    const double angle = kTau * i / count;
    const Eigen::Vector3d from(6.0 * std::cos(angle), 6.0 * std::sin(angle), height);
    Ray ray;
    ray.origin = from.cast<float>();
    ray.direction = (Eigen::Vector3d(0.0, 0.0, height) - from).normalized().cast<float>();
    Hit hit;
    scene.cast(&ray, 1, 0.1F, 20.0F, &hit);
    EXPECT_EQ(hit.surface, Surface::kStem);
    radii.push_back(6.0 - static_cast<double>(hit.range_m));
  }
  return radii;
}

// Amplitude of a wave around the section.
double wave(const std::vector<double>& radii, int order) {
  std::complex<double> sum = 0.0;
  for (std::size_t i = 0; i < radii.size(); ++i) {
    const double angle = kTau * static_cast<double>(i) / static_cast<double>(radii.size());
    sum += radii[i] * std::polar(1.0, -angle * order);
  }
  return std::abs(sum) * (order == 0 ? 1.0 : 2.0) / static_cast<double>(radii.size());
}

double spread(const std::vector<double>& radii) {
  double squares = 0.0;
  for (const double radius : radii)
    squares += std::pow(radius - wave(radii, 0), 2.0);
  return std::sqrt(squares / static_cast<double>(radii.size()));
}

TEST(StemSurface, IsRoundWhereNothingIsAskedFor) {
  const std::vector<double> radii = section(bare(), 1.3, 72);
  EXPECT_NEAR(wave(radii, 0), 0.15, 1e-4);
  EXPECT_LT(spread(radii), 1e-4);
  EXPECT_TRUE(StemSurface(bare(), pine(), 3).round());
}

TEST(StemSurface, HitsShowTheLobesAskedForAndTheMeanDiameterStays) {
  StandConfig config = bare();
  config.ovality = 0.08;
  const StemSurface surface(config, pine(), 3);
  for (const double height : {1.3, 5.0}) {
    const std::vector<double> radii = section(config, height, 72);
    const std::vector<double> round = section(bare(), height, 72);
    const double mean = wave(round, 0);
    for (const int order : {2, 3, 4}) {
      const double asked = mean * surface.lobe(order, static_cast<float>(height));
      EXPECT_GT(asked, 2e-4);
      EXPECT_NEAR(wave(radii, order), asked, 0.07 * asked) << order << " at " << height;
    }
    // The girth, as a tape has it: of the section's outline.
    double girth = 0.0;
    for (std::size_t i = 0; i < radii.size(); ++i) {
      const std::size_t next = (i + 1) % radii.size();
      girth += std::abs(std::polar(radii[next], kTau / 72.0) - radii[i]);
    }
    EXPECT_NEAR(girth / std::numbers::pi, 2.0 * mean, 0.002 * mean);
  }
}

TEST(StemSurface, OvalityIsTheMeanOfTheStand) {
  StandConfig config = bare();
  config.ovality = 0.06;
  double sum = 0.0;
  for (int id = 1; id <= 500; ++id) {
    GrownTree tree = pine();
    tree.id = id;
    const StemSurface surface(config, tree, 3);
    double smallest = 1.0;
    double largest = 0.0;
    for (int i = 0; i < 90; ++i) {
      const auto x = static_cast<float>(std::cos(kTau * i / 180.0));
      const auto y = static_cast<float>(std::sin(kTau * i / 180.0));
      const double diameter = 0.3 + static_cast<double>(surface.offset(x, y, 1.3F)) +
                              static_cast<double>(surface.offset(-x, -y, 1.3F));
      smallest = std::min(smallest, diameter);
      largest = std::max(largest, diameter);
    }
    sum += (largest - smallest) / 0.3;
  }
  EXPECT_NEAR(sum / 500.0, 0.06, 0.006);
}

TEST(StemSurface, BarkIsRougherAtAPinesFootThanAboveAndOnABirch) {
  StandConfig config = bare();
  config.bark_relief_m = 0.004;
  EXPECT_NEAR(spread(section(config, 1.0, 720)), 1.2 * 0.004, 0.0015);
  EXPECT_LT(spread(section(config, 9.0, 720)), 0.5 * 0.004);
  GrownTree birch = pine();
  birch.species = Species::kBirch;
  const StemSurface smooth(config, birch, 3);
  double squares = 0.0;
  double sum = 0.0;
  for (int i = 0; i < 2000; ++i) {
    const double angle = 0.37 * i;
    const double offset =
        smooth.offset(static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle)),
                      static_cast<float>(0.5 + 0.003 * i));
    squares += offset * offset;
    sum += offset;
  }
  EXPECT_LT(std::sqrt(squares / 2000.0), 0.6 * 0.004);
  EXPECT_NEAR(sum / 2000.0, 0.0, 3e-4);
}

TEST(StemSurface, SwellsAtWhorls) {
  StandConfig config = bare();
  config.whorl_swelling_m = 0.006;
  const StemSurface surface(config, pine(), 3);
  std::vector<double> offsets;
  for (int i = 0; i < 420; ++i)
    offsets.push_back(surface.offset(1.0F, 0.0F, 7.0F + 0.01F * static_cast<float>(i)));
  const double largest = *std::max_element(offsets.begin(), offsets.end());
  EXPECT_GT(largest, 0.004);
  double sum = 0.0;
  int swellings = 0;
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    sum += offsets[i];
    swellings += i > 0 && offsets[i - 1] <= 0.0 && offsets[i] > 0.0 ? 1 : 0;
  }
  EXPECT_EQ(swellings, 10);  // in ten lengths of a shoot
  EXPECT_NEAR(sum / 420.0, 0.0, 2e-4);
}

}  // namespace
}  // namespace understory
