#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "understory/simulation/scene/terrain.h"
#include "understory/simulation/site.h"
#include "understory/simulation/stand/harvest.h"
#include "understory/simulation/stand/stand.h"

namespace understory {

// What a ray has met.
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
  kSnow,
  kObject
};

// How a scene is cast: ray by ray, or in bundles of rays that belong to one beam. What the two say
// of up to three rays in ten thousand differs: of those that graze what they meet.
enum class Casting : std::uint8_t { kRays, kBundles };

// A ray of light, cast into the scene.
struct Ray {
  Eigen::Vector3f origin = Eigen::Vector3f::Zero();     // world frame
  Eigen::Vector3f direction = Eigen::Vector3f::Zero();  // unit length
  float time_s = 0.0F;  // after the moment to which the scene was brought, for the wind
};

// What a ray has met, and where along it.
struct Hit {
  float range_m = 0.0F;
  float cosine = 1.0F;  // of the angle of incidence, 0..1
  float reflectivity = 0.0F;
  int tree = 0;  // id of the tree whose stem, branches or leaves were hit, 0 for anything else
  Surface surface = Surface::kNone;
};

// Terrain and stand as Embree geometry: stems are round cones one by one. Crowns and plants are
// instances of a few grown shapes, so that memory hardly grows with the number of trees. Casting is
// thread-safe; results depend on the rays and on the moment of the scene alone.
class ForestScene {
 public:
  // With snow_m above zero the ground is bright. A harvest takes trees away and leaves logs.
  ForestScene(const StandConfig& config, const Terrain& terrain, const Stand& stand,
              std::uint64_t seed, double snow_m = 0.0, const Harvest& harvest = {},
              Casting casting = Casting::kRays);
  ~ForestScene();
  ForestScene(const ForestScene&) = delete;
  ForestScene& operator=(const ForestScene&) = delete;

  // Brings the scene to a moment (seconds since the path's zero). Stems and crowns are where the
  // wind has them at wind_s. What was felled by stand_s is gone, and what fell by then lies there.
  // Before the first call all stand at rest. What a moment looks like does not depend on those
  // before it. Not while others cast.
  void arrange(double wind_s, double stand_s);
  // When the harvest changes the scene, in order.
  [[nodiscard]] const std::vector<double>& changes() const;

  // The first thing each ray meets within [near_m, far_m]. Neighbouring rays should lie beside each
  // other: sixteen at a time go through the scene together. In a scene for bundles, those of a beam
  // do, of which each has `rays_per_beam`. A ray sees what it hits as the wind has moved it between
  // the moment of the scene and its own. This is to first order: surfaces move along the beam and
  // across it, their outlines stay.
  void cast(const Ray* rays, std::size_t count, float near_m, float far_m, Hit* hits,
            std::size_t rays_per_beam = 1) const;

  // Replaces `hit` where a ray meets a cut tree before it; the stem's hits have no tree.
  void cast_held(const HeldTree& held, const Ray& ray, float near_m, float far_m, Hit& hit) const;

  // Share of the upper sky (above 15 degrees) that is hidden from a place, 0..1, in still air and
  // before anything was felled.
  [[nodiscard]] double canopy_cover(const Eigen::Vector3d& place) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace understory
