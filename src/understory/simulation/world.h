#pragma once

#include <cstdint>

#include "understory/simulation/carrier/carrier.h"
#include "understory/simulation/carrier/machine.h"
#include "understory/simulation/carrier/route.h"
#include "understory/simulation/scene/scene.h"
#include "understory/simulation/scene/terrain.h"
#include "understory/simulation/site.h"
#include "understory/simulation/stand/stand.h"

namespace understory {

// A site made real: all that its sensors meet and the carrier that they ride on. Members are made
// in this order and refer to each other: it stays where it is.
struct SimulatedWorld {
  // Throws InputError for a list of trees that cannot be read.
  explicit SimulatedWorld(const SiteConfig& config);
  SimulatedWorld(const SimulatedWorld&) = delete;
  SimulatedWorld& operator=(const SimulatedWorld&) = delete;

  const SiteConfig site;
  const std::uint64_t seed;
  const Route route;
  const Terrain terrain;
  Stand stand;  // those who follow the carrier are in it once its plan is made
  const CarrierPlan plan;
  ForestScene scene;
  const Machine machine;
};

}  // namespace understory
