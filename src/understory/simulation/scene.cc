#include "understory/simulation/scene.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "understory/simulation/counter_noise.h"
#include "understory/simulation/embree.h"
#include "understory/simulation/scene_geometry.h"
#include "understory/simulation/shapes.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

constexpr unsigned kGroundGeometry = 0;
constexpr unsigned kStemGeometry = 1;
constexpr unsigned kWoodGeometry = 2;
constexpr unsigned kBoulderGeometry = 3;
constexpr unsigned kBuildingGeometry = 4;

// The same with a number of one's own choice.
void attach_as(RTCScene scene, RTCGeometry geometry, unsigned id) {
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(scene, geometry, id);
  rtcReleaseGeometry(geometry);
}

// Attaches and lets go of a finished geometry; returns its number in the scene.
unsigned attach(RTCScene scene, RTCGeometry geometry) {
  rtcCommitGeometry(geometry);
  const unsigned id = rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
  return id;
}

// A crown shape and the size it was grown for.
struct CrownShape {
  Species species;
  CrownSize size;
  RTCScene living;
  RTCScene dead;  // branches below the crown: a slim thing, looked into far less often
};

CrownSize size_class(Species species, double height_m, double crown_base_share) {
  CrownSize size;
  size.height_m = height_m;
  const double dbh = 0.0115 * height_m;
  switch (species) {
    case Species::kPine:
      size.crown_base_m = 0.57 * height_m;
      size.crown_radius_m = 0.55 + 4.6 * dbh;
      break;
    case Species::kSpruce:
      size.crown_base_m = std::min(0.5 * height_m, 2.2);
      size.crown_radius_m = 0.6 + 5.0 * dbh;
      break;
    case Species::kBirch:
      size.crown_base_m = 0.47 * height_m;
      size.crown_radius_m = 0.6 + 6.0 * dbh;
      break;
  }
  if (crown_base_share > 0.0) size.crown_base_m = crown_base_share * height_m;
  return size;
}

// One thread builds, so that the tree of boxes does not depend on how many there are.
void commit(RTCScene scene) {
  in_arena(1, [&] { rtcJoinCommitScene(scene); });
}

}  // namespace

class ForestScene::Impl {
 public:
  Impl(const StandConfig& config, const Terrain& terrain, const Stand& stand, std::uint64_t seed,
       double snow_m)
      : snowy_(snow_m > 0.0), snow_m_(snow_m) {
    // No number of threads here: the library would hold the whole process to it.
    device_ = rtcNewDevice("set_affinity=0");
    UNDERSTORY_CHECK(device_ != nullptr);
    top_ = rtcNewScene(device_);
    add_static(terrain, stand);
    grow_shapes(config, seed);
    wind_sway_m_ = config.wind_sway_m;
    add_crowns(stand);
    add_plants(stand);
    commit(top_);
    if (wind_sway_m_ > 0.0) still_ = copy_of_instances();
    UNDERSTORY_CHECK(rtcGetDeviceError(device_) == RTC_ERROR_NONE);
  }

  ~Impl() {
    if (still_ != nullptr) rtcReleaseScene(still_);
    rtcReleaseScene(top_);
    for (const RTCScene scene : scenes_)
      rtcReleaseScene(scene);
    rtcReleaseDevice(device_);
  }

  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

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
    // First what stands in the way most surely: leaves behind it need not be looked for.
    embree_intersect16(valid, static_, &packet);
    embree_intersect16(valid, top_, &packet);
    for (std::size_t i = 0; i < count; ++i)
      hits[i] = read_hit(packet, i, rays[i]);
  }

  void sway(double time_s) {
    if (wind_sway_m_ <= 0.0) return;
    for (const Swaying& crown : swaying_) {
      const Eigen::Vector2d top = wind_sway_m_ * sway_of(crown.tree, crown.height_m, time_s);
      Eigen::Matrix<float, 3, 4> world_from_shape = crown.world_from_shape;
      world_from_shape.col(2).head<2>() += (top / crown.shape_height_m).cast<float>();
      RTCGeometry geometry = rtcGetGeometry(top_, crown.instance);
      rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR,
                              world_from_shape.data());
      rtcCommitGeometry(geometry);
    }
    commit(top_);
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
    embree_occluded1(still_ != nullptr ? still_ : top_, &ray);
    if (ray.tfar >= 0.0F) embree_occluded1(static_, &ray);
    return ray.tfar < 0.0F;
  }

 private:
  // A part of a crown that leans with the wind.
  struct Swaying {
    unsigned instance;
    Eigen::Matrix<float, 3, 4> world_from_shape;
    std::uint64_t tree;
    double height_m;
    double shape_height_m;
  };

  // Where the wind has the top of a tree, for a sway of standard deviation 1 in each direction:
  // trees swing at their own pace, the taller the slower, in gusts that all of them feel.
  static Eigen::Vector2d sway_of(std::uint64_t tree, double height_m, double time_s) {
    CounterNoise noise(tree, stream_of(NoiseStream::kShapes), 77);
    const double pace = 2.0 * std::numbers::pi * 3.6 / (height_m + 4.0);
    const auto wave = [&](double share) {
      return std::sin(share * pace * time_s + 2.0 * std::numbers::pi * noise.uniform());
    };
    const double gust = 1.0 + 0.6 * std::sin(0.31 * time_s) + 0.3 * std::sin(0.83 * time_s + 1.0);
    const double east = 0.85 * wave(1.0) + 0.5 * wave(0.37);
    const double north = 0.85 * wave(1.13) + 0.5 * wave(0.41);
    return gust * Eigen::Vector2d(east, north);
  }

  // What an instance is: its surface, how it is turned, and how bright.
  struct Instance {
    Surface surface;
    float cos_yaw;
    float sin_yaw;
    float reflectivity;
  };

  [[nodiscard]] Hit read_hit(const RTCRayHit16& packet, std::size_t i, const Ray& ray) const {
    Hit hit;
    if (packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) return hit;
    const unsigned number = packet.hit.instID[0][i];
    const bool is_static = number == RTC_INVALID_GEOMETRY_ID;
    const Instance instance =
        is_static ? Instance{Surface::kGround, 1.0F, 0.0F, 0.3F} : instances_[number];
    const Eigen::Vector3f normal(packet.hit.Ng_x[i], packet.hit.Ng_y[i], packet.hit.Ng_z[i]);
    const Eigen::Vector3f turned(instance.cos_yaw * normal.x() - instance.sin_yaw * normal.y(),
                                 instance.sin_yaw * normal.x() + instance.cos_yaw * normal.y(),
                                 normal.z());
    hit.range_m = packet.ray.tfar[i];
    const float length = turned.norm();
    hit.cosine =
        length > 0.0F ? std::min(1.0F, std::abs(turned.dot(ray.direction)) / length) : 0.5F;
    hit.surface = instance.surface;
    hit.reflectivity = instance.reflectivity;
    if (is_static) read_static(packet, i, hit);
    return hit;
  }

  void read_static(const RTCRayHit16& packet, std::size_t i, Hit& hit) const {
    const unsigned primitive = packet.hit.primID[i];
    if (packet.hit.geomID[i] == kStemGeometry) {
      hit.surface = Surface::kStem;
      hit.tree = cone_tree_[primitive];
      hit.reflectivity = bark_[static_cast<std::size_t>(hit.tree)];
    } else if (packet.hit.geomID[i] == kWoodGeometry) {
      hit.surface = Surface::kDeadWood;
      hit.reflectivity = 0.32F;
    } else if (packet.hit.geomID[i] == kBoulderGeometry) {
      hit.surface = Surface::kBoulder;
      hit.reflectivity = 0.28F;
    } else if (packet.hit.geomID[i] == kBuildingGeometry) {
      hit.surface = Surface::kBuilding;
      hit.reflectivity = 0.55F;
    } else if (snowy_) {
      hit.reflectivity =
          0.72F + 0.14F * static_cast<float>(hash_numbers(primitive) >> 40) * 0x1p-24F;
    } else {
      // Litter, moss and soil in patches.
      hit.reflectivity =
          0.22F + 0.18F * static_cast<float>(hash_numbers(primitive) >> 40) * 0x1p-24F;
    }
  }

  void add_static(const Terrain& terrain, const Stand& stand) {
    static_ = new_scene();
    UNDERSTORY_CHECK(attach(static_, terrain_geometry(device_, terrain)) == kGroundGeometry);
    Cones stems;
    int largest = 0;
    for (const Tree& tree : stand.trees)
      largest = std::max(largest, tree.id);
    bark_.assign(static_cast<std::size_t>(largest) + 1, 0.3F);
    for (const Tree& tree : stand.trees)
      add_stem(tree, stems);
    // Always present, so that geometry numbers stay what they are: a cone below the ground.
    stems.add({0.0, 0.0, -1000.0}, 0.01);
    stems.join();
    cone_tree_.push_back(0);
    stems.add({0.0, 0.0, -1000.5}, 0.01);
    UNDERSTORY_CHECK(attach(static_, cone_geometry(device_, stems)) == kStemGeometry);
    Cones wood;
    for (const Wood& piece : stand.dead_wood) {
      wood.add(piece.from, piece.radius_from_m);
      wood.join();
      wood.add(piece.to, piece.radius_to_m);
    }
    if (!wood.first.empty()) {
      UNDERSTORY_CHECK(attach(static_, cone_geometry(device_, wood)) == kWoodGeometry);
    }
    add_solids(stand);
    commit(static_);
  }

  void add_solids(const Stand& stand) {
    Cones boulders;
    for (const Wood& boulder : stand.boulders) {
      boulders.add(boulder.from, boulder.radius_from_m);
      boulders.join();
      boulders.add(boulder.to, boulder.radius_to_m);
    }
    if (!boulders.first.empty()) {
      attach_as(static_, cone_geometry(device_, boulders), kBoulderGeometry);
    }
    Shape houses;
    for (const Building& building : stand.buildings) {
      const Shape house = building_shape(building);
      const int first = static_cast<int>(houses.vertices.size());
      houses.vertices.insert(houses.vertices.end(), house.vertices.begin(), house.vertices.end());
      for (const Eigen::Vector3i& triangle : house.triangles)
        houses.triangles.push_back(triangle + Eigen::Vector3i::Constant(first));
    }
    if (!houses.triangles.empty()) {
      attach_as(static_, shape_geometry(device_, houses), kBuildingGeometry);
    }
  }

  void add_stem(const Tree& tree, Cones& stems) {
    bark_[static_cast<std::size_t>(tree.id)] = static_cast<float>(tree.bark_reflectivity);
    const std::vector<double> heights = tree.joints();
    for (std::size_t i = 0; i < heights.size(); ++i) {
      const Tree::Joint joint = tree.joint(heights[i]);
      stems.add(joint.centre, joint.radius_m);
      if (i + 1 < heights.size()) {
        stems.join();
        cone_tree_.push_back(tree.id);
      }
    }
    if (tree.fork_m <= 0.0) return;
    std::vector<double> twin = {tree.fork_m};
    for (const double height : heights) {
      if (height > tree.fork_m + 0.1) twin.push_back(height);
    }
    for (std::size_t i = 0; i < twin.size(); ++i) {
      const Tree::Joint joint = tree.fork_joint(twin[i]);
      stems.add(joint.centre, joint.radius_m);
      if (i + 1 < twin.size()) {
        stems.join();
        cone_tree_.push_back(tree.id);
      }
    }
  }

  void grow_shapes(const StandConfig& config, std::uint64_t seed) {
    constexpr std::array kHeights = {6.0, 10.0, 14.0, 18.0, 23.0};
    std::uint64_t number = 0;
    for (const Species species : {Species::kPine, Species::kSpruce, Species::kBirch}) {
      for (const double height : kHeights) {
        for (int variant = 0; variant < 2; ++variant) {
          Random random(hash_numbers(seed, stream_of(NoiseStream::kShapes)), ++number);
          CrownSize size = size_class(species, height, config.crown_base_share);
          size.foliage = config.foliage;
          size.dead_branches = config.dead_branches;
          const RTCScene living = shape_scene(grow_crown(species, size, random));
          const RTCScene dead = shape_scene(grow_dead_branches(species, size, random));
          crowns_.push_back({species, size, living, dead});
        }
      }
    }
    for (const PlantKind kind :
         {PlantKind::kSeedling, PlantKind::kShrub, PlantKind::kGroundPlants}) {
      for (int variant = 0; variant < 3; ++variant) {
        Random random(hash_numbers(seed, stream_of(NoiseStream::kShapes)), ++number);
        plants_.push_back(shape_scene(grow_plant(kind, random)));
      }
    }
  }

  void add_crowns(const Stand& stand) {
    for (const Tree& tree : stand.trees) {
      if (tree.broken_m > 0.0) continue;  // dead: no crown
      const CrownShape* best = nullptr;
      double nearest = 1e9;
      for (std::size_t i = 0; i < crowns_.size(); ++i) {
        if (crowns_[i].species != tree.species) continue;
        // Trees of odd and even numbers take different variants.
        const double distance = std::abs(crowns_[i].size.height_m - tree.height_m) +
                                ((static_cast<int>(i) ^ tree.id) & 1 ? 1e-3 : 0.0);
        if (distance < nearest) {
          nearest = distance;
          best = &crowns_[i];
        }
      }
      add_crown(tree, *best);
    }
  }

  // The grown shape, stretched to the tree's height and crown, turned and sheared with its lean.
  void add_crown(const Tree& tree, const CrownShape& crown) {
    const auto cos_yaw = static_cast<float>(std::cos(tree.yaw_rad));
    const auto sin_yaw = static_cast<float>(std::sin(tree.yaw_rad));
    const auto wide = static_cast<float>(tree.crown_radius_m / crown.size.crown_radius_m);
    const auto high = static_cast<float>(tree.height_m / crown.size.height_m);
    Eigen::Matrix<float, 3, 4> world_from_shape;
    world_from_shape.col(0) << wide * cos_yaw, wide * sin_yaw, 0.0F;
    world_from_shape.col(1) << -wide * sin_yaw, wide * cos_yaw, 0.0F;
    world_from_shape.col(2) << high * static_cast<float>(tree.lean.x()),
        high * static_cast<float>(tree.lean.y()), high;
    world_from_shape.col(3) = tree.foot.cast<float>();
    const float leaf = tree.species == Species::kBirch ? 0.5F : 0.42F;
    for (const auto& [scene, reflectivity] : {std::pair(crown.living, leaf), {crown.dead, 0.3F}}) {
      const unsigned number = add_instance(scene, world_from_shape,
                                           {Surface::kFoliage, cos_yaw, sin_yaw, reflectivity});
      swaying_.push_back({number, world_from_shape, static_cast<std::uint64_t>(tree.id),
                          tree.height_m, crown.size.height_m});
    }
  }

  void add_plants(const Stand& stand) {
    for (std::size_t i = 0; i < stand.plants.size(); ++i) {
      const Plant& plant = stand.plants[i];
      const auto cos_yaw = static_cast<float>(std::cos(plant.yaw_rad));
      const auto sin_yaw = static_cast<float>(std::sin(plant.yaw_rad));
      if (snowy_ && plant.height_m < snow_m_) continue;  // covered
      const auto high = static_cast<float>(plant.height_m);
      const float wide = plant.kind == PlantKind::kGroundPlants ? 1.0F : high;
      Eigen::Matrix<float, 3, 4> world_from_shape;
      world_from_shape.col(0) << wide * cos_yaw, wide * sin_yaw, 0.0F;
      world_from_shape.col(1) << -wide * sin_yaw, wide * cos_yaw, 0.0F;
      world_from_shape.col(2) << 0.0F, 0.0F, high;
      world_from_shape.col(3) = plant.foot.cast<float>();
      if (snowy_) world_from_shape(2, 3) -= static_cast<float>(snow_m_);
      add_instance(plants_[3 * static_cast<std::size_t>(plant.kind) + i % 3], world_from_shape,
                   {Surface::kPlant, cos_yaw, sin_yaw, 0.45F});
    }
  }

  RTCScene new_scene() {
    RTCScene scene = rtcNewScene(device_);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_NONE);
    scenes_.push_back(scene);
    return scene;
  }

  RTCScene shape_scene(Shape shape) {
    if (shape.triangles.empty()) {  // a bare crown: a triangle without area, which no ray meets
      shape.vertices.assign(3, Eigen::Vector3f::Zero());
      shape.triangles.emplace_back(0, 1, 2);
    }
    RTCScene scene = new_scene();
    attach(scene, shape_geometry(device_, shape));
    commit(scene);
    return scene;
  }

  unsigned add_instance(RTCScene scene, const Eigen::Matrix<float, 3, 4>& world_from_shape,
                        const Instance& instance) {
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(geometry, scene);
    rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, world_from_shape.data());
    const unsigned id = attach(top_, geometry);
    UNDERSTORY_CHECK(id == instances_.size());
    instances_.push_back(instance);
    shapes_.push_back({scene, world_from_shape});
    return id;
  }

  // The same crowns and plants once more, to stay where they are.
  RTCScene copy_of_instances() {
    RTCScene copy = rtcNewScene(device_);
    for (const auto& [scene, world_from_shape] : shapes_) {
      RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
      rtcSetGeometryInstancedScene(geometry, scene);
      rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR,
                              world_from_shape.data());
      attach(copy, geometry);
    }
    commit(copy);
    return copy;
  }

  RTCDevice device_ = nullptr;
  RTCScene static_ = nullptr;  // ground, stems, dead wood
  RTCScene top_ = nullptr;     // instances of crowns and plants
  std::vector<RTCScene> scenes_;
  std::vector<CrownShape> crowns_;
  std::vector<RTCScene> plants_;  // three of each kind
  RTCScene still_ = nullptr;      // the instances at rest, if there is wind
  std::vector<Instance> instances_;
  std::vector<std::pair<RTCScene, Eigen::Matrix<float, 3, 4>>> shapes_;  // of the instances
  std::vector<Swaying> swaying_;
  double wind_sway_m_ = 0.0;
  bool snowy_ = false;
  double snow_m_ = 0.0;
  std::vector<int> cone_tree_;  // id of the tree of each cone
  std::vector<float> bark_;     // reflectivity by id
};

ForestScene::ForestScene(const StandConfig& config, const Terrain& terrain, const Stand& stand,
                         std::uint64_t seed, double snow_m)
    : impl_(std::make_unique<Impl>(config, terrain, stand, seed, snow_m)) {}
ForestScene::~ForestScene() = default;

void ForestScene::sway(double time_s) {
  impl_->sway(time_s);
}

void ForestScene::cast(const Ray* rays, std::size_t count, float near_m, float far_m,
                       Hit* hits) const {
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
