#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "understory/sensor/tree.h"

namespace understory {

// Whether the standard deviation of a tree's diameter is over 30 % of it: the diameter is hardly
// more than a guess. False without a diameter.
[[nodiscard]] bool has_weak_diameter(const Tree& tree);

// How many trees of a list are not to be trusted in which way.
struct StandDoubts {
  std::size_t trees = 0;
  std::size_t diameters = 0;       // trees with a diameter
  std::size_t weak_diameters = 0;  // of them, see has_weak_diameter
  std::size_t without_height = 0;
  std::size_t by_crown = 0;  // found by their crowns alone, without a diameter
};
[[nodiscard]] StandDoubts doubts_of(const std::vector<Tree>& trees);

// How far the diameter of a tree is to be trusted, in one word for a table, the worst that applies:
// - "no_diameter": it was found by its crown alone.
// - "weak_diameter": see has_weak_diameter.
// - "breast_height_hidden": nothing was seen of its stem below 1.5 m above the ground.
// - "one_side": less than half of its circumference was seen.
// - "good": none of these.
// A cut has "two_rings" as well (slice/slice_stems.h), a cloud "twice" (trees/double_images.h), and
// "coarse" where its places are rounded (pipeline/inventory/cloud_inventory.cc).
// `arc_deg`: as of doubt_of. `seen_from_m`: height above the ground from which on its stem was
// seen.
[[nodiscard]] std::string quality_of(const Tree& tree, double arc_deg, double seen_from_m = 0.0);

// How doubtful a tree is, to sort trees by it: larger is worse, 0 is certain. The relative standard
// deviation of the diameter over 30 %, plus the share of the circumference beyond a half that was
// not seen. Without a height 0.5 is added. `arc_deg`: the part that was seen, 0 to 360, NaN if
// unknown. A tree without a diameter is more doubtful than any with one.
[[nodiscard]] double doubt_of(const Tree& tree, double arc_deg);

}  // namespace understory
