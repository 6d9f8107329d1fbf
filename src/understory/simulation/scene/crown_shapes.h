#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "understory/simulation/scene/shapes.h"

namespace understory {

// A grown crown and the size that it was grown for.
struct GrownCrown {
  Species species = Species::kPine;
  CrownSize size;
  Shape living;
  Shape dead;  // branches below the crown: a slim thing, looked into far less often
};

// What the trees and plants of a stand are instances of: for each species five heights of crown
// that begin at four heights each. Three variants of each kind of plant, kind by kind.
struct GrownShapes {
  std::vector<GrownCrown> crowns;
  std::vector<Shape> plants;
};
[[nodiscard]] GrownShapes grow_shapes(const StandConfig& config, std::uint64_t seed);

// The crown that resembles a tree's most: in height, then in where it begins.
[[nodiscard]] std::size_t nearest_crown(const std::vector<GrownCrown>& crowns,
                                        const GrownTree& tree);

// Cosine and sine of the quarter turn below an angle in [0, 2 pi), by which crowns and plants are
// turned. Boxes around shapes that are turned by quarters stay as narrow as the shapes: rays look
// into a fifth fewer of them.
[[nodiscard]] std::pair<float, float> quarter_turn(double yaw_rad);

}  // namespace understory
