#pragma once

#include <cstdint>

#include "understory/simulation/carrier/carrier.h"
#include "understory/simulation/scene/terrain.h"
#include "understory/simulation/site.h"
#include "understory/simulation/stand/stand.h"

namespace understory {

// Adds the people who walk behind the carrier all the way (`config.followers`), two abreast and
// 0.7 m apart, those of the next pair 0.8 m farther behind. Each keeps its distance as if led by a
// rod: the body's path, not its heading, turns them, and one that backs up pushes them. They walk
// through what stands there. Returns the stand. The same seed gives the same people.
const Stand& with_followers(const ObjectsConfig& config, const CarrierPath& path,
                            const Terrain& terrain, std::uint64_t seed, Stand& stand);

}  // namespace understory
