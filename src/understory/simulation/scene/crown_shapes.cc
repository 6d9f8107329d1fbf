#include "understory/simulation/scene/crown_shapes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "understory/simulation/sensors/counter_noise.h"

namespace understory {
namespace {

CrownSize size_class(Species species, double height_m, double crown_base_share) {
  CrownSize size;
  size.height_m = height_m;
  const double dbh = 0.0115 * height_m;
  switch (species) {
    case Species::kPine:
      size.crown_base_m = 0.42 * height_m;
      size.crown_radius_m = 0.55 + 4.6 * dbh;
      break;
    case Species::kSpruce:
      size.crown_base_m = std::min(0.5 * height_m, 2.2);
      size.crown_radius_m = 0.6 + 5.0 * dbh;
      break;
    case Species::kBirch:
      size.crown_base_m = 0.47 * height_m;
      size.crown_radius_m = 0.6 + 6.0 * dbh;
      break;
  }
  if (crown_base_share > 0.0) size.crown_base_m = crown_base_share * height_m;
  return size;
}

}  // namespace

GrownShapes grow_shapes(const StandConfig& config, std::uint64_t seed) {
  constexpr std::array kHeights = {6.0, 10.0, 14.0, 18.0, 23.0};
  GrownShapes shapes;
  std::uint64_t number = 0;
  const std::uint64_t stream = hash_numbers(seed, stream_of(NoiseStream::kShapes));
  for (const Species species : {Species::kPine, Species::kSpruce, Species::kBirch}) {
    for (const double height : kHeights) {
      for (const double lower : {0.78, 0.93, 1.07, 1.22}) {
        Random random(stream, ++number);
        CrownSize size = size_class(species, height, config.crown_base_share);
        size.crown_base_m *= lower;
        size.foliage = config.foliage;
        size.dead_branches = config.dead_branches;
        Shape living = grow_crown(species, size, random);
        Shape dead = grow_dead_branches(species, size, random);
        shapes.crowns.push_back({species, size, std::move(living), std::move(dead)});
      }
    }
  }
  for (const PlantKind kind : {PlantKind::kSeedling, PlantKind::kShrub, PlantKind::kGroundPlants}) {
    for (int variant = 0; variant < 3; ++variant) {
      Random random(stream, ++number);
      shapes.plants.push_back(grow_plant(kind, random));
    }
  }
  return shapes;
}

std::pair<float, float> quarter_turn(double yaw_rad) {
  constexpr std::array<std::pair<float, float>, 4> kQuarters = {
      {{1.0F, 0.0F}, {0.0F, 1.0F}, {-1.0F, 0.0F}, {0.0F, -1.0F}}};
  const auto quarter = static_cast<std::size_t>(std::max(0.0, yaw_rad / (0.5 * std::numbers::pi)));
  return kQuarters[quarter % 4];
}

std::size_t nearest_crown(const std::vector<GrownCrown>& crowns, const GrownTree& tree) {
  std::size_t best = 0;
  double nearest = 1e9;
  for (std::size_t i = 0; i < crowns.size(); ++i) {
    if (crowns[i].species != tree.species) continue;
    const CrownSize& size = crowns[i].size;
    // First of like height, of these the one whose branches begin where the tree's do.
    const double distance =
        10.0 * std::abs(size.height_m - tree.height_m) +
        std::abs(size.crown_base_m / size.height_m - tree.crown_base_m / tree.height_m);
    if (distance < nearest) {
      nearest = distance;
      best = i;
    }
  }
  return best;
}

}  // namespace understory
