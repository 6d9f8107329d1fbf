#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "understory/simulation/stand/stand.h"
#include "understory/util/random.h"

namespace understory {

// A bag of triangles that many trees or plants share (instances).
struct Shape {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Eigen::Vector3i> triangles;
};

// A crown as grown by a tree of the given size: z = 0 at the foot of the stem, the stem on the z
// axis. Branches in whorls (pine, spruce) or singly (birch), leaves and shoots as small triangles
// that leave gaps for the beam.
struct CrownSize {
  double height_m = 15.0;
  double crown_base_m = 8.0;
  double crown_radius_m = 1.4;
  double foliage = 1.0;
  double dead_branches = 1.0;
};
[[nodiscard]] Shape grow_crown(Species species, const CrownSize& size, Random& random);

// The dead branches below that crown.
[[nodiscard]] Shape grow_dead_branches(Species species, const CrownSize& size, Random& random);

// An undergrowth plant of height 1 m (a patch about 1 m wide for ground plants), its foot at zero.
[[nodiscard]] Shape grow_plant(PlantKind kind, Random& random);

}  // namespace understory
