#include "understory/simulation/scene/scene_content.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>

#include "understory/simulation/scene/scene_geometry.h"
#include "understory/util/error.h"
#include "understory/util/parallel.h"

namespace understory {
namespace {

constexpr float kThingReflectivity = 0.4F;  // of paint, plaster, sawn wood and clothes alike

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

// One cone of a stem.
struct StemPart {
  struct End {
    double height = 0.0;
    GrownTree::Joint joint;
  };
  End low;
  End high;
};

std::vector<StemPart> stem_parts(const GrownTree& tree) {
  std::vector<StemPart> parts;
  if (!tree.cloud.empty()) return parts;
  const std::vector<double> heights = tree.joints();
  for (std::size_t i = 0; i + 1 < heights.size(); ++i) {
    parts.push_back(
        {{heights[i], tree.joint(heights[i])}, {heights[i + 1], tree.joint(heights[i + 1])}});
  }
  if (tree.fork_m <= 0.0) return parts;
  std::vector<double> twin = {tree.fork_m};
  std::copy_if(heights.begin(), heights.end(), std::back_inserter(twin),
               [&](double height) { return height > tree.fork_m + 0.1; });
  for (std::size_t i = 0; i + 1 < twin.size(); ++i) {
    parts.push_back(
        {{twin[i], tree.fork_joint(twin[i])}, {twin[i + 1], tree.fork_joint(twin[i + 1])}});
  }
  return parts;
}

void add_part(const StemPart& part, const Eigen::Vector3d& shift, Cones& cones) {
  // Parts that follow each other share a joint.
  const GrownTree::Joint& low = part.low.joint;
  const Eigen::Vector3f from = (low.centre + shift).cast<float>();
  const bool follows = !cones.points.empty() && cones.points.back().x == from.x() &&
                       cones.points.back().y == from.y() && cones.points.back().z == from.z();
  if (!follows) cones.add(low.centre + shift, low.radius_m);
  cones.join();
  cones.add(part.high.joint.centre + shift, part.high.joint.radius_m);
}

}  // namespace

// One thread builds, so that the tree of boxes does not depend on how many there are.
void commit_alone(RTCScene scene) {
  in_arena(1, [&] { rtcJoinCommitScene(scene); });
}

template <class Content>
RTCScene SceneContent::scene_of(RTCGeometry geometry, const Content& content) {
  RTCScene scene = new_scene();
  attach(scene, geometry);
  commit_alone(scene);
  if (bundles_) bundles_->add_shape(scene, RayShape(content));
  return scene;
}

template <class Content>
void SceneContent::add_fixed(unsigned number, RTCGeometry geometry, const Content& content) {
  attach_as(static_, geometry, number);
  if (bundles_) bundles_->add_part(number, content);
}

SceneContent::SceneContent(const StandConfig& config, const Terrain& terrain, const Stand& stand,
                           std::uint64_t seed, double snow_m, const Harvest& harvest,
                           Casting casting)
    : bundles_(casting == Casting::kBundles ? std::make_unique<SceneBundles>() : nullptr),
      snowy_(snow_m > 0.0),
      snow_m_(snow_m),
      wind_(config.wind_sway_m) {
  // No number of threads here: the library would hold the whole process to it.
  device_ = rtcNewDevice("set_affinity=0");
  UNDERSTORY_CHECK(device_ != nullptr);
  top_ = rtcNewScene(device_);
  rooted_ = new_scene();
  for (const Felling& felling : harvest.fellings)
    felled_[felling.tree].grab_s = felling.grab_s;
  GrownShapes grown = grow_shapes(config, seed);
  add_shapes(grown);
  add_bark(config, stand, seed);
  add_static(terrain, stand);
  for (const GrownTree& tree : stand.trees)
    add_tree(tree, grown.crowns);
  add_plants(stand);
  still_ = copy_of_instances();
  add_remains(harvest, stand);
  add_things(stand);
  if (bundles_) {
    bundles_->finish();
  } else {
    commit_alone(rooted_);
    commit_alone(top_);
  }
  UNDERSTORY_CHECK(rtcGetDeviceError(device_) == RTC_ERROR_NONE);
}

SceneContent::~SceneContent() {
  rtcReleaseScene(still_);
  rtcReleaseScene(top_);
  for (const RTCScene scene : scenes_)
    rtcReleaseScene(scene);
  rtcReleaseDevice(device_);
}

void SceneContent::add_static(const Terrain& terrain, const Stand& stand) {
  static_ = new_scene();
  const Shape ground = terrain_shape(terrain);
  add_fixed(kGroundGeometry, shape_geometry(device_, ground), ground);
  Cones stems;
  for (const GrownTree& tree : stand.trees) {
    for (const StemPart& part : stem_parts(tree)) {
      if (!felled_.count(tree.id) && (wind_.still() || part.low.height < stiff_height(tree))) {
        add_part(part, Eigen::Vector3d::Zero(), stems);
        cone_tree_.push_back(tree.id);
      }
    }
  }
  if (bundles_) bundles_->add_part(kStemGeometry, stems);
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
    add_fixed(kWoodGeometry, cone_geometry(device_, wood), wood);
  }
  add_solids(stand);
  commit_alone(static_);
}

void SceneContent::add_bark(const StandConfig& config, const Stand& stand, std::uint64_t seed) {
  std::size_t count = 1;
  for (const GrownTree& tree : stand.trees)
    count = std::max(count, static_cast<std::size_t>(tree.id) + 1);
  bark_.assign(count, 0.3F);
  surfaces_.resize(count);
  foot_z_.assign(count, 0.0F);
  for (const GrownTree& tree : stand.trees) {
    const auto id = static_cast<std::size_t>(tree.id);
    bark_[id] = static_cast<float>(tree.bark_reflectivity);
    surfaces_[id] = StemSurface(config, tree, seed);
    foot_z_[id] = static_cast<float>(tree.foot.z());
  }
}

void SceneContent::add_solids(const Stand& stand) {
  Cones boulders;
  for (const Wood& boulder : stand.boulders) {
    boulders.add(boulder.from, boulder.radius_from_m);
    boulders.join();
    boulders.add(boulder.to, boulder.radius_to_m);
  }
  if (!boulders.first.empty()) {
    add_fixed(kBoulderGeometry, cone_geometry(device_, boulders), boulders);
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
    add_fixed(kBuildingGeometry, shape_geometry(device_, houses), houses);
  }
}

void SceneContent::add_shapes(GrownShapes& grown) {
  for (GrownCrown& crown : grown.crowns) {
    const RTCScene living = shape_scene(std::move(crown.living));
    crowns_.push_back({living, shape_scene(std::move(crown.dead))});
  }
  for (Shape& plant : grown.plants)
    plants_.push_back(shape_scene(std::move(plant)));
}

// What of a tree is not part of the fixed scene: its crown, and of its stem what sways or falls.
void SceneContent::add_tree(const GrownTree& tree, const std::vector<GrownCrown>& grown) {
  const auto found = felled_.find(tree.id);
  FelledTree* felled = found == felled_.end() ? nullptr : &found->second;
  std::size_t sway = kStands;
  if (!wind_.still() && felled == nullptr) {
    sway = sways_.size();
    sways_.push_back({wind_.sway_of(tree), stiff_height(tree), tree.height_m + 0.01,
                      static_cast<float>(tree.foot.z())});
  }
  if (!tree.cloud.empty()) {
    add_cloud(tree, sway);
    return;
  }
  const unsigned stem = add_stem(tree, felled != nullptr, sway);
  std::pair<unsigned, unsigned> crown(kNone, kNone);
  if (tree.broken_m <= 0.0) {  // else dead: no crown
    const std::size_t nearest = nearest_crown(grown, tree);
    crown = add_crown(tree, crowns_[nearest], grown[nearest].size, sway);
  }
  if (felled == nullptr) return;
  felled->foot = tree.foot.cast<float>();
  felled->reach_m = static_cast<float>(1.4 * tree.crown_radius_m +
                                       tree.lean.norm() * tree.height_m + tree.sweep.norm() + 0.5);
  felled->stem = stem;
  felled->living = crown.first;
  felled->dead = crown.second;
  for (const unsigned part : {stem, crown.first, crown.second}) {
    if (part != kNone) time_limit(part, -kForever, felled->grab_s);
  }
}

void SceneContent::add_cloud(const GrownTree& tree, std::size_t sway) {
  auto found = clouds_.find(tree.cloud);
  if (found == clouds_.end()) {
    const TreeCloud cloud = read_tree_cloud(tree.cloud, tree.dbh_m);
    const auto part_of = [&](const std::vector<TreeCloud::Disc>& discs, bool above) -> RTCScene {
      std::vector<TreeCloud::Disc> part;
      std::copy_if(discs.begin(), discs.end(), std::back_inserter(part), [&](const auto& disc) {
        return (disc.centre.z() >= kStiffShare * cloud.height_m) == above;
      });
      if (part.empty()) return nullptr;
      return scene_of(disc_geometry(device_, part), part);
    };
    const CloudScenes scenes{{part_of(cloud.stem, false), part_of(cloud.stem, true)},
                             {part_of(cloud.crown, false), part_of(cloud.crown, true)},
                             cloud.height_m};
    found = clouds_.emplace(tree.cloud, scenes).first;
  }
  const CloudScenes& scenes = found->second;
  const auto stretch = static_cast<float>(tree.height_m / scenes.height_m);
  const auto cos_yaw = static_cast<float>(std::cos(tree.yaw_rad));
  const auto sin_yaw = static_cast<float>(std::sin(tree.yaw_rad));
  Eigen::Matrix<float, 3, 4> world_from_shape;
  world_from_shape.col(0) << stretch * cos_yaw, stretch * sin_yaw, 0.0F;
  world_from_shape.col(1) << -stretch * sin_yaw, stretch * cos_yaw, 0.0F;
  world_from_shape.col(2) << 0.0F, 0.0F, stretch;
  world_from_shape.col(3) = tree.foot.cast<float>();
  for (const bool above : {false, true}) {
    const auto add = [&](RTCScene scene, Surface surface, double reflectivity, int id) {
      if (scene == nullptr) return;
      Instance instance{surface, cos_yaw, sin_yaw, static_cast<float>(reflectivity)};
      instance.tree = id;
      instance.sway = above ? sway : kStands;
      const unsigned number = add_instance(top_, scene, world_from_shape, instance);
      if (instance.sway != kStands) swaying_.push_back({number, sway});
    };
    add(scenes.stem[above ? 1 : 0], Surface::kStem, tree.bark_reflectivity, tree.id);
    add(scenes.crown[above ? 1 : 0], Surface::kFoliage, 0.42, tree.id);
  }
}

// The stem's upper part, which sways, or all of it where it will be felled; the feet of those
// stand still.
unsigned SceneContent::add_stem(const GrownTree& tree, bool all, std::size_t sway) {
  Cones high;
  for (const StemPart& part : stem_parts(tree)) {
    const bool yields = sway != kStands && part.low.height >= stiff_height(tree);
    if (all || yields) add_part(part, -tree.foot, high);
  }
  if (high.first.empty()) return kNone;
  const RTCScene scene = scene_of(cone_geometry(device_, high), high);
  Eigen::Matrix<float, 3, 4> world_from_shape;
  world_from_shape << Eigen::Matrix3f::Identity(), tree.foot.cast<float>();
  Instance instance{Surface::kStem, 1.0F, 0.0F, static_cast<float>(tree.bark_reflectivity)};
  instance.tree = tree.id;
  instance.sway = sway;
  const unsigned number = add_instance(top_, scene, world_from_shape, instance);
  if (sway != kStands) swaying_.push_back({number, sway});
  return number;
}

// The grown shape, stretched to the tree's height and crown, turned and sheared with its lean.
std::pair<unsigned, unsigned> SceneContent::add_crown(const GrownTree& tree,
                                                      const CrownScene& crown,
                                                      const CrownSize& size, std::size_t sway) {
  const auto [cos_yaw, sin_yaw] = quarter_turn(tree.yaw_rad);
  const auto wide = static_cast<float>(tree.crown_radius_m / size.crown_radius_m);
  const auto high = static_cast<float>(tree.height_m / size.height_m);
  Eigen::Matrix<float, 3, 4> world_from_shape;
  world_from_shape.col(0) << wide * cos_yaw, wide * sin_yaw, 0.0F;
  world_from_shape.col(1) << -wide * sin_yaw, wide * cos_yaw, 0.0F;
  world_from_shape.col(2) << high * static_cast<float>(tree.lean.x()),
      high * static_cast<float>(tree.lean.y()), high;
  world_from_shape.col(3) = tree.foot.cast<float>();
  const auto add = [&, x = cos_yaw, y = sin_yaw](RTCScene scene, float reflectivity) {
    Instance instance{Surface::kFoliage, x, y, reflectivity};
    instance.tree = tree.id;
    instance.sway = sway;
    const unsigned number = add_instance(top_, scene, world_from_shape, instance);
    if (sway != kStands) swaying_.push_back({number, sway});
    return number;
  };
  const unsigned living = add(crown.living, tree.species == Species::kBirch ? 0.5F : 0.42F);
  return {living, add(crown.dead, 0.3F)};
}

// Stumps, logs and branches that the harvest leaves.
void SceneContent::add_remains(const Harvest& harvest, const Stand& stand) {
  for (const GrownTree& tree : stand.trees) {
    const auto felled = felled_.find(tree.id);
    if (felled == felled_.end()) continue;
    const GrownTree::Joint low = tree.joint(-0.2);
    const GrownTree::Joint high = tree.joint(kStumpHeight);
    add_wood({low.centre, high.centre, low.radius_m, high.radius_m}, felled->second.grab_s);
    changes_.push_back(felled->second.grab_s);
  }
  for (const FallenLog& log : harvest.logs)
    add_wood(log.lying, log.lies_s);
  for (std::size_t i = 0; i < harvest.brash.size(); ++i) {
    const auto& [from_s, plant] = harvest.brash[i];
    time_limit(add_plant(top_, plant, plant_scene(plant.kind, i), 0.0), from_s, kForever);
  }
  for (const Timed& part : timed_) {
    if (part.from_s > -kForever) changes_.push_back(part.from_s);
  }
  std::sort(changes_.begin(), changes_.end());
  changes_.erase(std::unique(changes_.begin(), changes_.end()), changes_.end());
}

void SceneContent::add_wood(const Wood& wood, double from_s) {
  Cones cone;
  cone.add(wood.from, wood.radius_from_m);
  cone.join();
  cone.add(wood.to, wood.radius_to_m);
  const RTCScene scene = scene_of(cone_geometry(device_, cone), cone);
  Eigen::Matrix<float, 3, 4> world_from_shape;
  world_from_shape << Eigen::Matrix3f::Identity(), Eigen::Vector3f::Zero();
  time_limit(add_instance(top_, scene, world_from_shape, {Surface::kDeadWood, 1.0F, 0.0F, 0.32F}),
             from_s, kForever);
}

void SceneContent::time_limit(unsigned instance, double from_s, double until_s) {
  timed_.push_back({instance, from_s, until_s});
  present_[instance] = from_s <= -kForever;
  if (present_[instance]) return;
  rtcDisableGeometry(rtcGetGeometry(top_, instance));
  if (bundles_) bundles_->field().show(instance, false);
}

void SceneContent::add_plants(const Stand& stand) {
  for (std::size_t i = 0; i < stand.plants.size(); ++i) {
    const Plant& plant = stand.plants[i];
    if (snowy_ && plant.height_m < snow_m_) continue;  // covered
    add_plant(rooted_, plant, plant_scene(plant.kind, i), snowy_ ? snow_m_ : 0.0);
  }
}

void SceneContent::add_things(const Stand& stand) {
  for (const StandObject& object : stand.objects) {
    const bool walks = object.walk_m > 0.0 || !object.track.empty();
    const auto cos_yaw = static_cast<float>(std::cos(object.yaw_rad));
    const auto sin_yaw = static_cast<float>(std::sin(object.yaw_rad));
    Eigen::Matrix<float, 3, 4> world_from_shape;
    world_from_shape.col(0) << cos_yaw, sin_yaw, 0.0F;
    world_from_shape.col(1) << -sin_yaw, cos_yaw, 0.0F;
    world_from_shape.col(2) << 0.0F, 0.0F, 1.0F;
    world_from_shape.col(3) = object.foot.cast<float>();
    Instance instance{Surface::kObject, cos_yaw, sin_yaw, kThingReflectivity};
    if (walks) instance.walker = walkers_.size();
    std::vector<RTCScene> parts;
    if (!object.boards.empty()) parts.push_back(shape_scene(board_shape(object)));
    if (!object.rods.empty()) {
      const Cones rods = rod_cones(object);
      parts.push_back(scene_of(cone_geometry(device_, rods), rods));
    }
    std::vector<unsigned> instances;
    for (const RTCScene part : parts)
      instances.push_back(add_instance(walks ? top_ : rooted_, part, world_from_shape, instance));
    if (walks) walkers_.push_back({object, instances});
  }
}

RTCScene SceneContent::plant_scene(PlantKind kind, std::size_t variant) const {
  return plants_[3 * static_cast<std::size_t>(kind) + variant % 3];
}

unsigned SceneContent::add_plant(RTCScene where, const Plant& plant, RTCScene scene,
                                 double sunk_m) {
  const auto [cos_yaw, sin_yaw] = quarter_turn(plant.yaw_rad);
  const auto high = static_cast<float>(plant.height_m);
  const float wide = plant.kind == PlantKind::kGroundPlants ? 1.0F : high;
  Eigen::Matrix<float, 3, 4> world_from_shape;
  world_from_shape.col(0) << wide * cos_yaw, wide * sin_yaw, 0.0F;
  world_from_shape.col(1) << -wide * sin_yaw, wide * cos_yaw, 0.0F;
  world_from_shape.col(2) << 0.0F, 0.0F, high;
  world_from_shape.col(3) = plant.foot.cast<float>();
  world_from_shape(2, 3) -= static_cast<float>(sunk_m);
  return add_instance(where, scene, world_from_shape, {Surface::kPlant, cos_yaw, sin_yaw, 0.45F});
}

RTCScene SceneContent::new_scene() {
  RTCScene scene = rtcNewScene(device_);
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_NONE);
  scenes_.push_back(scene);
  return scene;
}

RTCScene SceneContent::shape_scene(Shape shape) {
  if (shape.triangles.empty()) {  // a bare crown: a triangle without area, which no ray meets
    shape.vertices.assign(3, Eigen::Vector3f::Zero());
    shape.triangles.emplace_back(0, 1, 2);
  }
  return scene_of(shape_geometry(device_, shape), shape);
}

unsigned SceneContent::add_instance(RTCScene where, RTCScene scene,
                                    const Eigen::Matrix<float, 3, 4>& world_from_shape,
                                    const Instance& instance) {
  RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
  rtcSetGeometryInstancedScene(geometry, scene);
  rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, world_from_shape.data());
  const auto id = static_cast<unsigned>(instances_.size());
  attach_as(where, geometry, id);
  if (bundles_) bundles_->add_instance(id, scene, world_from_shape);
  instances_.push_back(instance);
  shapes_.push_back({scene, world_from_shape});
  present_.push_back(true);
  return id;
}

// The same crowns and plants once more, to stay where they are.
RTCScene SceneContent::copy_of_instances() {
  RTCScene copy = rtcNewScene(device_);
  for (const auto& [scene, world_from_shape] : shapes_) {
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(geometry, scene);
    rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, world_from_shape.data());
    attach(copy, geometry);
  }
  commit_alone(copy);
  return copy;
}

}  // namespace understory
