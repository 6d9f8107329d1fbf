#include "understory/simulation/scene/scene.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "understory/simulation/scene/scene_content.h"
#include "understory/simulation/stand/objects.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"

namespace understory {
namespace {

constexpr float kSlant = 0.3F;  // cosine below which a surface's own way counts as at this one

}  // namespace

class ForestScene::Impl : private SceneContent {
 public:
  using SceneContent::SceneContent;

  void cast16(const Ray* rays, std::size_t count, float near_m, float far_m, Hit* hits) const {
    alignas(64) RTCRayHit16 packet;
    alignas(64) int valid[16];
    for (std::size_t i = 0; i < 16; ++i) {
      const Ray& ray = rays[i < count ? i : 0];
      valid[i] = i < count ? -1 : 0;
      packet.ray.org_x[i] = ray.origin.x();
      packet.ray.org_y[i] = ray.origin.y();
      packet.ray.org_z[i] = ray.origin.z();
      packet.ray.dir_x[i] = ray.direction.x();
      packet.ray.dir_y[i] = ray.direction.y();
      packet.ray.dir_z[i] = ray.direction.z();
      packet.ray.tnear[i] = near_m;
      packet.ray.tfar[i] = far_m;
      packet.ray.time[i] = 0.0F;
      packet.ray.mask[i] = 0xffffffffU;
      packet.ray.id[i] = 0;
      packet.ray.flags[i] = 0;
      packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    // First what stands in the way most surely: leaves behind it need not be looked for. (The flag
    // for coherent rays would save 5 % here, but lets single rays miss what they graze.)
    embree_intersect16(valid, static_, &packet);
    embree_intersect16(valid, rooted_, &packet);
    embree_intersect16(valid, top_, &packet);
    for (std::size_t i = 0; i < count; ++i)
      hits[i] = read_hit(met_by(packet, i), rays[i]);
  }

  // Beams of rays_per_beam, each in as few bundles as it takes.
  void cast_beams(const Ray* rays, std::size_t count, std::size_t rays_per_beam, float near_m,
                  float far_m, Hit* hits) const {
    const std::size_t bundles = (rays_per_beam + kLanes - 1) / kLanes;
    for (std::size_t beam = 0; beam < count; beam += rays_per_beam) {
      for (std::size_t k = 0; k < bundles; ++k) {
        const std::size_t begin = beam + k * rays_per_beam / bundles;
        const std::size_t size = beam + (k + 1) * rays_per_beam / bundles - begin;
        std::array<Met, kLanes> met;
        bundles_->cast(rays + begin, size, near_m, far_m, met.data());
        for (std::size_t i = 0; i < size; ++i)
          hits[begin + i] = read_hit(met[i], rays[begin + i]);
      }
    }
  }

  [[nodiscard]] bool by_beams() const { return bundles_ != nullptr; }

  void arrange(double wind_s, double stand_s) {
    bool moved = false;
    for (const Timed& part : timed_) {
      const bool present = stand_s >= part.from_s && stand_s < part.until_s;
      if (present == present_[part.instance]) continue;
      present_[part.instance] = present;
      RTCGeometry geometry = rtcGetGeometry(top_, part.instance);
      present ? rtcEnableGeometry(geometry) : rtcDisableGeometry(geometry);
      if (bundles_) bundles_->field().show(part.instance, present);
      moved = true;
    }
    const bool swayed = (!sways_.empty() || !walkers_.empty()) && wind_s != wind_s_;
    if (swayed) {
      sway(wind_s);
      walk(wind_s);
    }
    if (bundles_) {
      if (swayed) bundles_->field().commit();
    } else if (moved || swayed) {
      commit_alone(top_);
    }
    wind_s_ = wind_s;
  }

  [[nodiscard]] const std::vector<double>& changes() const { return changes_; }

  void cast_held(const HeldTree& held, const Ray& ray, float near_m, float far_m, Hit& hit) const {
    const FelledTree& tree = felled_.at(held.tree);
    const Pose tree_from_world = held.world_from_tree.inverse();
    Ray in_tree = ray;
    in_tree.origin = (tree_from_world * ray.origin.cast<double>()).cast<float>();
    in_tree.direction = (tree_from_world.rotation() * ray.direction.cast<double>()).cast<float>();
    // Past the round column that holds the tree.
    const Eigen::Vector2f aside = in_tree.direction.head<2>();
    const float miss = std::abs(in_tree.origin.x() * aside.y() - in_tree.origin.y() * aside.x());
    if (miss > tree.reach_m * aside.norm()) return;
    for (const auto& [instance, from_m] : {std::pair(tree.stem, held.stem_from_m),
                                           {tree.living, held.crown_from_m},
                                           {tree.dead, held.crown_from_m}}) {
      if (instance == kNone) continue;
      const float limit = hit.surface == Surface::kNone ? far_m : hit.range_m;
      meet_part({instance, tree.foot, static_cast<float>(from_m)}, in_tree, near_m, limit, hit);
    }
  }

  [[nodiscard]] bool occluded(const Eigen::Vector3f& origin, const Eigen::Vector3f& to) const {
    RTCRay ray{};
    ray.org_x = origin.x();
    ray.org_y = origin.y();
    ray.org_z = origin.z();
    ray.dir_x = to.x();
    ray.dir_y = to.y();
    ray.dir_z = to.z();
    ray.tnear = 0.05F;
    ray.tfar = 60.0F;
    ray.mask = 0xffffffffU;
    embree_occluded1(still_, &ray);
    if (ray.tfar >= 0.0F) embree_occluded1(static_, &ray);
    return ray.tfar < 0.0F;
  }

 private:
  void sway(double time_s) {
    for (TreeSway& tree : sways_) {
      const double above = tree.height_m - tree.stiff_m;
      tree.bend = (Wind::top(tree.sway, time_s) / above).cast<float>();
      tree.bend_rate = (Wind::top_velocity(tree.sway, time_s) / above).cast<float>();
    }
    parallel_for(swaying_.size(), 64, [&](std::size_t i) {
      const Swaying& part = swaying_[i];
      const TreeSway& tree = sways_[part.tree];
      Eigen::Matrix<float, 3, 4> world_from_shape = shapes_[part.instance].second;
      // x += bend (z - stiff), z above the foot.
      world_from_shape.col(2).head<2>() += world_from_shape(2, 2) * tree.bend;
      world_from_shape.col(3).head<2>() -= static_cast<float>(tree.stiff_m) * tree.bend;
      move(part.instance, world_from_shape);
    });
  }

  void walk(double time_s) {
    for (Walker& walker : walkers_) {
      const ObjectMotion motion = motion_at(walker.object, time_s);
      walker.velocity = motion.velocity.cast<float>();
      for (const unsigned instance : walker.instances) {
        Eigen::Matrix<float, 3, 4> world_from_shape = shapes_[instance].second;
        world_from_shape.col(3) = motion.foot.cast<float>();
        move(instance, world_from_shape);
      }
    }
  }

  void move(unsigned instance, const Eigen::Matrix<float, 3, 4>& world_from_shape) {
    if (bundles_) {
      bundles_->field().move(instance, world_from_shape);
      return;
    }
    RTCGeometry geometry = rtcGetGeometry(top_, instance);
    rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, world_from_shape.data());
    rtcCommitGeometry(geometry);
  }

  // A part of a felled tree: its shape, where the tree stood, the height above which it is there.
  struct FelledPart {
    unsigned instance;
    Eigen::Vector3f foot;
    float from_m;
  };

  // The first hit of a ray in the tree's frame, between near_m and far_m along it.
  void meet_part(const FelledPart& part, const Ray& in_tree, float near_m, float far_m,
                 Hit& hit) const {
    const auto& [instance, foot, from_m] = part;
    const Eigen::Vector3f& origin = in_tree.origin;
    const Eigen::Vector3f& direction = in_tree.direction;
    if (std::abs(direction.z()) > 1e-9F) {
      const float cut = (from_m - origin.z()) / direction.z();
      direction.z() > 0.0F ? near_m = std::max(near_m, cut) : far_m = std::min(far_m, cut);
    } else if (origin.z() < from_m) {
      return;
    }
    if (near_m >= far_m) return;
    const auto& [scene, world_from_shape] = shapes_[instance];
    const Eigen::Matrix3f shape_from_tree = world_from_shape.leftCols<3>().inverse();
    const Eigen::Vector3f offset = world_from_shape.col(3) - foot;
    const Eigen::Vector3f from = shape_from_tree * (origin - offset);
    const Eigen::Vector3f along = shape_from_tree * direction;
    alignas(16) RTCRayHit query{};
    query.ray = {from.x(),  from.y(), from.z(), near_m, along.x(), along.y(),
                 along.z(), 0.0F,     far_m,    ~0U,    0U,        0U};
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    embree_intersect1(scene, &query);
    if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return;
    const Eigen::Vector3f normal = (shape_from_tree.transpose() *
                                    Eigen::Vector3f(query.hit.Ng_x, query.hit.Ng_y, query.hit.Ng_z))
                                       .normalized();
    hit.range_m = query.ray.tfar;
    hit.cosine = std::min(1.0F, std::abs(normal.dot(direction)));
    hit.reflectivity = instances_[instance].reflectivity;
    hit.tree = 0;
    hit.surface = instances_[instance].surface;
    if (hit.surface == Surface::kStem) {
      const auto id = static_cast<std::size_t>(instances_[instance].tree);
      emboss(id, 0.0F, normal, origin, direction, hit);
    }
  }

  static Met met_by(const RTCRayHit16& packet, std::size_t i) {
    return {packet.ray.tfar[i],
            {packet.hit.Ng_x[i], packet.hit.Ng_y[i], packet.hit.Ng_z[i]},
            packet.hit.instID[0][i],
            packet.hit.geomID[i],
            packet.hit.primID[i]};
  }

  [[nodiscard]] Hit read_hit(const Met& met, const Ray& ray) const {
    Hit hit;
    if (met.geometry == Met::kNothing) return hit;
    const unsigned number = met.instance;
    const bool is_static = number == Met::kNothing;
    const Instance instance =
        is_static ? Instance{Surface::kGround, 1.0F, 0.0F, 0.3F} : instances_[number];
    const Eigen::Vector3f& normal = met.normal;
    const Eigen::Vector3f turned(instance.cos_yaw * normal.x() - instance.sin_yaw * normal.y(),
                                 instance.sin_yaw * normal.x() + instance.cos_yaw * normal.y(),
                                 normal.z());
    hit.range_m = met.range_m;
    const float length = turned.norm();
    hit.cosine =
        length > 0.0F ? std::min(1.0F, std::abs(turned.dot(ray.direction)) / length) : 0.5F;
    hit.surface = instance.surface;
    hit.reflectivity = instance.reflectivity;
    hit.tree = instance.tree;
    if (is_static) read_static(met, hit);
    if (hit.surface == Surface::kStem && length > 0.0F) {
      const auto id = static_cast<std::size_t>(hit.tree);
      emboss(id, foot_z_[id], turned / length, ray.origin, ray.direction, hit);
    }
    if (instance.sway != kStands && ray.time_s != 0.0F) {
      move_on(sways_[instance.sway], turned / std::max(length, 1e-20F), ray, hit);
    }
    if (instance.walker != kStands) {
      const Eigen::Vector2f way = ray.time_s * walkers_[instance.walker].velocity;
      shift(way, turned / std::max(length, 1e-20F), ray, hit);
    }
    return hit;
  }

  // A stem's bark lies beside the round stem that was hit. The hit moves to it along the ray, to
  // first order, and the outline stays round. Normal and ray in a frame whose z axis is the tree's.
  void emboss(std::size_t tree, float foot_z, const Eigen::Vector3f& normal,
              const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, Hit& hit) const {
    const StemSurface& surface = surfaces_[tree];
    const float flat = normal.head<2>().norm();
    if (surface.round() || flat < 1e-3F) return;
    const float facing = normal.dot(direction);
    const float outwards = (facing < 0.0F ? 1.0F : -1.0F) / flat;
    const float height = origin.z() + hit.range_m * direction.z() - foot_z;
    const float offset = surface.offset(outwards * normal.x(), outwards * normal.y(), height);
    hit.range_m -= offset / std::max(kSlant, std::abs(facing));
  }

  // What was hit moves with the wind until the ray's own time: its plane does, along the ray.
  static void move_on(const TreeSway& tree, const Eigen::Vector3f& normal, const Ray& ray,
                      Hit& hit) {
    const float above = ray.origin.z() + hit.range_m * ray.direction.z() - tree.foot_z -
                        static_cast<float>(tree.stiff_m);
    shift(ray.time_s * above * tree.bend_rate, normal, ray, hit);
  }

  // The plane that was hit lies `way` farther on.
  static void shift(const Eigen::Vector2f& way, const Eigen::Vector3f& normal, const Ray& ray,
                    Hit& hit) {
    const float facing = normal.dot(ray.direction);
    // Seen at a slant a plane's own way along the ray is without bounds: leaves end before.
    const float sure = std::copysign(std::max(kSlant, std::abs(facing)), facing);
    hit.range_m += way.dot(normal.head<2>()) / sure;
  }

  // A random number in [0, 1) of a triangle of the ground.
  static float patch(unsigned primitive) {
    std::uint32_t x = primitive * 0x9e3779b1U;
    x = (x ^ (x >> 16)) * 0x85ebca6bU;
    x = (x ^ (x >> 13)) * 0xc2b2ae35U;
    return static_cast<float>(x >> 8) * 0x1p-24F;
  }

  void read_static(const Met& met, Hit& hit) const {
    const unsigned primitive = met.primitive;
    if (met.geometry == kStemGeometry) {
      hit.surface = Surface::kStem;
      hit.tree = cone_tree_[primitive];
      hit.reflectivity = bark_[static_cast<std::size_t>(hit.tree)];
    } else if (met.geometry == kWoodGeometry) {
      hit.surface = Surface::kDeadWood;
      hit.reflectivity = 0.32F;
    } else if (met.geometry == kBoulderGeometry) {
      hit.surface = Surface::kBoulder;
      hit.reflectivity = 0.28F;
    } else if (met.geometry == kBuildingGeometry) {
      hit.surface = Surface::kBuilding;
      hit.reflectivity = 0.55F;
    } else if (snowy_) {
      hit.reflectivity = 0.72F + 0.14F * patch(primitive);
    } else {
      // Litter, moss and soil in patches.
      hit.reflectivity = 0.22F + 0.18F * patch(primitive);
    }
  }

  double wind_s_ = -kForever;  // to which the trees sway
};

ForestScene::ForestScene(const StandConfig& config, const Terrain& terrain, const Stand& stand,
                         std::uint64_t seed, double snow_m, const Harvest& harvest, Casting casting)
    : impl_(std::make_unique<Impl>(config, terrain, stand, seed, snow_m, harvest, casting)) {}
ForestScene::~ForestScene() = default;

void ForestScene::arrange(double wind_s, double stand_s) {
  impl_->arrange(wind_s, stand_s);
}

const std::vector<double>& ForestScene::changes() const {
  return impl_->changes();
}

void ForestScene::cast_held(const HeldTree& held, const Ray& ray, float near_m, float far_m,
                            Hit& hit) const {
  impl_->cast_held(held, ray, near_m, far_m, hit);
}

void ForestScene::cast(const Ray* rays, std::size_t count, float near_m, float far_m, Hit* hits,
                       std::size_t rays_per_beam) const {
  if (impl_->by_beams()) {
    impl_->cast_beams(rays, count, rays_per_beam, near_m, far_m, hits);
    return;
  }
  for (std::size_t i = 0; i < count; i += 16) {
    impl_->cast16(rays + i, std::min<std::size_t>(16, count - i), near_m, far_m, hits + i);
  }
}

double ForestScene::canopy_cover(const Eigen::Vector3d& place) const {
  constexpr int kDirections = 96;
  constexpr double kGolden = 2.399963229728653;  // radians
  const double lowest = std::sin(15.0 * std::numbers::pi / 180.0);
  int hidden = 0;
  for (int i = 0; i < kDirections; ++i) {
    const double z = lowest + (1.0 - lowest) * (i + 0.5) / kDirections;
    const double r = std::sqrt(1.0 - z * z);
    const Eigen::Vector3d direction(r * std::cos(kGolden * i), r * std::sin(kGolden * i), z);
    hidden += impl_->occluded(place.cast<float>(), direction.cast<float>()) ? 1 : 0;
  }
  return static_cast<double>(hidden) / kDirections;
}

}  // namespace understory
