#pragma once

#include "understory/simulation/stand/stand.h"
#include "understory/util/random.h"

namespace understory {

// A random tree of the stand without id and place.
[[nodiscard]] GrownTree draw_tree(const StandConfig& config, Random& random);
// Height of a tree of that diameter: rises ever more slowly (Naeslund's curve through the mean).
[[nodiscard]] double height_of(double dbh_m, const StandConfig& config);
// Draws the crown and the bark of a tree of known species, diameter and height.
void draw_crown(const StandConfig& config, GrownTree& tree, Random& random);

}  // namespace understory
