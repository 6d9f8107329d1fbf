#include "understory/simulation/world.h"

#include "understory/simulation/carrier/followers.h"
#include "understory/simulation/stand/objects.h"

namespace understory {
namespace {

constexpr double kTerrainMargin = 12.0;  // metres of ground around the stand's rectangle

Stand stand_of(const SiteConfig& config, const Terrain& terrain, const Route& route,
               std::uint64_t seed) {
  Stand stand = grow_stand(config.stand, config.carrier, terrain, route, seed);
  add_objects(config.objects, terrain, route, seed, stand);
  return stand;
}

}  // namespace

SimulatedWorld::SimulatedWorld(const SiteConfig& config)
    : site(config),
      seed(static_cast<std::uint64_t>(config.seed)),
      route(config.carrier, seed),
      terrain(config.terrain, 0.5 * config.stand.size_x_m + kTerrainMargin,
              0.5 * config.stand.size_y_m + kTerrainMargin, seed, &route),
      stand(stand_of(config, terrain, route, seed)),
      plan(plan_carrier(config, route, terrain, stand)),
      scene(config.stand, terrain, with_followers(config.objects, plan.path, terrain, seed, stand),
            seed, config.terrain.snow_m, plan.harvest,
            config.lidar.rays_per_beam >= kBundleRays ? Casting::kBundles : Casting::kRays),
      machine(config.carrier, plan, stand) {}

}  // namespace understory
