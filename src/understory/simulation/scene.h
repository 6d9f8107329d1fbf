#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "understory/simulation/site.h"
#include "understory/simulation/stand.h"
#include "understory/simulation/terrain.h"

namespace understory {

enum class Surface : std::uint8_t {
  kNone,
  kGround,
  kStem,
  kDeadWood,
  kFoliage,
  kPlant,
  kMachine,
  kBoulder,
  kBuilding,
  kSnow
};

struct Ray {
  Eigen::Vector3f origin = Eigen::Vector3f::Zero();     // world frame
  Eigen::Vector3f direction = Eigen::Vector3f::Zero();  // unit length
};

struct Hit {
  float range_m = 0.0F;
  float cosine = 1.0F;  // of the angle of incidence, 0..1
  float reflectivity = 0.0F;
  int tree = 0;  // id of the tree whose stem was hit, 0 for anything else
  Surface surface = Surface::kNone;
};

// Terrain and stand as Embree geometry: stems are round cones one by one; crowns and plants are
// instances of a few grown shapes, so that memory hardly grows with the number of trees. Casting is
// thread-safe; results depend on the rays and on the moment of the wind alone.
class ForestScene {
 public:
  // With snow_m above zero the ground is bright.
  ForestScene(const StandConfig& config, const Terrain& terrain, const Stand& stand,
              std::uint64_t seed, double snow_m = 0.0);
  ~ForestScene();
  ForestScene(const ForestScene&) = delete;
  ForestScene& operator=(const ForestScene&) = delete;

  // Puts the crowns where the wind has them at a time; before that they hang at rest. What a later
  // moment looks like does not depend on earlier ones. Not while others cast.
  void sway(double time_s);

  // The first thing each ray meets within [near_m, far_m]. Neighbouring rays should lie beside each
  // other: sixteen at a time go through the scene together.
  void cast(const Ray* rays, std::size_t count, float near_m, float far_m, Hit* hits) const;

  // Share of the upper sky (above 15 degrees) that is hidden from a place, 0..1, in still air.
  [[nodiscard]] double canopy_cover(const Eigen::Vector3d& place) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace understory
